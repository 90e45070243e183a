"""What stops the virtual arm."""

from weldsim.errors import ExecutionError


class MotionFault(ExecutionError):  # noqa: N818 - it is what a controller calls it
    """A motion that a controller answers with a protective stop. `data`: none."""


class TooFast(MotionFault):
    """A joint would have to be faster than it can; on a path of its own the controller slows down instead. `data`: none."""
