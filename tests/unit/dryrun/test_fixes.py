"""Random jobs that cannot be done: the first place that fails and the bodies are named, and every fix named passes when applied."""

from functools import cache
from pathlib import Path

import mujoco
import numpy as np
import pytest

from tests.torch_paths import START, flat_curve, torch_path
from weldsim.cli import main
from weldsim.dryrun.cell import Cell, empty_cell, scene_cell
from weldsim.dryrun.fix import applied
from weldsim.dryrun.program import Program
from weldsim.dryrun.run import dry_run
from weldsim.dryrun.try_path import try_path
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.motion.config import MotionConfig
from weldsim.mounts import X_WB
from weldsim.records import TorchPath
from weldsim.scene.config import SceneConfig

CONFIG = MotionConfig()


@cache
def clamped() -> Cell:
    return scene_cell(SceneConfig())


@cache
def empty() -> Cell:
    return empty_cell(START)


def clamp_noses(cell: Cell) -> np.ndarray:
    """Where the clamps' middles are in B [m]."""
    data = mujoco.MjData(cell.model)
    mujoco.mj_forward(cell.model, data)
    names = [cell.model.geom(i).name for i in range(cell.model.ngeom)]
    mine = [i for i, name in enumerate(names) if name.startswith("clamp") and name.endswith("_collision")]
    return X_WB.inverse().points(data.geom_xpos[mine])


def random_seam(seed: int, middle: np.ndarray, rng: np.random.Generator) -> TorchPath:
    """6 to 16 cm, anyhow turned, the torch leaned by up to some 15 deg."""
    R = matrix_from_rotation_vector(np.array([0.0, 0.0, rng.uniform(-np.pi, np.pi)]))
    points = flat_curve(("line", "arc", "wave")[seed % 3], rng.uniform(0.06, 0.16)) @ R.T + middle
    return torch_path(points, np.array([rng.uniform(-0.2, 0.2), rng.uniform(-0.2, 0.2), -1.0]))


def checked(path: TorchPath, cell: Cell, config: MotionConfig = CONFIG):
    """Trial and fixes of one path; each fix has been applied and passes."""
    result = dry_run(Program(source="test", kind="path", paths=(path,), names=("seam",)), cell, config)
    for fix in result.fixes[0]:
        paths, changed, settings = applied(fix, path, cell, config)
        for k, each in enumerate(paths):
            again = try_path(each, f"piece {k}", changed, settings)
            assert again.passed, (fix.text, again.failure)
    return result.trials[0], result.fixes[0]


@pytest.mark.parametrize("seed", [0, 2, 4, 10, 16, 18])
def test_a_clamp_in_the_torchs_way(seed: int) -> None:
    rng = np.random.default_rng(seed)
    cell = clamped()
    nose = rng.choice(clamp_noses(cell)) + rng.uniform([-0.015, -0.015, -0.01], [0.015, 0.015, 0.012])
    path = random_seam(seed, nose, rng)
    trial, fixes = checked(path, cell)
    assert trial.failure is not None
    assert trial.failure.why == "collision"
    assert any(name.startswith("clamp") for name in (trial.failure.first, trial.failure.second))
    assert "s = " in trial.failure.text
    assert trial.failure.s is not None
    assert fixes


@pytest.mark.parametrize("seed", [3, 7, 11, 15, 19, 23])
def test_a_part_out_of_reach(seed: int) -> None:
    rng = np.random.default_rng(seed)
    heading, distance = rng.uniform(-0.6, 0.6), rng.uniform(1.0, 1.35)
    middle = np.array([distance * np.sin(heading), -distance * np.cos(heading), rng.uniform(0.03, 0.1)])
    trial, fixes = checked(random_seam(seed, middle, rng), empty())
    assert trial.failure is not None
    assert trial.failure.why in ("unreachable", "singular")
    assert any(fix.kind == "move the part" for fix in fixes)


def test_a_lead_in_out_of_reach_is_shortened() -> None:
    """A torch that leans towards the arm: its lead-in goes outwards, and where the weld is just in reach it is not."""
    points = flat_curve("line", 0.08) + np.array([0.0, 0.0, 0.1])
    found = []
    for y in np.arange(-0.55, -1.0, -0.02):
        path = torch_path(points + np.array([0.0, y, 0.0]), np.array([0.0, 0.9, -1.0]))
        trial = try_path(path, "seam", empty(), CONFIG)
        if not trial.passed and trial.lead:
            found = checked(path, empty())[1]
            break
    lead = next(fix for fix in found if fix.kind == "lead-in")
    assert lead.approach < CONFIG.approach
    assert f"{1e3 * lead.approach:.0f} mm" in lead.text


def test_the_command_says_all_of_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    cell = clamped()
    path = torch_path(flat_curve("line", 0.1) + clamp_noses(cell)[0], np.array([0.0, 0.0, -1.0]))
    file = tmp_path / "job.csv"
    X_BT: Transform = path.X_BT
    np.savetxt(file, np.concatenate([X_BT.p, X_BT.rotation_vector], axis=1), delimiter=",", header="torch", fmt="%.9f")
    assert main(["dry-run", str(file), "--roll", "--scene", "straight"]) == 1
    text = " ".join(capsys.readouterr().out.split())
    assert "WOULD FAIL" in text
    assert "clamp_0" in text
    assert "would pass: take clamp_0 out of the torch's way" in text
