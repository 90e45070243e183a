"""Options that several commands share, and how they become a config."""

import os
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Literal

import tyro

from weldsim.config import CellConfig, load_config, load_scene
from weldsim.errors import InputError

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

Settings = Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="KEY=VALUE")]
SceneName = Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SCENE")]
Method = Literal["profile", "thesis"]
SCENE_PREFIX = "scene."


@dataclass(frozen=True, kw_only=True)
class ConfigOptions:
    """Where settings come from. Later ones win: defaults, file, --set, --method."""

    config: Path | None = None
    """TOML file with settings, one table a stage."""

    set: Settings = ()
    """One setting, path.speed="6 mm/s" say; may be repeated."""

    json: bool = False
    """Print one JSON object and nothing else on stdout."""

    def cell(self, method: Method | None = None) -> CellConfig:
        """The resolved config. Raises ConfigError."""
        settings = [text for text in self.set if not text.startswith(SCENE_PREFIX)]
        return load_config(self.config, [*settings, *([f"seam.method={method}"] if method else [])])

    def scene_of(self, name: str) -> "SceneConfig":
        """The scene of that name or file, with every --set that starts with `scene.`. Raises SceneError, ConfigError."""
        return load_scene(name, [text.removeprefix(SCENE_PREFIX) for text in self.set if text.startswith(SCENE_PREFIX)])


def refuse_together(**given: object) -> None:
    """Raises InputError when more than one of the options was given, named as keywords with _ for -."""
    names = [f"--{name.replace('_', '-')}" for name, value in given.items() if value is not None]
    if len(names) > 1:
        raise InputError(f"{' and '.join(names)} exclude each other; give one", options=names)


def choose_platform() -> str:
    """What draws here, an OpenGL platform or "embree"; MUJOCO_GL is set to the platform where nobody chose one.

    MuJoCo reads it when it is imported, and without it may take a platform that does not draw; one that is not installed
    keeps it from being imported, so where nothing draws it is set to "disabled". Raises SensorError where it holds nonsense.
    """
    from weldsim.sensor.backend import rendering_backend

    platform = rendering_backend()
    if platform != "embree":
        os.environ.setdefault("MUJOCO_GL", platform)
    else:
        os.environ["MUJOCO_GL"] = "disabled"
    return platform
