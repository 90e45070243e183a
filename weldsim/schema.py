"""From the tables of a TOML file to frozen dataclasses and back to JSON, and the help text of every field.

Knows no stage: `weldsim.config` composes the stages' configs, and any dataclass (a scene, a job) can be read this way.
Fields typed with an alias of `weldsim.quantity` take text with a unit ("12 mm") or a bare SI number.
"""

import ast
import difflib
import inspect
import json
import math
import re
import textwrap
from collections.abc import Callable, Iterable, Mapping
from dataclasses import MISSING, dataclass, fields, is_dataclass
from enum import Enum, EnumType
from functools import cache
from itertools import pairwise
from types import UnionType
from typing import Annotated, Any, Literal, TypeVar, Union, get_args, get_origin, get_type_hints

from cattrs import AttributeValidationNote, ClassValidationError, Converter, IterableValidationError, IterableValidationNote
from cattrs.errors import ForbiddenExtraKeysError
from cattrs.gen import make_dict_structure_fn, make_dict_unstructure_fn, override

from weldsim import units
from weldsim.counted import counted
from weldsim.errors import ConfigError, WeldsimError

Config = TypeVar("Config")
HIDDEN = {"hidden": True}
"""Metadata of a dataclass field that is no setting: neither read nor written."""


def structure(data: Mapping[str, Any], cls: type[Config], *, where: str = "config") -> Config:
    """An instance of the config dataclass `cls` from nested tables.

    Args:
        data: as `load_toml` gives it; lists stand for tuples, text with a unit for quantities.
        cls: a dataclass of bool, int, float, str, quantities, Literal, Enum, tuples, optional values, dataclasses.
        where: what to call the source in an error (a file name, say).
    Raises:
        ConfigError: an unknown or missing key, a value of the wrong type or outside its choices, named by dotted path.
    """
    try:
        return CONVERTER.structure(data, cls)
    except (ClassValidationError, IterableValidationError, WeldsimError, ValueError, TypeError) as error:
        faults = list(_faults(error, ""))
        message, data_ = faults[0]
        more = f" (and {len(faults) - 1} more)" if len(faults) > 1 else ""
        raise ConfigError(f"{where}: {message}{more}", **data_) from None


def to_json(config: Any) -> dict[str, Any]:
    """The config resolved: nested dicts, lists, SI numbers and text, as `json.dumps` takes them."""
    return json.loads(json.dumps(CONVERTER.unstructure(config), default=str))


def settings(cls: Any) -> list[Any]:
    """The fields of the config dataclass `cls` that are settings."""
    return [entry for entry in fields(cls) if not entry.metadata.get("hidden")]


def keys(cls: type, prefix: str = "") -> list[str]:
    """Dotted key of every setting of `cls` and of the tables inside it, in order; an array of tables is one setting."""
    found, hints = [], get_type_hints(cls, include_extras=True)
    for entry in settings(cls):
        inner = next((part for part in _parts(hints[entry.name]) if isinstance(part, type) and is_dataclass(part)), None)
        array = any(get_origin(part) is tuple for part in _parts(hints[entry.name]))
        found += [prefix + entry.name] if inner is None or array else keys(inner, f"{prefix}{entry.name}.")
    return found


def choices(cls: type, prefix: str = "") -> dict[str, tuple[Any, ...]]:
    """What each setting of `cls`, and of the tables inside it, may be, for those that have a few choices; by dotted key."""
    found: dict[str, tuple[Any, ...]] = {}
    hints = get_type_hints(cls, include_extras=True)
    for entry in settings(cls):
        parts = _parts(hints[entry.name])
        inner = next((part for part in parts if isinstance(part, type) and is_dataclass(part)), None)
        if any(get_origin(part) is tuple for part in parts):
            continue
        if inner is not None:
            found |= choices(inner, f"{prefix}{entry.name}.")
        own = next((get_args(part) for part in parts if get_origin(part) is Literal), (True, False) if bool in parts else ())
        if own:
            found[prefix + entry.name] = own
    return found


