"""What URScript computes with: numbers, booleans, strings, lists, poses; wrong mixtures are refused."""

from typing import Any

from weldsim.urscript.errors import ScriptError


class Pose(list):
    """p[x, y, z, rx, ry, rz]: metres and a rotation vector [rad]."""

    def __repr__(self) -> str:
        return f"p{super().__repr__()}"


def make_pose(items: list[float]) -> Pose:
    """A pose of six numbers. Raises ScriptError."""
    for item in items:
        number(item)
    return Pose(items)


def own(value: Any) -> Any:
    """`value`, a list copied: lists are values, two variables never share one."""
    if type(value) is Pose:
        return Pose(value)
    return [own(item) for item in value] if type(value) is list else value


def number(value: Any) -> float:
    """`value` if it is a number. Raises ScriptError."""
    if type(value) is float or type(value) is int:
        return value
    if type(value) is bool:
        raise ScriptError(f"expected a number, not {value}")
    raise ScriptError(f"expected a number, not {type_name(value)}")


def type_name(value: Any) -> str:
    """What a person calls the type of `value`."""
    names = {bool: "a boolean", int: "a number", float: "a number", str: "a string", Pose: "a pose", list: "a list"}
    return names.get(type(value), "nothing")


def add(a: Any, b: Any) -> float:
    return number(a) + number(b)


def subtract(a: Any, b: Any) -> float:
    return number(a) - number(b)


def multiply(a: Any, b: Any) -> float:
    return number(a) * number(b)


def divide(a: Any, b: Any) -> float:
    if number(b) == 0:
        raise ScriptError("division by zero")
    return number(a) / b


def modulo(a: Any, b: Any) -> float:
    if number(b) == 0:
        raise ScriptError("division by zero")
    return number(a) % b


def negate(a: Any) -> float:
    return -number(a)


def item(value: Any, indices: tuple[Any, ...]) -> Any:
    """value[i], or value[i, j] of a matrix. Raises ScriptError for an index that is not there."""
    for index in indices:
        if not isinstance(value, list):
            raise ScriptError(f"{type_name(value)} has no elements")
        value = value[_position(value, index)]
    return value


def call_method(target: Any, name: str, arguments: list[Any]) -> None:
    """Raises ScriptError: no server of remote procedures answers."""
    raise ScriptError(f".{name}(): no server answers here; functions of rpc_factory's handles are not modelled")


def store(value: Any, indices: tuple[Any, ...], new: Any) -> None:
    """value[i] = new. Raises ScriptError for an index that is not there."""
    holder = item(value, indices[:-1])
    if not isinstance(holder, list):
        raise ScriptError(f"{type_name(holder)} has no elements")
    holder[_position(holder, indices[-1])] = number(new) if type(holder) is Pose else new


def _position(values: list, index: Any) -> int:
    if type(index) is not int or not 0 <= index < len(values):
        raise ScriptError(f"index {index} is not one of 0 to {len(values) - 1}")
    return index


OPERATIONS = {
    "_add": add,
    "_subtract": subtract,
    "_multiply": multiply,
    "_divide": divide,
    "_modulo": modulo,
    "_negate": negate,
    "_item": item,
    "_store": store,
    "_method": call_method,
    "_own": own,
    "_pose": make_pose,
}
"""What compiled programs call, by the names the compiler writes."""
