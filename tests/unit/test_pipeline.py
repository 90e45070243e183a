"""The middle of the pipeline on clouds with a known seam, and which seam is meant."""

import numpy as np
import pytest

from tests.clouds import groove_cloud, two_grooves
from weldsim.config import load_config
from weldsim.curves import project
from weldsim.errors import CloudError, InputError, PathError
from weldsim.pipeline import Clock, pick, plan, unplanned
from weldsim.records import PointCloud, Seam, SeamFindings


def line(y: float) -> Seam:
    """A seam along x at height 0 [m]."""
    points = np.array([[x, y, 0.0] for x in np.linspace(0, 0.1, 11)])
    return Seam(
        points_B=points,
        s=np.linspace(0, 0.1, 11),
        tangents_B=np.tile([1.0, 0, 0], (11, 1)),
        normals_B=np.tile([0, 0, 1.0], (11, 1)),
    )


FOUND = SeamFindings(seams=(line(0.0), line(0.1), line(0.2)), region=np.zeros(5, np.int32))


def test_a_path_runs_along_every_seam_and_stages_are_timed():
    made = groove_cloud(np.random.default_rng(1), noise="iid", sigma=0.0002)
    told = []
    clock = Clock(lambda stage, done: told.append(stage))
    result = plan(made.cloud, load_config(overrides=["path.speed=6 mm/s"]), clock=clock)
    assert len(result.paths) == len(result.findings.seams) == 1
    assert list(result.timing) == told == ["cloud", "seam", "path"]
    assert all(seconds >= 0 for seconds in result.timing.values())
    assert (result.paths[0].speed == 0.006).all()
    distance, _, _ = project(result.paths[0].X_BT.p, made.seam.opening_B)
    assert np.mean(distance) < 0.4e-3
    assert len(result.findings.region) == len(result.cloud)


def test_a_cloud_without_a_seam_gives_none():
    made = groove_cloud(np.random.default_rng(1), width=0.0, noise="iid", sigma=0.0002)
    result = plan(made.cloud)
    assert result.findings.seams == result.paths == ()


def test_what_cannot_be_planned_is_refused():
    with pytest.raises(CloudError, match="3 points"):
        plan(PointCloud(points=np.eye(3)))
    made = groove_cloud(np.random.default_rng(1), noise="iid", sigma=0.0002)
    with pytest.raises(PathError, match="trims"):
        plan(made.cloud, load_config(overrides=["path.start_trim=300 mm"]))


def test_one_seam_that_cannot_be_planned_does_not_keep_the_others():
    cloud = two_grooves()
    assert [seam.length > 0.2 for seam in plan(cloud).findings.seams] == [True, False]
    trims = ["path.start_trim=60 mm", "path.end_trim=60 mm"]
    result = plan(cloud, load_config(overrides=trims))
    assert len(result.findings.seams) == len(result.paths) == 2
    assert result.paths[0] is not None
    assert result.paths[1] is None
    assert list(result.refused) == [1]
    assert "seam 2 has no path: trims of 60 and 60 mm leave" in unplanned(result)[0]
    with pytest.raises(PathError, match=r"no path along any of 2 seams: seam 1: trims .*; seam 2: trims"):
        plan(cloud, load_config(overrides=[*trims[:1], "path.end_trim=250 mm"]))


def test_the_seam_that_is_meant():
    assert pick(FOUND) == 0
    assert [pick(FOUND, number) for number in (1, 2, 3)] == [0, 1, 2]
    assert [pick(FOUND, near=(0.05, y, 0.2)) for y in (-1.0, 0.06, 0.16)] == [0, 1, 2]
    for number in (0, 4, -1):
        with pytest.raises(InputError, match="3 found"):
            pick(FOUND, number)
    with pytest.raises(InputError, match="finite"):
        pick(FOUND, near=(float("nan"), 0.0, 0.0))