@dataclass(frozen=True, kw_only=True)
class FieldDoc:
    """One line of help. Attributes: key (dotted), type, default and unit as text, doc (one paragraph)."""

    key: str
    type: str
    default: str
    unit: str
    doc: str


def describe(cls: type, *, prefix: str = "") -> list[FieldDoc]:
    """Every field of the config dataclass `cls` and of those inside it, in order, with its documentation."""
    hints, docs, lines = get_type_hints(cls, include_extras=True), _field_docs(cls), []
    for entry in settings(cls):
        key, hint = prefix + entry.name, hints[entry.name]
        inner = next((part for part in _parts(hint) if isinstance(part, type) and is_dataclass(part)), None)
        if inner is not None and inner is hint:
            lines += describe(inner, prefix=key + ".")
            continue
        unit = next((part.__metadata__[0] for part in _parts(hint) if _is_quantity(part)), "")
        default = entry.default
        if entry.default_factory is not MISSING:
            default = entry.default_factory()
        shown = "required" if default is MISSING else json.dumps(CONVERTER.unstructure(default), default=str)
        lines.append(FieldDoc(key=key, type=_type_name(hint), default=shown, unit=unit, doc=docs.get(entry.name, "")))
        if inner is not None:  # an optional table, or a tuple of them
            lines += describe(inner, prefix=key + ("[]." if any(get_origin(part) is tuple for part in _parts(hint)) else "."))
    return lines


@cache
def _field_docs(cls: type) -> dict[str, str]:
    """Doc of each field: the string under it, else its entry in the class docstring's Attributes; else that of a base class."""
    inherited = {name: text for base in reversed(cls.__mro__[1:]) if is_dataclass(base) for name, text in _field_docs(base).items()}
    return inherited | _own_docs(cls)


def _own_docs(cls: type) -> dict[str, str]:
    """Doc of each field that a class documents itself."""
    names = {entry.name for entry in fields(cls)}
    entries = re.finditer(
        r"(?:^\s*|  )(\w+(?:, \w+)*): (.+?)(?=\n\s*\w+(?:, \w+)*:|  \w+(?:, \w+)*: |\n\n|\Z)", cls.__doc__ or "", re.M | re.S
    )
    docs = {name: " ".join(match[2].split()) for match in entries for name in match[1].split(", ") if name in names}
    try:
        body = ast.parse(textwrap.dedent(inspect.getsource(cls))).body[0]
    except (OSError, TypeError, SyntaxError):
        return docs
    statements = body.body if isinstance(body, ast.ClassDef) else []
    for above, below in pairwise(statements):
        match above, below:
            case ast.AnnAssign(target=ast.Name(id=name)), ast.Expr(value=ast.Constant(value=str(text))):
                docs[name] = " ".join(text.split())
    return docs


def _parts(hint: Any) -> list[Any]:
    """`hint` and, inside out, every type it is made of."""
    if _is_quantity(hint) or get_origin(hint) is Literal:
        return [hint]
    return [hint, *(part for inner in get_args(hint) for part in _parts(inner))]


def _type_name(hint: Any) -> str:
    """How a person would name the type of a value in TOML."""
    if _is_quantity(hint):
        return f"quantity in {hint.__metadata__[0]}"
    if get_origin(hint) is Literal:
        return " | ".join(repr(choice) for choice in get_args(hint))
    if _is_union(hint):
        return " | ".join(_type_name(part) for part in get_args(hint))
    if get_origin(hint) is tuple and is_dataclass(get_args(hint)[0]):
        return "array of tables"
    if get_origin(hint) is tuple:
        return f"({', '.join('...' if part is Ellipsis else _type_name(part) for part in get_args(hint))})"
    if hint is type(None):
        return "none"
    if isinstance(hint, type) and issubclass(hint, Enum):
        return " | ".join(repr(member.value) for member in hint)
    if is_dataclass(hint):
        return "table"
    return {bool: "true | false", int: "whole number", float: "number", str: "text"}.get(hint, str(hint))


