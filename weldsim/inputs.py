"""What a caller of the pipeline may hand in, in place of the records themselves: arrays, files, names; or a line that says what
is wanted."""

from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.cloud.deproject import deproject
from weldsim.cloud.extent import check_extent_of_array
from weldsim.cloud.files import read_cloud
from weldsim.config import CellConfig, load_config, load_scene
from weldsim.counted import counted
from weldsim.errors import CloudError, InputError, OutputError, WeldsimError
from weldsim.output import place_of
from weldsim.records import DepthFrame, PointCloud, Seam, SeamFindings
from weldsim.schema import structure
from weldsim.settings import nested

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

if TYPE_CHECKING:
    CloudLike = PointCloud | DepthFrame | Float[ndarray, "n 3"] | Sequence[Sequence[float]] | str | Path
    ConfigLike = CellConfig | Mapping[str, Any] | str | Path
    SceneLike = SceneConfig | Mapping[str, Any] | str | Path
else:  # anything may come: what is wanted is said here, and not by a checker of types
    CloudLike = ConfigLike = SceneLike = Any
"""A cloud in the robot base: the record, an array of points [m], a depth frame, or a file. Settings: the record, nested tables as a
TOML file has them, or such a file. A scene: the record, nested tables, the name of one that comes with weldsim, or a TOML file."""


def cloud_from(given: Any) -> PointCloud:
    """The cloud that is meant, in B [m]; points of an array that are not finite are dropped, as those of a file are.

    Raises:
        InputError: something that is no cloud.  CloudFileError, CloudError, RecordError: a file or an array without use.
    """
    if isinstance(given, PointCloud):
        return given
    if isinstance(given, DepthFrame):
        return deproject(given)
    if isinstance(given, str | Path):
        _refuse_scene(given)
        return read_cloud(given)
    if isinstance(given, Sequence) or hasattr(given, "__array__"):
        return PointCloud(points=_points(given))
    if hasattr(given, "points"):  # of another library, open3d's say
        return PointCloud(points=_points(given.points))
    raise InputError(f"plan: {_kind(given)} is no cloud; a PointCloud, an (n, 3) array in metres, a DepthFrame or a file is wanted")


def _refuse_scene(given: str | Path) -> None:
    """Raises InputError for the name of a scene."""
    from weldsim.scene.files import scene_names

    if str(given) in scene_names() and not Path(given).exists():
        raise InputError(f'plan: {str(given)!r} is a scene, no cloud: weldsim.run("{given}"), or weldsim.look("{given}").cloud')


def _points(given: Any) -> Float[ndarray, "n 3"]:
    """Points (n, 3) from an array (n, 3), or (h, w, 3) of an organised cloud, or one with fields x, y, z."""
    try:
        given = np.asarray(given)
        if given.dtype.names is not None and set("xyz") <= set(given.dtype.names):
            given = np.stack([given[axis] for axis in "xyz"], axis=-1)
        if given.dtype.kind in "bc":  # truth values and complex numbers would be taken for numbers
            raise TypeError
        points = given.astype(float)
    except (TypeError, ValueError):
        raise InputError("plan: what is given is no array of numbers; an (n, 3) array of points in metres is wanted") from None
    if points.ndim == 3 and points.shape[2] == 3:
        points = points.reshape(-1, 3)
    if points.ndim != 2 or points.shape[1] != 3:
        turned = points.ndim == 2 and points.shape[0] == 3
        wanted = "give its transpose" if turned else "(n, 3) in metres is wanted"
        depth = "; a depth image needs its camera: DepthFrame" if points.ndim == 2 and min(points.shape) > 16 else ""
        raise InputError(f"plan: an array of shape {points.shape} is no cloud: {wanted}{depth}", shape=points.shape)
    finite = np.isfinite(points).all(axis=1)
    if not finite.any():
        raise CloudError(f"none of the {counted(len(points), 'point')} is finite", total=len(points))
    points = points if finite.all() else points[finite]
    check_extent_of_array("plan", points)
    return points


