"""A simulated D415 or D435: the parametric model wrapped around an exact camera."""

from typing import final

import numpy as np

from weldsim.errors import SensorError
from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics, DepthFrame
from weldsim.sensor.base import Capture, DepthSensor, View
from weldsim.sensor.d415 import D415Config, d415

SAME_POSITION, SAME_ROTATION = 1e-4, 1e-3  # [m], matrix entries: views closer than this share their lasting noise


@final
class D415Fast(DepthSensor):
    """`exact` seen through the parametric D415. Colour and truth pass unchanged."""

    def __init__(self, exact: DepthSensor, config: D415Config | None = None, *, seed: int = 0) -> None:
        """Args: exact: a sensor with truth. seed: of the unit; the same unit at the same pose repeats its lasting noise."""
        self._exact, self._config, self._seed = exact, config or D415Config(), seed

    @property
    def intrinsics(self) -> CameraIntrinsics:
        return self._exact.intrinsics

    @property
    def config(self) -> D415Config:
        return self._config

    def capture(self, view: View) -> Capture:
        inner = self._exact.capture(view)
        if inner.truth is None:
            raise SensorError(
                "the parametric D415 needs exact depth to start from, and the sensor inside gives none", sensor="d415"
            )
        depth = d415(
            np.asarray(inner.truth.depth),
            self.intrinsics,
            self._config,
            seed=[self._seed, *view_key(view.X_BC)],
            exposure=view.exposure,
            finishes=None if inner.truth.finishes is None else np.asarray(inner.truth.finishes),
        )
        frame = DepthFrame(
            depth=depth,
            intrinsics=self.intrinsics,
            X_BC=view.X_BC,
            colour=inner.frame.colour,
            t=view.t,
            source=f"{self._config.model} model on {inner.frame.source}",
        )
        return Capture(frame=frame, truth=inner.truth)

    def close(self) -> None:
        self._exact.close()


def view_key(X_BC: Transform) -> list[int]:
    """Whole numbers that name a camera pose, alike for poses that differ by rounding alone."""
    cells = np.concatenate([X_BC.p / SAME_POSITION, X_BC.R[:, 2] / SAME_ROTATION, X_BC.R[:, 0] / SAME_ROTATION])
    return [int(cell) & 0xFFFFFFFF for cell in np.rint(cells).astype(np.int64)]