def _is_quantity(hint: Any) -> bool:
    return get_origin(hint) is Annotated and hint.__metadata__[0] in units.DIMENSIONS


def _is_union(hint: Any) -> bool:
    return get_origin(hint) in (Union, UnionType)


def _wrong(value: Any, hint: Any) -> ConfigError:
    shown = repr(value) if len(repr(value)) <= 60 else repr(value)[:57] + "..."
    return ConfigError(f"{shown} is no {_type_name(hint)}", value=value)


def _plain(value: Any, hint: Any) -> Any:
    """`value` if it is of the plain type `hint` (an int counts as a float, a bool as no number)."""
    if isinstance(hint, EnumType):  # cattrs hands a StrEnum to the hook of str
        return _choice(value, hint)
    if hint is float and isinstance(value, int | float) and not isinstance(value, bool) and math.isfinite(value):
        return float(value)
    if hint is float and isinstance(value, str) and (share := units.percent(value)) is not None:
        return share
    if hint is not float and type(value) is hint:
        return value
    raise _wrong(value, hint)


def _quantity(value: Any, hint: Any) -> float:
    return units.parse(value, hint.__metadata__[0])


def _choice(value: Any, hint: Any) -> Any:
    """The Literal value or Enum member that `value` names."""
    members = list(hint) if isinstance(hint, EnumType) else list(get_args(hint))
    allowed = [member.value if isinstance(member, Enum) else member for member in members]
    for member, name in zip(members, allowed, strict=True):
        if value is member or (type(value) is type(name) and value == name):
            return member
    raise ConfigError(
        f"{value!r} is not one of {', '.join(map(str, allowed))}{_nearest(value, allowed)}", value=value, allowed=allowed
    )


def _nearest(word: Any, allowed: Iterable[Any]) -> str:
    match = difflib.get_close_matches(str(word), [str(name) for name in allowed], n=1)
    return f"; did you mean {match[0]}?" if match else ""


def _union(value: Any, hint: Any) -> Any:
    """`value` as the first member of the union that takes it."""
    members = get_args(hint)
    if type(None) in members and (value is None or (value == "none" and str not in members)):  # as `weldsim config` shows it
        return None
    members = [member for member in members if member is not type(None)]
    if len(members) == 1:
        return CONVERTER.structure(value, members[0])
    for member in members:
        try:
            return CONVERTER.structure(value, member)
        except (ClassValidationError, IterableValidationError, ConfigError):
            continue
    raise _wrong(value, hint)


def _tuple(value: Any, hint: Any) -> tuple[Any, ...]:
    types = get_args(hint)
    if not isinstance(value, list | tuple):
        raise _wrong(value, hint)
    if len(types) == 2 and types[1] is Ellipsis:
        types = (types[0],) * len(value)
    if len(types) != len(value):
        raise ConfigError(
            f"holds {counted(len(value), 'value')}, {len(types)} {'is' if len(types) == 1 else 'are'} needed: {_type_name(hint)}",
            value=value,
        )
    result, errors = [], []
    for index, (item, kind) in enumerate(zip(value, types, strict=True)):
        try:
            result.append(CONVERTER.structure(item, kind))
        except (ClassValidationError, IterableValidationError, ConfigError) as error:
            error.add_note(IterableValidationNote("", index, kind))
            errors.append(error)
    if errors:
        raise IterableValidationError("", errors, hint)  # pyright: ignore[reportCallIssue]  # ExceptionGroup hides it
    return tuple(result)


