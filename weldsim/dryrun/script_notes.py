"""What was assumed while a robot program was read, gathered into few sentences."""


class ScriptNotes:
    """Notes on one program, each thing told once."""

    def __init__(self) -> None:
        self._sentences: dict[str, str] = {}
        self._silent: dict[str, int | None] = {}  # function: line of its first call
        self._waits: dict[str, list[int]] = {}
        self._choices: dict[str, list[int]] = {}

    def add(self, about: str, sentence: str) -> None:
        """A sentence, where nothing has been said about this yet."""
        self._sentences.setdefault(about, sentence)

    def silent(self, function: str, line: int | None) -> None:
        """A function was called that does not move the arm."""
        self._silent.setdefault(function, line)

    def passed_over(self, what: str, line: int, wait: bool) -> None:
        """A wait for something unknown, or a choice that moves nothing either way."""
        lines = (self._waits if wait else self._choices).setdefault(what, [])
        if line not in lines:
            lines.append(line)

    def sentences(self) -> tuple[str, ...]:
        """All of it, one sentence each."""
        out = list(self._sentences.values())
        if self._silent:
            names = ", ".join(name if line is None else f"{name} (line {line})" for name, line in self._silent.items())
            out.append(f"passed over, since it does not move the arm: {names}")
        out += [f"{_lines(lines)}: waits for {what}; read as if the wait were over" for what, lines in self._waits.items()]
        out += [
            f"{_lines(lines)}: depends on {what}, moves nothing either way and is passed over"
            for what, lines in self._choices.items()
        ]
        return tuple(out)


def _lines(lines: list[int]) -> str:
    return f"line{'s' if len(lines) > 1 else ''} {', '.join(map(str, lines))}"
