"""CellConfig: the stage configs composed, read from TOML with overrides, written back as resolved JSON.

A stage joins the cell with one line in `CellConfig` and one import; its config lives beside its reader (in a module that
imports neither mujoco nor open3d, for every command reads this page).
"""

import hashlib
import json
from collections.abc import Iterable, Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeVar

from weldsim import units
from weldsim.cloud.config import CloudConfig
from weldsim.errors import ConfigError
from weldsim.execution.config import ExecutionConfig
from weldsim.meant import choice_meant, in_table, list_meant
from weldsim.motion.config import MotionConfig
from weldsim.path.config import PathConfig
from weldsim.report.limits import ReportConfig
from weldsim.scan.config import ScanConfig
from weldsim.scene.miscalibration import TwinConfig
from weldsim.schema import HIDDEN, choices, describe, keys, structure, to_json
from weldsim.seam.config import SeamConfig
from weldsim.sensor.d415 import D415Config, D435Config
from weldsim.sensor.kinect import KinectConfig
from weldsim.sensor.stereo_config import D415StereoConfig
from weldsim.settings import (
    DEFAULT,
    Given,
    Source,
    apply_overrides,
    listed,
    load_toml,
    meant_keys,
    nearest,
    nested,
    value_at,
    with_sources,
)

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

Config = TypeVar("Config")
MOST_MEANT = 4  # settings that are named where one is unknown
SCENE = "scene."
"""What the key of a scene's setting starts with where it stands beside the cell's, in `--set` say."""

__all__ = [
    "SCENE",
    "CellConfig",
    "apply_overrides",
    "describe",
    "digest",
    "for_scene",
    "limits_for",
    "load_config",
    "load_scene",
    "load_toml",
    "paced_for",
    "structure",
    "to_json",
]


@dataclass(frozen=True, kw_only=True)
class CellConfig:
    """Everything that a job can be told, one table a stage. To add a stage: import its config, add its line here."""

    twin: TwinConfig = field(default_factory=TwinConfig)
    """How the simulated cell differs from what its software believes."""

    sensor: D415Config = field(default_factory=D415Config)
    """How the simulated D415 sees."""

    d435: D435Config = field(default_factory=D435Config)
    """How a simulated D435 in its place sees (sensor d435)."""

    stereo: D415StereoConfig = field(default_factory=D415StereoConfig)
    """How the reference D415 sees (sensor d415-stereo)."""

    kinect: KinectConfig = field(default_factory=KinectConfig)
    """How the simulated Kinect v2 sees (sensor kinect)."""

    cloud: CloudConfig = field(default_factory=CloudConfig)
    """What is kept of the cloud."""

    scan: ScanConfig = field(default_factory=ScanConfig)
    """How the arm goes to the scan views, and how views are chosen."""

    seam: SeamConfig = field(default_factory=SeamConfig)
    """Which seam finder runs, and its settings."""

    path: PathConfig = field(default_factory=PathConfig)
    """How the torch is laid along a seam."""

    motion: MotionConfig = field(default_factory=MotionConfig)
    """What motion planning may choose."""

    execution: ExecutionConfig = field(default_factory=ExecutionConfig)
    """How a trajectory is executed."""

    report: ReportConfig = field(default_factory=ReportConfig)
    """Limits of the verdict."""

    given: Given = field(default_factory=dict, compare=False, repr=False, metadata=HIDDEN)
    """Where each value came from that a file or the command line gave; what is not in it is a default, or was set in Python."""

    def source(self, key: str) -> Source:
        """Where the value at a dotted key came from."""
        return self.given.get(key, DEFAULT)


def for_scene(config: CellConfig, scene: "SceneConfig | None") -> CellConfig:
    """The config with the scene's own `limits` in it, wherever nothing that goes before them was given.

    What the command line gives goes before what a file gives, that before what the scene has, that before the default; a value
    set in Python counts as given where it is another than the default, or where `given` names it. Where the report has a limit
    that motion planning has too and nothing gives it, the two are the same.
    """
    tables, given = {"report": config.report, "motion": config.motion}, dict(config.given)
    limits = {} if scene is None else {name: value for name, value in vars(scene.limits).items() if value is not None}
    for table in tables:
        for name in limits:
            source = None if scene is None else scene.given.get(f"limits.{name}", Source("scene", scene.name))
            if hasattr(tables[table], name) and source is not None and _goes_first(config, table, name, source):
                tables[table] = replace(tables[table], **{name: limits[name]})
                given[f"{table}.{name}"] = source
    for name in vars(tables["report"]):
        if hasattr(tables["motion"], name) and not _is_given(config, "report", name):
            tables["report"] = replace(tables["report"], **{name: getattr(tables["motion"], name)})
            given |= {f"report.{name}": given[key] for key in [f"motion.{name}"] if key in given}
    return replace(config, **tables, given=given)


def _is_given(config: CellConfig, table: str, name: str) -> bool:
    """Whether a file, the command line or Python gave that value; what an earlier scene put there does not count."""
    own = getattr(config, table)
    source = config.given.get(f"{table}.{name}")
    return source.kind != "scene" if source is not None else getattr(own, name) != getattr(type(own)(), name)


def _goes_first(config: CellConfig, table: str, name: str, source: Source) -> bool:
    """Whether a scene's limit, which came from `source`, goes before the config's own value."""
    return not _is_given(config, table, name) or (
        source.kind == "command line" and config.source(f"{table}.{name}").kind != "command line"
    )


def limits_for(config: CellConfig, scene: "SceneConfig | None") -> ReportConfig:
    """The limits of the verdict on a scene; see `for_scene`."""
    return for_scene(config, scene).report


