"""Arms that are off by as much as a test wants, with figures as strange as those of real ones."""

from functools import cache
from pathlib import Path

import numpy as np

from weldsim.arm import Arm
from weldsim.controller.calibration import Calibration

CONF = "calibration.conf"
APART = 40.0  # [m] that the d of the three parallel joints trade off, as on real arms


# ROS driver issue 457: as a UR5 sent them. ros-industrial/universal_robot issue 357: corrections from a UR5's calibration.conf.
PUBLISHED = np.array(
    [
        [-9.62699668632896e-06, -1.43707039992005, 2.02543119975016, -0.588254688694989, 4.13647390228702e-05, 8.1737464953645e-06],
        [0.000279332356195598, -0.0566854832098269, -0.32646702272051, 1.49388687216263e-05, 2.23692592990586e-07, 0.0],
        [0.0888794492754001, 574.241384579456, -507.363402098168, -66.7676839353205, 0.0949734691141216, 0.0825625014554953],
        [1.57033858830411, -0.000733893428160216, 0.00325607356326439, 1.57040005185553, -1.57101000328584, 0.0],
    ]
).T
ADDED = Calibration(
    (
        2.07750978653505926e-05,
        0.96821571555565844,
        -1.85685385014877657,
        0.888647901450376643,
        5.66106814887767e-05,
        -7.4631076409646e-05,
    ),
    (0.000393621049984383038, 0.184093300397451837, 0.14493953300732923, -6.433e-05, 7.76709040084077299e-06, 0.0),
    (
        4.00263097760228e-05,
        278.244144925623573,
        -183.695513914913732,
        -94.5471513669751289,
        0.000304782681775556,
        0.000123737941387467,
    ),
    (-0.000271624944216508624, 0.00125856505456124258, -0.00322052070697146503, 0.000651530165303837, -0.000587004657211176, 0.0),
    2,
).dh


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
        low, high = (middle, high) if Arm(dh=_made(middle, seed).dh).deviation() < size else (low, middle)
    return _made(low, seed)


def written(folder: Path, calibration: Calibration) -> Path:
    """The file that a controller would have of it."""
    path = folder / CONF
    names = ("delta_theta", "delta_a", "delta_d", "delta_alpha")
    rows = [f"{name} = [{', '.join(map(repr, getattr(calibration, name)))}]" for name in names]
    status = "calibration_status = 2 # 0 == notInitialized / 1 == notLinearised / 2 == Linearised"
    path.write_text("\n".join(["[mounting]", *rows, "joint_checksum = [ 0x6e0f7bf, 0x1, 0x2, 0x3, 0x4, 0x5]", status, ""]))
    return path
