"""What a depth sensor is: a view in, a `Capture` out.

The pipeline hands `Capture.frame` to perception and keeps `Capture.truth` for the report. A real camera and a replay
have no truth; the twin has, and nothing after the sensor but the report may read it.
"""

from abc import ABC, abstractmethod
from dataclasses import dataclass
from enum import IntEnum

import numpy as np
from jaxtyping import Bool, Float32, UInt8
from numpy import ndarray

from weldsim.errors import RecordError
from weldsim.frames import Transform, read_only
from weldsim.records import CameraIntrinsics, DepthFrame, PointCloud


class Label(IntEnum):
    """What a pixel shows. NONE is a miss."""

    NONE = 0
    TABLE = 1
    PART = 2
    GROOVE = 3
    CLAMP = 4
    ROBOT = 5
    ROOM = 6


class Finish(IntEnum):
    """What a surface looks like to a camera. The names in lower case are those of a scene's `material.finish`."""

    MATTE = 0
    MILL_SCALE = 1
    GROUND = 2
    BLACK = 3


@dataclass(frozen=True, eq=False, kw_only=True)
class View:
    """One exposure asked of a sensor.

    Attributes:
        X_BC: where the camera stands (its optical frame in the robot base).
        exposure: counts exposures from the same place; noise that changes from frame to frame follows it.
        t: time of exposure [s].
    """

    X_BC: Transform
    exposure: int = 0
    t: float = 0.0

    def __post_init__(self) -> None:
        if self.X_BC.names != "BC" or self.X_BC.batch:
            raise RecordError(f"View.X_BC: is X_{self.X_BC.names} with batch {self.X_BC.batch}, expected one X_BC", field="X_BC")


@dataclass(frozen=True, eq=False, kw_only=True)
class Truth:
    """What was really in view, known to the twin alone.

    Attributes:
        depth: exact z-depth at each pixel's centre [m], NaN where nothing is.
        labels: a `Label` a pixel.
        finishes: a `Finish` a pixel, or None where every surface is matte.
    """

    depth: Float32[ndarray, "h w"]
    labels: UInt8[ndarray, "h w"]
    finishes: UInt8[ndarray, "h w"] | None = None

    def __post_init__(self) -> None:
        for name in ("labels", "finishes"):
            image = getattr(self, name)
            if image is None:
                continue
            if image.shape != self.depth.shape:
                raise RecordError(f"Truth.{name}: shape {image.shape}, expected {self.depth.shape}", field=name)
            object.__setattr__(self, name, read_only(np.asarray(image, np.uint8)))
        object.__setattr__(self, "depth", read_only(np.asarray(self.depth, np.float32)))


@dataclass(frozen=True, eq=False, kw_only=True)
class Capture:
    """One exposure: what the sensor delivers, and in the twin what was really there (None elsewhere)."""

    frame: DepthFrame
    truth: Truth | None = None


def true_region(captures: tuple[Capture, ...], kept: PointCloud) -> Bool[ndarray, "n"] | None:
    """For each point kept, whether its pixel shows a groove; None where points do not know their pixels (a voxel grid)."""
    masks = []
    for capture in captures:
        if capture.truth is None:
            return None
        masks.append(capture.truth.labels.reshape(-1) == Label.GROOVE)
    if kept.pixel is None:
        return None
    if kept.view is None:
        return masks[0][kept.pixel] if len(masks) == 1 else None
    return np.stack(masks)[kept.view, kept.pixel]


class DepthSensor(ABC):
    """A depth camera, real, simulated or recorded."""

    @property
    @abstractmethod
    def intrinsics(self) -> CameraIntrinsics:
        """Of the depth image it delivers."""

    @abstractmethod
    def capture(self, view: View) -> Capture:
        """One exposure from `view`.

        The frame's depth is float32 [m], positive, NaN for no return; its colour is registered to depth. The same sensor,
        seed and view give the same bytes.

        Raises:
            SensorError: the sensor cannot deliver.
        """

    def close(self) -> None:  # noqa: B027 - most sensors hold nothing
        """Frees what the sensor holds outside Python; closing twice is allowed."""
