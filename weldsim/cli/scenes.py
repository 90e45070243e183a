"""`weldsim scenes`."""

from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, ClassVar, Literal

import tyro

from weldsim.cli.options import ConfigOptions, SceneName, choose_platform, keep_importable
from weldsim.cli.outputs import check_outputs, check_suffix
from weldsim.cli.show import print_json, progress, table
from weldsim.errors import InputError
from weldsim.settings import load_toml

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig


@dataclass(frozen=True, kw_only=True)
class Scenes(ConfigOptions):
    """List the scenes that come with weldsim, draw one, `weldsim scenes show curve`, or export one as plain MJCF."""

    reads: ClassVar[tuple[str, ...]] = ()

    action: tyro.conf.Positional[Literal["list", "show", "export"]] = "list"
    """List all, draw one, or export one."""

    scene: SceneName = ""
    """With show and export: name of a scene, or a TOML file."""

    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """Where to write. With show a PNG, SCENE.png by default: the cell and what every camera sees. With export an XML, SCENE.xml
    by default, which MuJoCo's own viewer opens; its meshes come in a folder beside it."""

    def __call__(self) -> int:
        """0."""
        return {"list": self._list, "show": self._show, "export": self._export}[self.action]()

    def _list(self) -> int:
        from weldsim.scene.files import scene_names, scene_path

        if self.scene or self.out is not None:
            raise InputError("scenes list: takes neither a scene nor --out; did you mean scenes show?")
        if self.set or self.config is not None:
            raise InputError("scenes list: takes neither --set nor --config; did you mean scenes show?")
        titles = {name: str(load_toml(scene_path(name)).get("title", "")) for name in scene_names()}
        if self.json:
            print_json({"scenes": [{"name": name, "title": title} for name, title in titles.items()]})
        else:
            print(table(list(titles.items())))
        return 0

    def _show(self) -> int:
        scene, out = self._chosen(".png", "a picture")
        choose_platform()

        from weldsim.output import write_whole
        from weldsim.scene.world import build_world
        from weldsim.sensor.portrait import portrait

        with progress() as tell:
            tell("drawing", None)
            world = build_world(scene)
            picture = portrait(world)
        write_whole(out, picture)
        if not self.json:
            for note in world.notes:
                print(f"  {note}")
        return self._wrote(scene, out)

    def _export(self) -> int:
        scene, out = self._chosen(".xml", "an MJCF scene")
        keep_importable()

        from weldsim.scene.export import write_plain_scene

        with progress() as tell:
            tell("exporting", None)
            written = write_plain_scene(out, scene)
        return self._wrote(scene, *written)

    def _chosen(self, suffix: str, what: str) -> "tuple[SceneConfig, Path]":
        """The scene that is meant, and where to write. Raises InputError, SceneError, OutputError."""
        if not self.scene:
            raise InputError(f"scenes {self.action}: give a scene")
        self.cell()  # nothing of it is used: what is set there is refused
        scene = self.scene_of(self.scene)
        out = self.out or Path(f"{Path(self.scene).stem}{suffix}")
        check_suffix(out, (suffix,), what)
        check_outputs((out,), (self.config, Path(self.scene)))
        return scene, out

    def _wrote(self, scene: "SceneConfig", *written: Path) -> int:
        if self.json:
            print_json({"scene": scene.name, "written": [str(path) for path in written]})
        else:
            for path in written:
                print(f"  wrote {path}")
        return 0
