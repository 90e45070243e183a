"""Values that only a robot or a thread would know: they pass through sums and functions, and nothing is decided by them."""

from collections.abc import Callable, Mapping
from functools import wraps
from typing import Any

from weldsim.frames import Transform
from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import OPERATIONS, store


class UntoldError(ScriptError):
    """A decision that depends on an unknown value. `what` names it."""

    def __init__(self, what: str) -> None:
        super().__init__(f"{what}: what follows depends on its answer and cannot be told beforehand")
        self.what = what


class Unknown:
    """What a function would say that asks a robot. Attributes: what, its name."""

    __hash__ = None  # type: ignore[assignment]

    def __init__(self, what: str) -> None:
        self.what = what

    def __bool__(self) -> bool:
        raise UntoldError(self.what)

    def _same(self, _: object) -> Any:
        return self

    __eq__ = __ne__ = __lt__ = __gt__ = __le__ = __ge__ = _same


class NoSolution(Unknown):
    """Joint angles for a pose that the arm does not reach. Attributes: X_BF, the pose; reason."""

    def __init__(self, what: str, X_BF: Transform, reason: str) -> None:
        super().__init__(f"{what}: {reason}")
        self.X_BF = X_BF


def unknown_among(*values: object) -> Unknown | None:
    """The first unknown value among these and in their lists, or None."""
    for value in values:
        if isinstance(value, Unknown):
            return value
        if isinstance(value, list) and (found := unknown_among(*value)) is not None:
            return found
    return None


def spreading(function: Callable) -> Callable:
    """The function, unknown where one of its arguments is."""

    @wraps(function)
    def spread(*arguments: object, **named: object) -> Any:
        found = unknown_among(*arguments, *named.values())
        return function(*arguments, **named) if found is None else found

    return spread


def _item(value: Any, indices: tuple[Any, ...]) -> Any:
    """An element; unknown where the list or an index is, not where another element is."""
    if isinstance(value, Unknown):
        return value
    return unknown_among(*indices) or OPERATIONS["_item"](value, indices)


def _store(value: Any, indices: tuple[Any, ...], new: Any) -> None:
    bool(unknown_among(*indices))
    if isinstance(value, Unknown):
        return
    if isinstance(new, Unknown) and len(indices) == 1:
        store(value, indices, 0.0)  # refuses an index that is not there
        value[indices[0]] = new
        return
    store(value, indices, new)


def _method(target: Any, name: str, arguments: list[Any]) -> Unknown:
    if isinstance(target, list):
        raise ScriptError(
            f".{name}(): a list's own functions are not modelled; write the list out, and get_list_length(list) for .length()"
        )
    if not isinstance(target, Unknown):
        raise ScriptError(f".{name}(): only a handle of rpc_factory has functions of its own")
    return Unknown(f"{target.what}.{name}")


UNKNOWN_OPERATIONS: Mapping[str, Callable] = {
    **{name: spreading(operation) for name, operation in OPERATIONS.items() if name != "_own"},
    "_own": OPERATIONS["_own"],
    "_item": _item,
    "_store": _store,
    "_method": _method,
    "_Untold": UntoldError,
}
"""What compiled programs call, with values that may be unknown."""
