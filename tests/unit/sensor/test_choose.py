"""Cameras by name, on a scene of the cell: where they stand, what they see, the steps of their depth."""

from dataclasses import replace
from typing import get_args

import numpy as np
import pytest

from weldsim.config import CellConfig, load_config
from weldsim.mounts import KINECT_V2
from weldsim.pipeline import scan
from weldsim.scene.config import MaterialConfig, SceneConfig
from weldsim.scene.world import World, build_world
from weldsim.sensor.base import Capture, Finish, Label
from weldsim.sensor.choose import EXACT_STEP, SensorName, depth_step, posture, stations
from weldsim.sensor.d415 import D435_848X480

NAMES = get_args(SensorName)


@pytest.fixture(scope="module")
def world() -> World:
    return build_world(SceneConfig())


@pytest.fixture(scope="module")
def captures(world: World) -> dict[str, Capture]:
    return {name: scan(world, CellConfig(), 0, name)[0] for name in NAMES}


@pytest.mark.parametrize("name", NAMES)
def test_every_camera_sees_the_part_and_its_groove(captures: dict[str, Capture], name: str) -> None:
    frame, truth = captures[name].frame, captures[name].truth
    assert truth is not None
    assert (frame.intrinsics is KINECT_V2) == (name == "kinect")
    assert (frame.intrinsics.width == D435_848X480.width) == (name == "d435")
    workpiece = np.isin(truth.labels, (Label.PART, Label.GROOVE))
    assert workpiece.sum() > 3000
    assert np.isfinite(frame.depth[workpiece]).mean() > 0.85  # beside the clamps there are shadows
    assert np.nanmedian(np.abs(frame.depth - truth.depth)[workpiece]) < 1.5e-3  # the Kinect has 1.3 mm of noise
    assert Label.ROBOT not in truth.labels[workpiece]


@pytest.mark.parametrize("name", NAMES)
def test_depth_comes_in_the_steps_that_files_are_written_in(captures: dict[str, Capture], name: SensorName) -> None:
    step = depth_step(name, CellConfig())
    assert step == (EXACT_STEP if name == "exact" else 1e-3)
    if name != "exact":
        depth = captures[name].frame.depth.astype(float)
        depth = depth[np.isfinite(depth)] / step
        assert np.abs(depth - np.rint(depth)).max() < 1e-3
    exact = replace(CellConfig(), sensor=replace(CellConfig().sensor, depth_unit=0.0))
    assert depth_step("d415", exact) == EXACT_STEP


def test_the_arm_holds_the_wrist_camera_and_leaves_the_kinect_alone(world: World) -> None:
    for name in NAMES:
        assert len(stations(world, name)) == (1 if name == "kinect" else len(world.views))
    away = posture(world, "kinect", 0)
    assert abs(away[0] - posture(world, "d415", 0)[0]) > 2.0
    assert world.new_data(away).ncon == 0


def test_the_scene_says_what_the_part_looks_like() -> None:
    """The part alone has the scene's finish; holes follow on it, with the fast camera and the reference."""
    black = build_world(replace(SceneConfig(), material=MaterialConfig(finish="black")))
    capture = scan(black, CellConfig())[0]
    truth = capture.truth
    assert truth is not None
    assert truth.finishes is not None
    workpiece = np.isin(truth.labels, (Label.PART, Label.GROOVE))
    assert (truth.finishes[workpiece] == Finish.BLACK).all()
    assert (truth.finishes[~workpiece] == Finish.MATTE).all()
    assert 0.3 < np.isnan(capture.frame.depth[workpiece]).mean() < 0.75


def test_a_unit_has_its_own_focal_length(world: World) -> None:
    config = replace(CellConfig(), sensor=replace(CellConfig().sensor, focal_scale=1.01))
    frame = scan(world, config)[0].frame
    assert frame.intrinsics.fx == pytest.approx(1.01 * world.intrinsics.fx)


def test_a_d435_follows_its_own_table(world: World, captures: dict[str, Capture]) -> None:
    assert "d435" in captures["d435"].frame.source
    config = load_config(None, ["d435.focal_scale=1.01", "sensor.window=9"])
    assert config.d435.baseline == 0.050
    seen = scan(world, config, 0, "d435")[0].frame
    assert seen.intrinsics.fx == pytest.approx(1.01 * 424.4)
    plain = scan(world, load_config(None, ["sensor.noise_gain=3"]), 0, "d435")[0].frame
    assert np.array_equal(plain.depth, captures["d435"].frame.depth, equal_nan=True)
