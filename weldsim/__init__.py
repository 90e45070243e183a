"""weldsim: a simulation-first digital twin of a vision-guided robotic arc-welding cell.

Public names load when first used, so that `import weldsim` stays cheap.
"""

from difflib import get_close_matches
from importlib import import_module
from typing import TYPE_CHECKING

__version__ = "0.1.0"

_PUBLIC = {
    "WeldsimError": "weldsim.errors",
    "Transform": "weldsim.frames",
    "CameraIntrinsics": "weldsim.records",
    "DepthFrame": "weldsim.records",
    "PointCloud": "weldsim.records",
    "Seam": "weldsim.records",
    "SeamFindings": "weldsim.records",
    "TorchPath": "weldsim.records",
    "WeldReport": "weldsim.records",
    "CellConfig": "weldsim.config",
    "load_config": "weldsim.config",
    "load_scene": "weldsim.config",
    "read_cloud": "weldsim.cloud.files",
    "write_cloud": "weldsim.cloud.files",
    "look": "weldsim.pipeline",
    "plan": "weldsim.pipeline",
    "finish": "weldsim.pipeline",
    "run": "weldsim.pipeline",
    "write_run": "weldsim.run_folder",
    "regress": "weldsim.regression",
    "write_junit": "weldsim.regression",
}
__all__ = [
    "CameraIntrinsics",
    "CellConfig",
    "DepthFrame",
    "PointCloud",
    "Seam",
    "SeamFindings",
    "TorchPath",
    "Transform",
    "WeldReport",
    "WeldsimError",
    "__version__",
    "finish",
    "load_config",
    "load_scene",
    "look",
    "plan",
    "read_cloud",
    "regress",
    "run",
    "write_cloud",
    "write_junit",
    "write_run",
]

if TYPE_CHECKING:
    from weldsim.cloud.files import read_cloud, write_cloud
    from weldsim.config import CellConfig, load_config, load_scene
    from weldsim.errors import WeldsimError
    from weldsim.frames import Transform
    from weldsim.pipeline import finish, look, plan, run
    from weldsim.records import CameraIntrinsics, DepthFrame, PointCloud, Seam, SeamFindings, TorchPath, WeldReport
    from weldsim.regression import regress, write_junit
    from weldsim.run_folder import write_run


def __getattr__(name: str) -> object:
    if name not in _PUBLIC:
        meant = get_close_matches(name, __all__, n=1)
        raise AttributeError(f"module 'weldsim' has no attribute {name!r}{f'; did you mean {meant[0]!r}?' if meant else ''}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return __all__
