"""What stops the virtual arm."""

from weldsim.errors import ExecutionError


class MotionFault(ExecutionError):  # noqa: N818 - it is what a controller calls it
    """A motion that a controller answers with a protective stop. `data`: none."""
