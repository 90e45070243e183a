"""Which setting or choice is surely meant where a value is given that it cannot be; "" where none is."""

import json
import re
from typing import Any

from weldsim import units
from weldsim.schema import choices, keys
from weldsim.settings import MEANT_VALUES, NOTHING, nearest

YES, NO = ("true", "yes", "on", "1"), ("false", "0", *NOTHING)


def choice_meant(name: str, value: Any, known: tuple[Any, ...]) -> str:
    """Which choice of the setting of that name is meant, as one would write it.

    Args:
        known: the choices there are.
    """
    word, written = str(value).strip().lower(), {str(one).lower(): one for one in known}
    if set(known) == {True, False}:
        return "true" if word in YES else "false" if word in NO else ""
    if word in NOTHING and "0" in written:
        return "0"
    said = MEANT_VALUES.get(name, {}).get(word) or (units.known_unit(word, "m") if name == "units" else "")
    return said if said in written else word if word in written else nearest(word, written)


def list_meant(value: Any) -> str:
    """How a list is written of which the values were given alone, "0,0,10 mm" say; "" for what is none."""
    parts = [part.strip() for part in value.split(",")] if isinstance(value, str) and "," in value else []
    if len(parts) < 2 or not all(re.fullmatch(r"[-+]?(\d+\.?\d*|\.\d+)(e[-+]?\d+)?( ?[a-z/^0-9]+)?", part, re.I) for part in parts):
        return ""
    plain = all(re.fullmatch(r"[-+.\de]+", part, re.I) for part in parts)
    return f"[{','.join(parts if plain else map(json.dumps, parts))}]"


def in_table(cls: type, table: str, value: Any, lead: str = "", *, quoted: bool = False) -> str:
    """The setting in a table with the value that was given for the table itself, "seam.method=thesis" for seam = "thesis"; else
    what settings there are in it.

    Args:
        table: its dotted key in `cls`.  lead: what goes before the keys that are told.  quoted: text in quotes, as in a file.
    """
    inside = [key for key in keys(cls) if key.startswith(f"{table}.")]
    if not inside:
        return ""
    if str(value).lower() in NO and f"{table}.enabled" in inside:
        return f"did you mean {lead}{table}.enabled=false?"
    known = {key: own for key, own in choices(cls).items() if key in inside and set(own) != {True, False}}
    meant = {key: choice_meant(key.rpartition(".")[2], value, own) for key, own in known.items()}
    depth = min((key.count(".") for key, choice in meant.items() if choice), default=0)
    told = [
        f"{lead}{key}={json.dumps(choice) if quoted and choice in known[key] else choice}"
        for key, choice in meant.items()
        if choice and key.count(".") == depth
    ]
    if told:
        return f"did you mean {' or '.join(told)}?"
    names = dict.fromkeys(key.removeprefix(f"{table}.").partition(".")[0] for key in inside)
    return f"{lead}{table} holds {', '.join(names)}"
