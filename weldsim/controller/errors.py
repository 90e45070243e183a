"""What stops the virtual arm."""

from weldsim.errors import ExecutionError


class MotionFault(ExecutionError):
    """A motion that a controller answers with a protective stop. `data`: none."""
