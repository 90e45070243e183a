"""Where scenes and assets lie: at the top of a checkout, or inside the installed package."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

from weldsim.errors import SceneError
from weldsim.settings import nearest

_PACKAGE = Path(__file__).resolve().parents[1]


def _data_folder(name: str) -> Path:
    """The folder `name` of the wheel (weldsim/_data) if it is there, else of the checkout."""
    packed = _PACKAGE / "_data" / name
    return packed if packed.is_dir() else _PACKAGE.parent / name


def scenes_folder() -> Path:
    """Folder of the scene files that come with weldsim."""
    return _data_folder("scenes")


def scene_names() -> tuple[str, ...]:
    """Names of the scenes that come with weldsim, sorted."""
    return tuple(sorted(path.stem for path in scenes_folder().glob("*.toml")))


OTHERS = (
    (
        (".stl", ".obj"),
        'a mesh, no scene; write a TOML file beside it: workpiece = "mesh", and under [mesh] file = "{name}", units = "mm"',
    ),
    ((".ply", ".pcd", ".xyz", ".npz", ".npy", ".ptx"), "a cloud, no scene; did you mean weldsim plan {path}?"),
    ((".json", ".csv", ".script", ".urscript"), "a path or program, no scene; did you mean weldsim dry-run {path}?"),
)
"""What is given for a scene, and what to do with it."""


def scene_path(name: str | Path) -> Path:
    """The TOML file of a known scene, or of a path to the user's own.

    Raises:
        SceneError: neither a known name nor a file.
    """
    if not isinstance(name, str | Path):
        raise SceneError(f"scene: {name!r} is none; the name of one or a TOML file is wanted", allowed=scene_names())
    path = Path(name)
    if path.suffix == ".toml":
        if path.is_file():
            return path
        meant = f"; did you mean {path.stem}, which comes with weldsim?" if path.stem in scene_names() else ""
        raise SceneError(f"scene {str(name)!r}: no such file{meant}", scene=str(name), allowed=scene_names())
    if str(name) in scene_names():
        return scenes_folder() / f"{name}.toml"
    if said := next((said for suffixes, said in OTHERS if path.suffix.lower() in suffixes), ""):
        raise SceneError(f"{name} is {said.format(name=path.name, path=name)}", scene=str(name), allowed=scene_names())
    if path.is_dir():
        inside = path / "path.json"
        kind = f"a run directory, no scene; did you mean weldsim dry-run {inside}?" if inside.is_file() else "a folder, no scene"
        raise SceneError(f"{name} is {kind}", scene=str(name), allowed=scene_names())
    beside = path.with_name(f"{path.name}.toml")
    meant = str(beside) if beside.is_file() else nearest(str(name), scene_names())
    raise SceneError(
        f"scene {str(name)!r} is unknown{f'; did you mean {meant}?' if meant else ''}; known are {', '.join(scene_names())},"
        " or give a path ending in .toml",
        scene=str(name),
        allowed=scene_names(),
    )


def anchored(tables: Mapping[str, Any], folder: Path) -> dict[str, Any]:
    """The tables of a scene file with the names of other files in them made to start at `folder`, where the scene's file is."""
    tables = dict(tables)
    if isinstance(mesh := tables.get("mesh"), dict):
        named = {key: str(folder / value) for key, value in mesh.items() if key in ("file", "seam") and isinstance(value, str)}
        tables["mesh"] = {**mesh, **named}
    return tables


def asset_path(*parts: str) -> Path:
    """A file of the assets folder, say asset_path("ur5", "ur5.xml").

    Raises:
        SceneError: it is not there (a broken installation).
    """
    path = _data_folder("assets").joinpath(*parts)
    if not path.exists():
        raise SceneError(
            f"asset {'/'.join(parts)}: not found in {_data_folder('assets')}; reinstall weldsim", asset="/".join(parts)
        )
    return path
