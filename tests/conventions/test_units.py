"""SI inside; units are written where people read and write."""

import json
from math import pi

import numpy as np
import pytest

from weldsim import errors, units
from weldsim.config import load_config, to_json
from weldsim.errors import ConfigError, RecordError
from weldsim.records import PointCloud
from weldsim.scene.config import SceneConfig
from weldsim.schema import structure


@pytest.mark.parametrize(
    ("text", "dimension", "si"),
    [
        ("12 mm", "m", 0.012),
        ("45 deg", "rad", pi / 4),
        ("6 mm/s", "m/s", 0.006),
        ("200 ms", "s", 0.2),
        ("3 deg/mm", "rad/m", 3 * pi / 180 * 1000),
        ("180 deg/s", "rad/s", pi),
    ],
)
def test_a_unit_is_written_at_the_text_edge(text, dimension, si):
    assert units.parse(text, dimension) == pytest.approx(si, rel=1e-12)


@pytest.mark.parametrize("dimension", ["m", "rad", "s", "m/s", "rad/m", "rad/s"])
def test_a_bare_number_is_si(dimension):
    assert units.parse(0.25, dimension) == 0.25
    assert units.parse("0.25", dimension) == 0.25


def test_scene_files_say_their_units_and_memory_is_si():
    scene = structure({"plate": {"length": "240 mm"}, "pose": {"yaw": "90 deg"}}, SceneConfig, where="scene")
    assert scene.plate.length == pytest.approx(0.24)
    assert scene.pose.yaw == pytest.approx(pi / 2)


def test_an_unknown_key_is_an_error_that_names_the_allowed_ones():
    with pytest.raises(ConfigError, match=r"lenght.*length"):
        structure({"plate": {"lenght": "240 mm"}}, SceneConfig, where="scene")


def test_resolved_config_is_the_same_text_for_the_same_settings():
    assert json.dumps(to_json(load_config())) == json.dumps(to_json(load_config(overrides=[])))
    assert json.dumps(to_json(load_config(overrides=["seam.method=thesis"]))) != json.dumps(to_json(load_config()))


def test_coordinates_that_span_over_5_m_look_like_millimetres():
    corners = np.array([[0.0, 0.0, 0.0], [1.0, 1.0, 0.0]])
    assert len(PointCloud(points=corners * 4.9)) == 2
    with pytest.raises(RecordError, match="millimetres"):
        PointCloud(points=corners * 5.1)


def test_arrays_of_a_record_are_float64_and_cannot_be_written():
    points = np.zeros((3, 3), np.float32)
    cloud = PointCloud(points=points.astype(float))
    assert cloud.points.dtype == np.float64
    with pytest.raises(ValueError, match="read-only"):
        cloud.points[0, 0] = 1.0


def test_exit_codes_are_1_for_a_failed_job_and_2_for_bad_input():
    failed_jobs = {errors.NoSeamError, errors.PathError, errors.MotionError, errors.UnreachableError, errors.ExecutionError}
    kinds = {kind for kind in vars(errors).values() if isinstance(kind, type) and issubclass(kind, errors.WeldsimError)}
    assert failed_jobs <= kinds
    for kind in kinds:
        assert kind("why").exit_code == (1 if kind in failed_jobs else 2)


def test_an_error_is_one_line():
    assert str(errors.InputError("what,\n  where")) == "what, where"