def _table_hook(cls: Any) -> Callable[[Any, Any], Any]:
    """The structuring function of the dataclass `cls`: cattrs' own, behind a check that a table was given."""
    omitted = _omitted(cls)
    inner: Any = make_dict_structure_fn(cls, CONVERTER, _cattrs_forbid_extra_keys=True, _cattrs_detailed_validation=True, **omitted)

    def structure_table(value: Any, kind: Any) -> Any:
        if isinstance(value, cls):
            return value
        if not isinstance(value, Mapping):
            raise _wrong(value, kind)
        return inner(value, kind)

    return structure_table


def _omitted(cls: Any) -> Any:
    """What tells cattrs to leave hidden fields alone."""
    return {entry.name: override(omit=True) for entry in fields(cls) if entry.metadata.get("hidden")}


def _table_dumper(cls: Any) -> Callable[[Any], Any]:
    return make_dict_unstructure_fn(cls, CONVERTER, **_omitted(cls))


def _faults(error: BaseException, path: str, cl: Any = None) -> Iterable[tuple[str, dict[str, Any]]]:
    """(message, data) of every leaf of a cattrs error, each message led by its dotted path. Args: cl, whose field is at fault."""
    for note in getattr(error, "__notes__", ()):
        if isinstance(note, AttributeValidationNote):
            path = f"{path}.{note.name}".lstrip(".")
        elif isinstance(note, IterableValidationNote):
            path = f"{path}[{note.index}]"
    lead = f"{path}: " if path else ""
    if isinstance(error, ClassValidationError | IterableValidationError):
        for inner in error.exceptions:
            yield from _faults(inner, path, error.cl)
    elif isinstance(error, ForbiddenExtraKeysError):
        allowed = [entry.name for entry in settings(error.cl)]
        for key in sorted(map(str, error.extra_fields)):
            dotted = f"{path}.{key}".lstrip(".")
            hint = _nearest(key, allowed)
            yield (
                f"unknown key {dotted!r}{hint}; allowed: {', '.join(allowed)}",
                {"key": dotted, "allowed": allowed, "unknown": True},
            )
    elif isinstance(error, KeyError):
        dotted = f"{path}.{error.args[0]}".lstrip(".") if not path.endswith(str(error.args[0])) else path
        hint = None if not isinstance(cl, type) else get_type_hints(cl, include_extras=True).get(str(error.args[0]))
        wanted = f": one of {', '.join(map(str, get_args(hint)))}" if get_origin(hint) is Literal else ""
        yield f"key {dotted!r} is missing{wanted}", {"key": dotted}
    else:
        data, text = dict(getattr(error, "data", {})), str(error).removeprefix("value: ")
        data["key"] = _under(path, str(data["key"])) if "key" in data else path
        named = re.match(r"([\w.]+)(?=:| = )", text)
        if named and data["key"].endswith(named[1]) and _under(path, named[1]) == data["key"]:  # it names itself
            lead, text = "", data["key"] + text[named.end() :]
        yield lead + text, data


def _under(path: str, key: str) -> str:
    """The dotted path of `key` in the table at `path`; what of the path it repeats is not said twice."""
    tables, own = path.split("."), key.split(".")
    shared = next((n for n in range(len(own) - 1, 0, -1) if tables[-n:] == own[:n]), 0)
    return ".".join([*tables, *own[shared:]]).lstrip(".")


def _make_converter() -> Converter:
    converter = Converter(detailed_validation=True)
    for kind in (bool, int, float, str):
        converter.register_structure_hook(kind, _plain)
    converter.register_structure_hook_func(lambda hint: isinstance(hint, type) and issubclass(hint, Enum), _choice)
    converter.register_structure_hook_func(lambda hint: get_origin(hint) is Literal, _choice)
    converter.register_structure_hook_func(lambda hint: get_origin(hint) is tuple, _tuple)
    converter.register_structure_hook_func(_is_union, _union)
    converter.register_structure_hook_func(_is_quantity, _quantity)
    converter.register_structure_hook_factory(is_dataclass, _table_hook)
    converter.register_unstructure_hook_factory(is_dataclass, _table_dumper)
    return converter


CONVERTER = _make_converter()