def config_from(given: Any) -> CellConfig:
    """The settings that are meant; the defaults for None. Raises InputError, ConfigError."""
    if given is None:
        return CellConfig()
    if isinstance(given, CellConfig):
        return given
    if isinstance(given, Mapping):
        return load_config(given)
    if isinstance(given, str) and "=" in given and not Path(given).exists():
        return load_config(None, [given])
    if isinstance(given, str | Path):
        return load_config(given)
    if isinstance(given, list | tuple) and all(isinstance(one, str) for one in given):
        return load_config(None, given)
    raise InputError(f"config: {_kind(given)} is none; a CellConfig (weldsim.load_config), its tables or a TOML file is wanted")


def scene_from(given: Any) -> "SceneConfig":
    """The scene that is meant. Raises InputError, SceneError, ConfigError."""
    from weldsim.scene.config import SceneConfig

    if isinstance(given, SceneConfig):
        return given
    if isinstance(given, str | Path):
        return load_scene(given)
    if isinstance(given, Mapping):
        return structure(nested(given), SceneConfig, where="scene")
    raise InputError(f"scene: {_kind(given)} is none; the name of one, a TOML file or a SceneConfig (weldsim.load_scene) is wanted")


def sighting_from(given: Any) -> Any:
    """The sighting that is meant. Raises InputError for anything but what `weldsim.look` returns."""
    if not all(hasattr(given, name) for name in ("world", "cloud", "captures")):
        raise InputError(f"finish: {_kind(given)} is no sighting; what weldsim.look returned is wanted")
    return given


def result_from(given: Any) -> Any:
    """The plan that is meant. Raises InputError for anything but what `weldsim.plan` returns."""
    if not all(hasattr(given, name) for name in ("findings", "paths", "cloud")):
        raise InputError(f"finish: {_kind(given)} is no plan; what weldsim.plan returned for the sighting's cloud is wanted")
    return given


def check_film(video: Any) -> None:
    """Nothing, where a film can be written there, or none is asked for. Raises InputError, OutputError."""
    if video is None:
        return
    if not isinstance(video, str | Path):
        raise InputError(f"video: {_kind(video)} is none; the name of a file that ends in .mp4 is wanted")
    if Path(video).suffix.lower() != ".mp4":
        raise OutputError(f"video {video}: a film ends in .mp4", path=str(video))
    if not place_of(video).parent.is_dir():
        raise OutputError(f"video {video}: its folder does not exist", path=str(video))


def run_from(given: Any) -> Any:
    """The run that is meant. Raises InputError for anything but what `weldsim.run` and `weldsim.finish` return."""
    if not all(hasattr(given, name) for name in ("plan", "report", "captures")):
        raise InputError(f"write_run: {_kind(given)} is no run; what weldsim.run or weldsim.finish returned is wanted")
    return given


def findings_from(given: Any, cloud: PointCloud, finder: str) -> SeamFindings:
    """What a caller's own seam finder found, from what it returned: findings, a seam, several, a polyline (n, 3) [m], or None.

    Raises:
        InputError: anything else.
    """
    if isinstance(given, SeamFindings):
        if len(given.region) != len(cloud):
            region, points = counted(len(given.region), "entry"), counted(len(cloud), "point")
            raise InputError(f"finder {finder}: region has {region}, the cloud {points}: one each")
        return given
    if given is None:
        seams: tuple[Seam, ...] = ()
    elif isinstance(given, Seam):
        seams = (given,)
    elif isinstance(given, ndarray):
        seams = (_along(given, finder),) if len(given) else ()
    elif isinstance(given, Sequence) and not isinstance(given, str):
        seams = tuple(one if isinstance(one, Seam) else _along(one, finder) for one in given)
    else:
        raise InputError(f"finder {finder}: returned {_kind(given)}; SeamFindings, a Seam, several, or (n, 3) points are wanted")
    return SeamFindings(seams=seams, region=np.zeros(len(cloud), np.int32), method=finder)


def _along(points: Any, finder: str) -> Seam:
    try:
        return Seam.along(points)
    except (WeldsimError, TypeError, ValueError) as error:
        raise InputError(f"finder {finder}: returned no seam: {error}") from None


def _kind(given: Any) -> str:
    """What it is, for people."""
    if given is None:
        return "None"
    name = type(given).__name__
    return f"{'an' if name[:1] in 'aeiouAEIOU' else 'a'} {name}"
