"""weldsim: a simulation-first digital twin of a vision-guided robotic arc-welding cell.

Public names load when first used, so that `import weldsim` stays cheap.
"""

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
    "TorchPath": "weldsim.records",
    "WeldReport": "weldsim.records",
    "CellConfig": "weldsim.config",
    "load_config": "weldsim.config",
    "load_scene": "weldsim.config",
    "read_cloud": "weldsim.cloud.files",
    "plan": "weldsim.pipeline",
    "run": "weldsim.pipeline",
}
__all__ = [
    "CameraIntrinsics",
    "CellConfig",
    "DepthFrame",
    "PointCloud",
    "Seam",
    "TorchPath",
    "Transform",
    "WeldReport",
    "WeldsimError",
    "__version__",
    "load_config",
    "load_scene",
    "plan",
    "read_cloud",
    "run",
]

if TYPE_CHECKING:
    from weldsim.cloud.files import read_cloud
    from weldsim.config import CellConfig, load_config, load_scene
    from weldsim.errors import WeldsimError
    from weldsim.frames import Transform
    from weldsim.pipeline import plan, run
    from weldsim.records import CameraIntrinsics, DepthFrame, PointCloud, Seam, TorchPath, WeldReport


def __getattr__(name: str) -> object:
    if name not in _PUBLIC:
        raise AttributeError(f"module 'weldsim' has no attribute {name!r}")
    return getattr(import_module(_PUBLIC[name]), name)


def __dir__() -> list[str]:
    return __all__
