"""A depth frame as files: the image, its intrinsics and its pose, as `weldsim.cloud.depth_files` reads them back."""

import io
import json
from dataclasses import asdict
from pathlib import Path

import numpy as np

from weldsim.cloud.depth_files import write_depth_png
from weldsim.errors import OutputError
from weldsim.output import write_whole
from weldsim.records import DepthFrame

SUFFIXES = (".png", ".npy")


def depth_file_names(path: str | Path) -> tuple[Path, Path, Path]:
    """Image, intrinsics and pose: the last two beside the image, named after it.

    Raises:
        OutputError: an image that ends neither in .png nor in .npy.
    """
    image = Path(path)
    if image.suffix.lower() not in SUFFIXES:
        raise OutputError(f"{image}: depth images are written as {', '.join(SUFFIXES)}", path=str(image), allowed=list(SUFFIXES))
    return image, image.with_suffix(".intrinsics.json"), image.with_suffix(".pose.json")


def write_depth_frame(path: str | Path, frame: DepthFrame, *, depth_unit: float = 1e-3) -> tuple[Path, Path, Path]:
    """The files written: image (16-bit PNG in steps of `depth_unit` [m], or NPY in metres), intrinsics and pose.

    The principal point is written as drivers print it, for pixel centres at whole numbers; the pose is X_BC.

    Raises:
        OutputError: a place that cannot be written.  RecordError: depth that does not fit 16 bits.
    """
    image, intrinsics, pose = depth_file_names(path)
    table = {key: value for key, value in asdict(frame.intrinsics).items() if value != ()}
    table |= {"cx": frame.intrinsics.cx - 0.5, "cy": frame.intrinsics.cy - 0.5}
    if image.suffix.lower() == ".png":
        write_depth_png(image, frame.depth, depth_unit=depth_unit)
        table["depth_scale"] = depth_unit
    else:
        buffer = io.BytesIO()
        np.save(buffer, frame.depth)
        write_whole(image, buffer.getvalue())
    write_whole(intrinsics, json.dumps(table, indent=2) + "\n")
    placed = {"position": frame.X_BC.p.tolist(), "quaternion_wxyz": frame.X_BC.quaternion.tolist()}
    write_whole(pose, json.dumps(placed, indent=2) + "\n")
    return image, intrinsics, pose
