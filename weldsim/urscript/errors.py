"""What can be wrong with a robot program."""

from weldsim.errors import InputError


class ScriptError(InputError):
    """A program that cannot be compiled, or that failed while it ran. `data`: line (from 1), reason."""

    def __init__(self, reason: str, line: int | None = None) -> None:
        super().__init__(f"URScript line {line}: {reason}" if line else f"URScript: {reason}", line=line, reason=reason)
        self.reason, self.line = reason, line
