"""What was asked of a weld, so that it is judged by that: the wire's tip at its own stick-out, the leaned wire axis."""

from dataclasses import replace

import numpy as np

from weldsim.curves import interpolate, project
from weldsim.frames import Transform, unit
from weldsim.path.config import PathConfig
from weldsim.path.plan import lean
from weldsim.records import KnownSeam, TorchPath


def wire_tip(X_BT: Transform, config: PathConfig) -> Transform:
    """The torch poses moved along the wire to where its tip is at the CTWD of the config: on the seam, if all went well."""
    return Transform("BT", X_BT.R, X_BT.p + (config.ctwd - config.nominal_ctwd) * X_BT.R[..., 2])


def leaned(known: KnownSeam, path: TorchPath, config: PathConfig) -> KnownSeam:
    """The known seam whose `bisectors_B` are the wire axes asked for: leaned by work and travel angle, as `path` travels it."""
    if config.work_angle == 0 and config.travel_angle == 0:
        return known
    X = path.X_BT[path.weld]
    _, _, s = project(X.p, known.opening_B)
    # By the direction all along, not by where it begins and ends: around a ring that is the same place.
    ahead = np.einsum("ij,ij->", X.R[:, :, 0], interpolate(known.s, known.tangents_B, s)) >= 0
    z = known.bisectors_B
    x = known.tangents_B * (1.0 if ahead else -1.0)
    x = unit(x - np.einsum("ij,ij->i", x, z)[:, None] * z)
    upright = np.stack([x, np.cross(z, x), z], axis=-1)
    return replace(known, bisectors_B=(upright @ lean(config.work_angle, config.travel_angle))[:, :, 2])
