"""The exception tree: everything weldsim raises on purpose is a `WeldsimError`.

Each error carries the data a caller needs to show or repair the problem (path, key, value, limit) as attributes,
and its message is one line: what, where, the limit, what to do. `exit_code` is what the command line returns.
"""


class WeldsimError(Exception):
    """Root of the tree. `exit_code` 2 means bad input, 1 means a job that was understood and cannot succeed."""

    exit_code = 2

    def __init__(self, message: str, **data: object) -> None:
        super().__init__(" ".join(message.split()))
        self.data = data


class InputError(WeldsimError):
    """The user gave something that cannot be used: a file, a value, a name."""


class CloudFileError(InputError):
    """A cloud, depth or intrinsics file is missing, unreadable or not what its name says. `data`: path, reason."""


class CloudError(InputError):
    """A cloud was read but cannot be planned on: empty, degenerate, in the wrong unit. `data`: the offending figure."""


class ConfigError(InputError):
    """A configuration file, key or value is wrong. `data`: key, value, allowed."""


class SceneError(InputError):
    """A scene is unknown or contradicts itself (a groove wider than its plate). `data`: scene, key, limit."""


class OutputError(InputError):
    """The output cannot be written. `data`: path."""


class RecordError(WeldsimError):
    """A record's own invariant does not hold (shape, finiteness, unit length, order). `data`: field, value."""


class FrameError(WeldsimError):
    """Two transforms whose inner frame letters differ were composed. `data`: left, right."""


class SensorError(WeldsimError):
    """A camera cannot deliver: no rendering back end, nothing in view. `data`: backend, reason."""


class NoSeamError(WeldsimError):
    """The cloud was understood and holds no seam. `data`: candidates with the reason each was rejected."""

    exit_code = 1


class PathError(WeldsimError):
    """A torch path cannot be laid along a seam as asked. `data`: length, s, limit."""

    exit_code = 1


class MotionError(WeldsimError):
    """The arm cannot do what the path asks. `data`: index, arc length, joint, limit."""

    exit_code = 1


class UnreachableError(MotionError):
    """No joint solution within limits for a torch pose. `data`: index, position, distance, reach."""


class ViewError(UnreachableError):
    """A scene asks for a view of its part that the arm cannot take: the scene is at fault. `data`: view, position."""

    exit_code = 2


class ExecutionError(MotionError):
    """The arm was stopped while moving. `data`: rule, value, limit, t."""


class Interrupted(KeyboardInterrupt):
    """Somebody interrupted an arm that was moving; it was stopped first. `log`: what it did until it was at rest."""

    def __init__(self, message: str, log: object) -> None:
        super().__init__(message)
        self.log = log
