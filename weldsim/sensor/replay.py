"""Recorded depth frames played back through the sensor interface."""

from collections.abc import Sequence
from typing import final

from weldsim.errors import SensorError
from weldsim.records import CameraIntrinsics, DepthFrame
from weldsim.sensor.base import Capture, DepthSensor, View


@final
class ReplaySensor(DepthSensor):
    """Gives recorded frames in their order; `View.exposure` says which, and the pose is the recorded one."""

    def __init__(self, frames: Sequence[DepthFrame]) -> None:
        """Raises SensorError: no frames, or frames of different cameras."""
        if not frames:
            raise SensorError("replay: no frames were given", sensor="replay")
        first = frames[0].intrinsics
        for index, frame in enumerate(frames):
            if _figures(frame.intrinsics) != _figures(first):
                raise SensorError(
                    f"replay: frame {index} was taken with other intrinsics than frame 0", sensor="replay", index=index
                )
        self._frames = tuple(frames)

    def __len__(self) -> int:
        return len(self._frames)

    @property
    def intrinsics(self) -> CameraIntrinsics:
        return self._frames[0].intrinsics

    def capture(self, view: View) -> Capture:
        if not 0 <= view.exposure < len(self._frames):
            raise SensorError(
                f"replay: exposure {view.exposure} was not recorded; there are {len(self._frames)}, from 0",
                sensor="replay",
                limit=len(self._frames),
            )
        return Capture(frame=self._frames[view.exposure])


def _figures(i: CameraIntrinsics) -> tuple[float, ...]:
    return (i.width, i.height, i.fx, i.fy, i.cx, i.cy, *i.distortion)
