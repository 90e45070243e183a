"""What the functions of a program accept: joints, poses, positive numbers. Each raises ScriptError in its author's words."""

from math import isfinite
from typing import Any

from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import Pose, number, type_name


def six(value: Any, name: str) -> list[float]:
    """Six finite numbers, from a list or a pose."""
    if not isinstance(value, list) or len(value) != 6:
        raise ScriptError(f"{name}: expected six numbers, not {type_name(value)}")
    out = [float(number(item)) for item in value]
    if not all(isfinite(item) for item in out):
        raise ScriptError(f"{name}: holds a number that is not finite")
    return out


def positive(value: Any, name: str) -> float:
    """A number above zero."""
    if not isfinite(number(value)) or value <= 0:
        raise ScriptError(f"{name} = {value}: must be positive")
    return float(value)


def is_pose(value: Any) -> bool:
    return type(value) is Pose
