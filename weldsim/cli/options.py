"""Options that several commands share, and how they become a config. Imports nothing heavy: every `--help` reads this."""

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from weldsim.errors import InputError
from weldsim.settings import key_of

if TYPE_CHECKING:
    from weldsim.config import CellConfig
    from weldsim.scene.config import SceneConfig

Settings = Annotated[tuple[str, ...], tyro.conf.UseAppendAction, tyro.conf.arg(metavar="KEY=VALUE")]
SceneName = Annotated[tyro.conf.Positional[str], tyro.conf.arg(metavar="SCENE")]
Method = Literal["profile", "thesis"]
SCENE_PREFIX = "scene."
EVERYTHING = ("twin", "sensor", "d435", "stereo", "kinect", "cloud", "scan", "seam", "path", "motion", "execution", "report")


def parted(words: Sequence[str]) -> tuple[str, ...]:
    """The words of a list, with those parted that were written with commas between them; a file's own name may hold one."""
    return tuple(part for word in words for part in ([word] if Path(word).exists() else filter(None, word.split(","))))


@dataclass(frozen=True, kw_only=True)
class ConfigOptions:
    """Where settings come from. Later ones win: defaults, what the scene asks for, file, --set, --method."""

    reads: ClassVar[tuple[str, ...]] = EVERYTHING
    """The tables of settings that change something here; --set of another is refused."""

    config: Path | None = None
    """TOML file with settings, one table a stage."""

    set: Settings = ()
    """One setting, path.speed="6 mm/s" say, scene.groove.width="10 mm" for one of the scene; may be repeated."""

    json: bool = False
    """Print one JSON object and nothing else on stdout."""

    def cell(self, method: Method | None = None) -> "CellConfig":
        """The resolved config. Raises ConfigError, and InputError for a --set that would change nothing here."""
        from weldsim.config import load_config

        settings = [text for text in self.set if not text.startswith(SCENE_PREFIX)]
        config = load_config(self.config, [*settings, *([f"seam.method={method}"] if method else [])])
        self._refuse_idle()
        return config

    def scene_of(self, name: str) -> "SceneConfig":
        """The scene of that name or file, with every --set that starts with `scene.`. Raises SceneError, ConfigError."""
        from weldsim.config import load_scene

        return load_scene(name, [text.removeprefix(SCENE_PREFIX) for text in self.set if text.startswith(SCENE_PREFIX)])

    def _refuse_idle(self) -> None:
        """Raises InputError for a --set, or a --config, that changes nothing here."""
        for text in self.set:
            key = key_of(text)
            if key.startswith(SCENE_PREFIX) and not getattr(self, "scene", None) and not getattr(self, "scenes", None):
                how = "give a scene with it" if hasattr(self, "scene") or hasattr(self, "scenes") else "no scene is read here"
                raise InputError(f"--set {text}: changes nothing: {how}", key=key)
            if not key.startswith(SCENE_PREFIX) and key.partition(".")[0] not in self.reads:
                read = [*self.reads, *(["scene"] if hasattr(self, "scene") else [])]
                raise InputError(f"--set {text}: changes nothing here; what is read is {', '.join(read)}", key=key)
        if self.config is not None and not self.reads:
            raise InputError(f"--config {self.config}: changes nothing here", path=str(self.config))


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
    from weldsim.opengl import rendering_backend

    platform = rendering_backend()
    if platform != "embree":
        os.environ.setdefault("MUJOCO_GL", platform)
    else:
        os.environ["MUJOCO_GL"] = "disabled"
    return platform


def keep_importable() -> None:
    """For commands that need MuJoCo and draw nothing: sets aside a MUJOCO_GL whose platform is not installed, with which
    MuJoCo could not be imported. Raises SensorError where it holds nonsense."""
    if os.environ.get("MUJOCO_GL"):
        choose_platform()
