"""Arms that are off by as much as a test wants, with figures as strange as those of real ones."""

from functools import cache
from pathlib import Path

import numpy as np

from weldsim.controller.calibration import Calibration
from weldsim.execution.contract import flange_deviation

CONF = "calibration.conf"
APART = 40.0  # [m] that the d of the three parallel joints trade off, as on real arms


def _made(size: float, seed: int) -> Calibration:
    """Corrections whose lengths are of a size [m], angles of as much over half a metre; shoulder, elbow and wrist 1 as well by
    metres: their axes are parallel, and what one d adds another takes away."""
    theta, a, d, alpha = (size * np.random.default_rng(seed).normal(size=(4, 6)) * np.array([[1.0], [0.5], [0.5], [1.0]])).tolist()
    d[1], d[2], d[3] = d[1] + APART, d[2] - APART / 4, d[3] - APART * 3 / 4
    a[5] = alpha[5] = alpha[1] = alpha[2] = 0.0
    return Calibration(tuple(theta), tuple(a), tuple(d), tuple(alpha), 2)


@cache
def calibrated(size: float, seed: int = 0) -> Calibration:
    """A calibration that puts the flange this far [m] from the nominal arm's at the worst, within 1 %."""
    low, high = 0.0, 4 * size
    for _ in range(40):
        middle = (low + high) / 2
        low, high = (middle, high) if flange_deviation(_made(middle, seed).dh) < size else (low, middle)
    return _made(low, seed)


def written(folder: Path, calibration: Calibration) -> Path:
    """The file that a controller would have of it."""
    path = folder / CONF
    names = ("delta_theta", "delta_a", "delta_d", "delta_alpha")
    rows = [f"{name} = [{', '.join(map(repr, getattr(calibration, name)))}]" for name in names]
    status = "calibration_status = 2 # 0 == notInitialized / 1 == notLinearised / 2 == Linearised"
    path.write_text("\n".join(["[mounting]", *rows, "joint_checksum = [ 0x6e0f7bf, 0x1, 0x2, 0x3, 0x4, 0x5]", status, ""]))
    return path
