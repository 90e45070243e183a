"""`weldsim scenes`."""

from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal

import tyro

from weldsim.cli.options import ConfigOptions, SceneName, choose_platform
from weldsim.cli.outputs import check_outputs, check_suffix
from weldsim.cli.show import print_json, progress, table
from weldsim.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Scenes(ConfigOptions):
    """List the scenes that come with weldsim, or draw one: `weldsim scenes show curve -o curve.png`."""

    action: tyro.conf.Positional[Literal["list", "show"]] = "list"
    """List all, or draw one."""

    scene: SceneName = ""
    """With show: name of a scene, or a TOML file."""

    out: Annotated[Path | None, tyro.conf.arg(aliases=["-o"])] = None
    """With show: where to write the picture, PNG: the cell, and what the camera sees from its first view."""

    def __call__(self) -> int:
        """0."""
        return self._list() if self.action == "list" else self._show()

    def _list(self) -> int:
        from weldsim.scene.files import scene_names

        if self.scene or self.out is not None:
            raise InputError("scenes list: takes neither a scene nor --out; did you mean scenes show?")
        titles = {name: self.scene_of(name).title for name in scene_names()}
        if self.json:
            print_json({"scenes": [{"name": name, "title": title} for name, title in titles.items()]})
        else:
            print(table(list(titles.items())))
        return 0

    def _show(self) -> int:
        if not self.scene or self.out is None:
            raise InputError("scenes show: give a scene and --out FILE.png")
        check_suffix(self.out, (".png",), "a picture")
        check_outputs((self.out,), (self.config,))
        scene = self.scene_of(self.scene)
        choose_platform()

        from weldsim.output import write_whole
        from weldsim.sensor.portrait import portrait

        with progress() as tell:
            tell("drawing", None)
            picture = portrait(scene)
        write_whole(self.out, picture)
        if self.json:
            print_json({"scene": scene.name, "written": [str(self.out)]})
        else:
            print(f"  wrote {self.out}")
        return 0
