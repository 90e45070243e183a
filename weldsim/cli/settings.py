"""`weldsim config`."""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from typing import TYPE_CHECKING, Annotated, Any

import tyro

from weldsim import units
from weldsim.cli.options import ConfigOptions
from weldsim.cli.show import print_json, table
from weldsim.rounded import FINE

if TYPE_CHECKING:
    from weldsim.settings import Given


WIDEST = 48  # characters of a value in the table; --json has all of it


@dataclass(frozen=True, kw_only=True)
class Config(ConfigOptions):
    """Show every setting with its value, its unit and where the value comes from.

    Sources are default, scene, file (--config) and command line (--set); each goes before those named ahead of it. With a
    SCENE its limits are taken in and its own settings are shown too. A row is written as --set takes it: KEY="VALUE UNIT".
    """

    scene: Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SCENE")] = ""
    """Name of a scene (`weldsim scenes`), or a TOML file."""

    given: bool = False
    """Show only what was given: no defaults."""

    def __call__(self) -> int:
        """0."""
        from weldsim.config import for_scene

        scene = self.scene_of(self.scene) if self.scene else None
        config = for_scene(self.cell(), scene)
        rows = [*_rows(config, config.given), *([] if scene is None else _rows(scene, scene.given, "scene."))]
        rows = [row for row in rows if not self.given or row["source"] != "default"]
        if self.json:
            print_json({"scene": None if scene is None else scene.name, "settings": rows}, decimals=FINE)
        elif rows:
            print(table([_row_of_text(row) for row in rows], ("setting", "value", "unit", "source")))
        else:
            print("  every setting has its default")
        return 0


def _rows(config: Any, given: "Given", lead: str = "") -> Iterator[dict[str, Any]]:
    """Key, SI value, unit, source and meaning of every setting of a config."""
    from weldsim.config import describe, to_json
    from weldsim.schema import keys
    from weldsim.settings import DEFAULT, value_at

    values, about = to_json(config), {entry.key: entry for entry in describe(type(config))}
    for key in keys(type(config)):
        entry = about.get(key)
        source = next((given[one] for one in _upwards(key) if one in given), DEFAULT)
        yield {
            "key": lead + key,
            "value": value_at(values, key),
            "unit": entry.unit if entry is not None else "",
            "source": source.kind,
            "from": source.name or None,
            "doc": entry.doc if entry is not None else "",
        }


def _upwards(key: str) -> Iterator[str]:
    """The key and those of the tables that it is in."""
    while key:
        yield key
        key = key.rpartition(".")[0]


def _row_of_text(row: dict[str, Any]) -> list[str]:
    value, unit = row["value"], ""
    if value is None:
        text = "none"
    elif row["unit"] and isinstance(value, int | float):
        text, unit = units.written(value, row["unit"])
    elif isinstance(value, str):
        text = value
    elif row["unit"] and isinstance(value, list) and all(isinstance(one, int | float) for one in value):
        text = json.dumps([" ".join(units.written(one, row["unit"])) for one in value])
    else:
        text = json.dumps(value, ensure_ascii=False)
    return [
        row["key"],
        text if len(text) <= WIDEST else f"{text[: WIDEST - 3]}...",
        unit,
        f"{row['source']} {row['from'] or ''}".rstrip(),
    ]
