"""CellConfig: the stage configs composed, read from TOML with overrides, written back as resolved JSON.

A stage joins the cell with one line in `CellConfig` and one import; its config lives beside its reader (in a module that
imports neither mujoco nor open3d, for every command reads this page).
"""

import hashlib
import json
import tomllib
from collections.abc import Iterable, Mapping
from copy import deepcopy
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import TYPE_CHECKING, Any

from weldsim.cloud.config import CloudConfig
from weldsim.errors import ConfigError
from weldsim.execution.config import ExecutionConfig
from weldsim.motion.config import MotionConfig
from weldsim.path.config import PathConfig
from weldsim.report.limits import ReportConfig
from weldsim.scan.config import ScanConfig
from weldsim.scene.miscalibration import TwinConfig
from weldsim.schema import describe, structure, to_json
from weldsim.seam.config import SeamConfig
from weldsim.sensor.d415 import D415Config, D435Config
from weldsim.sensor.kinect import KinectConfig
from weldsim.sensor.stereo_config import D415StereoConfig

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

__all__ = [
    "CellConfig",
    "apply_overrides",
    "describe",
    "digest",
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


def limits_for(config: CellConfig, scene: "SceneConfig | None") -> ReportConfig:
    """The limits of the verdict on a scene: its own where it has some and the config leaves the general ones as they are."""
    general, report = ReportConfig(), config.report
    if scene is None:
        return report
    own = {name: value for name, value in vars(scene.limits).items() if value is not None and hasattr(report, name)}
    return replace(report, **{name: value for name, value in own.items() if getattr(report, name) == getattr(general, name)})


def paced_for(config: CellConfig, scene: "SceneConfig | None") -> CellConfig:
    """The config with the scene's own `least_speed`, where it has one and the config leaves the general one as it is."""
    own, general = None if scene is None else scene.limits.least_speed, MotionConfig().least_speed
    if own is None or config.motion.least_speed != general:
        return config
    return replace(config, motion=replace(config.motion, least_speed=own))


def load_toml(path: str | Path) -> dict[str, Any]:
    """The tables of a TOML file.

    Raises:
        ConfigError: the file is missing, unreadable, not UTF-8 or not TOML (with the line).
    """
    try:
        return tomllib.loads(Path(path).read_bytes().decode())
    except FileNotFoundError:
        raise ConfigError(f"{path}: no such file", path=str(path)) from None
    except OSError as error:
        raise ConfigError(f"{path}: cannot be read ({error.strerror})", path=str(path)) from None
    except (UnicodeDecodeError, ValueError, RecursionError) as error:
        reason = "not UTF-8 text" if isinstance(error, UnicodeDecodeError) else str(error)
        raise ConfigError(f"{path}: no TOML: {reason}", path=str(path)) from None


def load_scene(name: str | Path, overrides: Iterable[str] = ()) -> "SceneConfig":
    """The scene of that name, or of a TOML file, with `key=value` overrides; paths in it start where its file is.

    Raises:
        SceneError: an unknown name, or no such file.  ConfigError: a file that is no scene.
    """
    from weldsim.scene.config import SceneConfig  # a plan never needs it
    from weldsim.scene.files import anchored, scene_path

    path = scene_path(name)
    tables = anchored(apply_overrides(load_toml(path), overrides), path.parent)
    return structure({"name": path.stem, **tables}, SceneConfig, where=str(name))


def load_config(path: str | Path | None = None, overrides: Iterable[str] = ()) -> CellConfig:
    """The cell's config from a TOML file (or the defaults) with `key=value` overrides. Raises ConfigError."""
    data = apply_overrides({} if path is None else load_toml(path), overrides)
    return structure(data, CellConfig, where="config" if path is None else str(path))


def apply_overrides(data: Mapping[str, Any], overrides: Iterable[str]) -> dict[str, Any]:
    """A copy of `data` with every `dotted.key=value` set; the value is TOML if it reads as such, else plain text.

    Raises:
        ConfigError: no `=`, an empty key, or a key that leads through a value.
    """
    result: dict[str, Any] = deepcopy(dict(data))
    for text in overrides:
        key, equals, value = text.partition("=")
        parts = [part.strip() for part in key.split(".")]
        if not equals or not all(parts):
            raise ConfigError(f"override {text!r}: write dotted.key=value, seam.method=thesis say", value=text)
        table = result
        for depth, part in enumerate(parts[:-1]):
            table = table.setdefault(part, {})
            if not isinstance(table, dict):
                raise ConfigError(f"override {text!r}: {'.'.join(parts[: depth + 1])} is a value, not a table", value=text)
        table[parts[-1]] = _toml_value(value.strip())
    return result


def _toml_value(text: str) -> Any:
    try:
        parsed = tomllib.loads(f"value = {text}")
    except (ValueError, RecursionError):
        return text
    return parsed["value"] if list(parsed) == ["value"] else text


def digest(config: Any) -> str:
    """The first 16 hex digits of the SHA-256 of the config's canonical JSON."""
    canonical = json.dumps(to_json(config), sort_keys=True, separators=(",", ":"))
    return hashlib.sha256(canonical.encode()).hexdigest()[:16]