def paced_for(config: CellConfig, scene: "SceneConfig | None") -> CellConfig:
    """The config with the scene's own `least_speed`, where it goes first; see `for_scene`."""
    return replace(config, motion=for_scene(config, scene).motion)


def load_scene(name: str | Path, overrides: Iterable[str] | Mapping[str, Any] = ()) -> "SceneConfig":
    """The scene of that name, or of a TOML file, with `key=value` overrides; paths in it start where its file is.

    Raises:
        SceneError: an unknown name, or no such file.  ConfigError: a file that is no scene.
    """
    from weldsim.scene.config import SceneConfig, refuse_idle  # a plan never needs it
    from weldsim.scene.files import anchored, scene_path

    path = scene_path(name)
    tables, given = with_sources(load_toml(path), Source("scene", path.stem), _of_scene(overrides))
    tables = {"name": path.stem, **anchored(tables, path.parent)}
    scene = replace(_structured(tables, SceneConfig, str(name), given), given=given)
    refuse_idle(scene)
    return scene


def _of_scene(overrides: Iterable[str] | Mapping[str, Any]) -> list[str] | dict[str, Any]:
    """The overrides of a scene's own keys; `scene.` before one, as the command line has it, is left out."""
    if isinstance(overrides, Mapping):
        return {str(key).removeprefix(SCENE): value for key, value in overrides.items()}
    return [text.removeprefix(SCENE) if isinstance(text, str) else text for text in listed(overrides)]


def load_config(
    path: str | Path | Mapping[str, Any] | None = None, overrides: Iterable[str] | Mapping[str, Any] = ()
) -> CellConfig:
    """The cell's config from a TOML file, or tables as one has them, or the defaults, with `key=value` overrides.

    Raises:
        ConfigError: the file or a setting is wrong.
    """
    where = str(path) if isinstance(path, str | Path) else "config"
    data = nested(path) if isinstance(path, Mapping) else {} if path is None else load_toml(path)
    tables, given = with_sources(data, Source("file", "" if isinstance(path, Mapping) else where), overrides)
    return replace(_structured(tables, CellConfig, where, given), given=given)


def _structured(tables: Mapping[str, Any], cls: type[Config], where: str, given: Given) -> Config:
    """`structure`; where it refuses, with what was surely meant."""
    try:
        return structure(tables, cls, where=where)
    except ConfigError as error:
        key, limit = str(error.data.get("key", "")), error.data.get("limit")
        more = ""
        if "unknown" in error.data:
            more = _meant(key, cls, given, value_at(tables, key))
        elif isinstance(limit, tuple) and "unit" in error.data:
            more = units.meant(value_at(tables, key), str(error.data["unit"]), *limit)
        elif isinstance(limit, tuple):
            more = units.meant_percent(value_at(tables, key), *limit)
        elif key in (known := choices(cls)):
            choice = choice_meant(key.rpartition(".")[2], value_at(tables, key), known[key])
            more = f"did you mean {choice}?" if choice else ""
        elif written := list_meant(value_at(tables, key)):
            more = f"did you mean {written}?"
        elif "value" in error.data and not isinstance(value_at(tables, key), Mapping):
            more = _in_table(cls, key, value_at(tables, key), _source(key, given)[1])
        if not more:
            raise
        fault, mark, allowed = str(error).partition("; allowed")
        raise ConfigError(f"{fault.partition('; did you mean')[0]}; {more}{mark}{allowed}", **error.data) from None


def _source(key: str, given: Given) -> tuple[str, Source]:
    """The dotted key as it was written, of which `key` may be the beginning, and where it came from."""
    return next(((k, v) for k, v in given.items() if k == key or k.startswith(f"{key}.")), (key, DEFAULT))


def _in_table(cls: type, table: str, value: Any, source: Source) -> str:
    """What is meant by a value in place of a table, written as where it came from takes it."""
    lead = SCENE if cls is not CellConfig and source.kind == "command line" else ""
    return in_table(cls, table, value, lead, quoted=source.kind != "command line")


def _meant(key: str, cls: type, given: Given, value: Any) -> str:
    """Which setting is meant by the unknown `key`, of this kind of config or of the other; "" where none is near.

    Args:
        value: that it was given.
    """
    from weldsim.scene.config import SceneConfig

    lead = "" if cls is CellConfig else SCENE
    written, source = _source(key, given)
    found = meant_keys(lead + written, [*keys(CellConfig), *(SCENE + one for one in keys(SceneConfig))])
    if not found and "." not in written and not isinstance(value, Mapping):
        for other in (cls, SceneConfig if cls is CellConfig else CellConfig):
            if table := nearest(written, [one.partition(".")[0] for one in keys(other) if "." in one]):
                own = other is cls or source.kind == "command line"
                return _in_table(other, table, value, source) if own else f"{table} is {_home(cls)}"
    if not found:
        return ""
    if source.kind != "command line":
        found = [one for one in found if one.startswith(SCENE) is (cls is SceneConfig)] or found
        if found[0].startswith(SCENE) is not (cls is SceneConfig):
            return f"{found[0].removeprefix(SCENE)} is {_home(cls)}"
        found = [one.removeprefix(lead) for one in found]
    return f"did you mean {' or '.join(found[:MOST_MEANT])}?"


def _home(cls: type) -> str:
    """Where a setting belongs that is not of this kind of config but of the other."""
    return "a scene's: it belongs in the scene's file" if cls is CellConfig else "the cell's: it belongs in a --config file"


def digest(config: Any) -> str:
    """The first 16 hex digits of the SHA-256 of the config's canonical JSON."""
    canonical = json.dumps(to_json(config), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]
