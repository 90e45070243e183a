"""Workpiece meshes kept on disk under the hash of what they were made from, so that a scene is meshed once."""

import hashlib
import os
import tempfile
import zipfile
from pathlib import Path

import numpy as np

from weldsim.scene.workpieces.base import LabelledMesh, Workpiece

FORMAT = "mesh/1"  # change it when a workpiece's meshing changes, and old files are left alone


def cache_folder() -> Path:
    """A folder that can be written: the user's cache, else the system's temporary one."""
    home = os.environ.get("XDG_CACHE_HOME")
    for folder in (Path(home) if home else Path.home() / ".cache", Path(tempfile.gettempdir())):
        try:
            (folder / "weldsim").mkdir(parents=True, exist_ok=True)
        except OSError:
            continue
        if os.access(folder / "weldsim", os.W_OK):
            return folder / "weldsim"
    return Path(tempfile.mkdtemp(prefix="weldsim-"))


def cached_mesh(workpiece: Workpiece, folder: Path | None = None) -> LabelledMesh:
    """The workpiece's mesh, from `folder` if it was made before, else made and kept there."""
    folder = cache_folder() if folder is None else folder
    digest = hashlib.sha256(f"{FORMAT}\n{type(workpiece).__name__}\n{workpiece.content}".encode()).hexdigest()[:24]
    path = folder / f"{digest}.npz"
    try:
        with np.load(path) as data:
            return LabelledMesh(vertices=data["vertices"], faces=data["faces"], groove=data["groove"])
    except (OSError, ValueError, KeyError, EOFError, zipfile.BadZipFile):
        pass  # absent or damaged: either way it is made again
    mesh = workpiece.build_mesh()
    handle, temporary = tempfile.mkstemp(dir=folder, suffix=".npz")
    with os.fdopen(handle, "wb") as file:
        np.savez(file, vertices=mesh.vertices, faces=mesh.faces, groove=mesh.groove)
    os.replace(temporary, path)
    return mesh
