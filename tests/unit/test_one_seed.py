"""One seed gives one cloud, whoever asks for it: look, run, the scan command and the regression."""

import numpy as np
import pytest

import weldsim
from weldsim import pipeline
from weldsim.cli import main
from weldsim.cloud.files import read_cloud
from weldsim.config import CellConfig
from weldsim.errors import CloudError
from weldsim.regression import job as regression_job
from weldsim.regression import regress

pytestmark = pytest.mark.render
SCENE, SEED = "straight", 3


class EnoughError(Exception):
    """Nothing behind the scan is wanted."""


@pytest.fixture(scope="module")
def seen() -> np.ndarray:
    """The points of a look, as it is by default."""
    return weldsim.look(SCENE, seed=SEED).cloud.points


def test_a_look_drives_the_arm_unless_told_otherwise(seen):
    put = weldsim.look(SCENE, {"scan": {"move": False}}, seed=SEED)
    driven = weldsim.look(SCENE, {"scan": {"move": False}}, seed=SEED, move=True)
    assert put.tour is None
    assert driven.tour is not None
    assert np.array_equal(driven.cloud.points, seen)
    assert not np.array_equal(put.cloud.points, seen)  # servos come to rest a little off


def test_a_run_sees_what_a_look_sees(seen, monkeypatch):
    clouds = []

    def stop(cloud, *_: object, **__: object) -> None:
        clouds.append(cloud)
        raise EnoughError

    monkeypatch.setattr(pipeline, "plan", stop)
    with pytest.raises(EnoughError):
        pipeline.run(SCENE, CellConfig(), seed=SEED)
    assert np.array_equal(clouds[0].points, seen)


@pytest.mark.parametrize("suffix", [".npz", ".ply"])
def test_the_scan_command_writes_what_a_look_sees(seen, suffix, tmp_path, capsys):
    assert main(["scan", SCENE, "--seed", str(SEED), "--out", str(tmp_path / f"scan{suffix}")]) == 0
    assert np.array_equal(read_cloud(tmp_path / f"scan{suffix}").points, seen)
    capsys.readouterr()


def test_the_regression_judges_what_a_look_sees(seen, monkeypatch):
    clouds = []

    def refuse(cloud, *_: object, **__: object) -> None:
        clouds.append(cloud)
        raise CloudError("enough")

    monkeypatch.setattr(regression_job, "plan", refuse)
    regress(SCENE, methods="profile", seeds=SEED + 1)
    assert len(clouds) == SEED + 1
    assert np.array_equal(clouds[SEED].points, seen)
