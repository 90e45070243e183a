"""Scenes like a given one, drawn at random: for tests and acceptance runs over many seeds."""

from dataclasses import dataclass, replace

import numpy as np

from weldsim.quantity import Metre, Radian
from weldsim.scene.config import SceneConfig


@dataclass(frozen=True)
class VariationConfig:
    """How far a drawn scene may be from its model; every quantity is uniform within its bounds.

    Attributes:
        yaw: of the part, to either side [rad].
        tilt: of the part, in any direction [rad].
        shift: of the part in x and in y, to either side [m].
        width_low: narrowest groove [m].
        width_high: widest groove [m].
        depth_low: least depth over width.
        depth_high: greatest depth over width.
    """

    yaw: Radian = np.pi / 6
    tilt: Radian = np.pi / 12
    shift: Metre = 0.020
    width_low: Metre = 0.008
    width_high: Metre = 0.025
    depth_low: float = 0.45
    depth_high: float = 0.70


def vary_pose(config: SceneConfig, seed: int, limits: VariationConfig | None = None) -> SceneConfig:
    """The same part lying elsewhere; its groove is left as it is."""
    limits = VariationConfig() if limits is None else limits
    rng = np.random.default_rng([seed, 1])
    pose = replace(
        config.pose,
        x=config.pose.x + float(rng.uniform(-limits.shift, limits.shift)),
        y=config.pose.y + float(rng.uniform(-limits.shift, limits.shift)),
        yaw=config.pose.yaw + float(rng.uniform(-limits.yaw, limits.yaw)),
        # The square root makes the normals spread evenly over the cap of directions.
        tilt=limits.tilt * float(np.sqrt(rng.uniform())),
        tilt_heading=float(rng.uniform(-np.pi, np.pi)),
    )
    return replace(config, name=f"{config.name}-{seed}", pose=pose)


def vary(config: SceneConfig, seed: int, limits: VariationConfig | None = None) -> SceneConfig:
    """The same kind of part lying elsewhere, with a groove of another width and depth (a V; never through the plate)."""
    limits = VariationConfig() if limits is None else limits
    rng = np.random.default_rng([seed, 2])
    width = float(rng.uniform(limits.width_low, limits.width_high))
    depth = min(width * float(rng.uniform(limits.depth_low, limits.depth_high)), 0.8 * config.plate.thickness)
    return vary_pose(replace(config, groove=replace(config.groove, width=width, depth=depth, angle=None)), seed, limits)
