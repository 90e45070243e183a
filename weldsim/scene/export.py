"""A scene as plain MJCF with its meshes and textures, for MuJoCo's own viewer and any other tool that reads it."""

import os
import shutil
from dataclasses import dataclass
from pathlib import Path

import cv2
import numpy as np
from jaxtyping import Float, Int, UInt8
from numpy import ndarray

from weldsim.errors import OutputError
from weldsim.mounts import D415_640X480
from weldsim.output import write_whole
from weldsim.records import CameraIntrinsics
from weldsim.scene.config import SceneConfig, make_workpiece, part_pose
from weldsim.scene.files import asset_path
from weldsim.scene.quiet import keep_quiet
from weldsim.scene.standing import Standing
from weldsim.scene.world import HOME, check_standing, compose

MARK = "ABOUT.txt"  # a folder with it is an earlier export


@dataclass(frozen=True, eq=False, kw_only=True)
class PlainScene:
    """A scene's MJCF. Attributes: xml; files, {name: content} of what it refers to, all in one folder."""

    xml: str
    files: dict[str, bytes]


def plain_scene(config: SceneConfig, folder: str, intrinsics: CameraIntrinsics = D415_640X480) -> PlainScene:
    """The scene as text and files; `folder` is where the text will look for the files.

    Raises:
        SceneError: a scene that contradicts itself, or a part that cannot stand where it is.
    """
    keep_quiet()
    workpiece = make_workpiece(config)
    spec = compose(config, workpiece, part_pose(config.pose, workpiece), intrinsics)
    files: dict[str, bytes] = {}
    for mesh in spec.meshes:
        if mesh.file:
            files[mesh.file] = asset_path("ur5", spec.meshdir, mesh.file).read_bytes()
            continue
        vertices, faces = np.array(mesh.uservert).reshape(-1, 3), np.array(mesh.userface).reshape(-1, 3)
        mesh.file = f"{mesh.name}.obj"
        mesh.uservert, mesh.userface = [], []
        files[mesh.file] = _obj(vertices, faces)
    for texture in spec.textures:
        if texture.data:
            pixels = np.frombuffer(bytes(texture.data), np.uint8).reshape(texture.height, texture.width, texture.nchannel)
            texture.file, texture.data = f"{texture.name}.png", b""
            files[texture.file] = _png(pixels)
    spec.add_key(name="home", qpos=HOME, ctrl=HOME)
    spec.meshdir = spec.texturedir = folder
    spec.modelfiledir = ""
    spec.assets = {f"{folder}/{name}": content for name, content in files.items()}
    check_standing(config, Standing(model=spec.compile()))
    return PlainScene(xml=spec.to_xml(), files=files)


def write_plain_scene(path: Path, config: SceneConfig) -> tuple[Path, Path]:
    """The MJCF file at `path` and the folder beside it with what it refers to, NAME_assets for NAME.xml; both whole or neither.

    Raises:
        SceneError: a scene that contradicts itself.  OutputError: something is in the way or cannot be written.
    """
    folder = path.with_name(f"{path.stem}_assets")
    if os.path.lexists(folder) and not (folder.is_dir() and (folder / MARK).is_file()):
        raise OutputError(f"{folder}: is in the way of the scene's files; move it or export under another name", path=str(folder))
    scene = plain_scene(config, folder.name)
    temporary, old = (path.with_name(f".{folder.name}.{os.getpid()}.{suffix}") for suffix in ("part", "old"))
    try:
        temporary.mkdir()
        (temporary / MARK).write_text(f"Written by `weldsim scenes export` for {path.name}; replaced by the next.\n")
        for name, content in scene.files.items():
            (temporary / name).write_bytes(content)
        if folder.exists():
            os.replace(folder, old)
        os.replace(temporary, folder)
        write_whole(path, scene.xml)
    except OSError as error:
        raise OutputError(f"{path}: cannot be written ({error.strerror or error})", path=str(path)) from error
    finally:
        shutil.rmtree(temporary, ignore_errors=True)
        shutil.rmtree(old, ignore_errors=True)
    return path, folder


def _obj(vertices: Float[ndarray, "n 3"], faces: Int[ndarray, "m 3"]) -> bytes:
    """A Wavefront OBJ; nine digits hold a float32 exactly."""
    lines = [f"v {x:.9g} {y:.9g} {z:.9g}" for x, y, z in vertices] + [f"f {a} {b} {c}" for a, b, c in faces + 1]
    return ("\n".join(lines) + "\n").encode()


def _png(pixels: UInt8[ndarray, "h w 3"]) -> bytes:
    return cv2.imencode(".png", cv2.cvtColor(pixels, cv2.COLOR_RGB2BGR))[1].tobytes()
