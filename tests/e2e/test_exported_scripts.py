"""An exported program, sent to the virtual controller as any client would, welds the path that was checked."""

from pathlib import Path
from types import ModuleType

import numpy as np
import pytest

from tests.controllers import free_address
from tests.e2e.test_experiments import script
from tests.torch_paths import flat_curve, torch_path
from weldsim.cli import main
from weldsim.dryrun.read import read_program
from weldsim.kinematics import torch_pose
from weldsim.records import TorchPath
from weldsim.scene.world import HOME


@pytest.fixture(scope="module")
def module() -> ModuleType:
    return script("22_exported_scripts")


@pytest.fixture(scope="module")
def exported(tmp_path_factory: pytest.TempPathFactory) -> tuple[Path, TorchPath]:
    """The program of a short arc, and its path."""
    folder = tmp_path_factory.mktemp("export")
    X_BT = torch_path(flat_curve("arc", 0.06) + np.array([0.0, -0.45, 0.08]), np.array([0.0, 0.1, -1.0])).X_BT
    rows = np.concatenate([X_BT.p, X_BT.rotation_vector], axis=1)
    np.savetxt(folder / "arc.csv", rows, delimiter=",", header="torch", fmt="%.9f")
    file = folder / "arc.script"
    assert main(["dry-run", str(folder / "arc.csv"), "--roll", "--export", str(file), "--json"]) == 0
    return file, read_program(folder / "arc.csv").paths[0]


@pytest.mark.parametrize("profile", ["cb3", "e"])
def test_an_exported_program_follows_its_path(module: ModuleType, exported: tuple[Path, TorchPath], profile: str) -> None:
    file, path = exported
    host = free_address()
    with module.controller(profile, None, 3.0, host):
        rode = module.ride(host, file.read_text())
    assert rode.ended
    burning = [motion for motion in read_program(file, q_start=HOME).motions if motion.arc]
    figures = module.judged(rode, path, torch_pose(np.array([motion.q for motion in burning])).p, burning[0].t)
    for name, limit in module.LIMITS.items():
        assert figures[name] <= limit, name
    # The arc burns once, over the weld and no longer.
    assert figures["arcs"] == 1
    assert figures["time"] == pytest.approx(path.s[-1] / 0.008, abs=0.15)
    assert figures["steady"] > 0.8


def test_a_program_that_does_not_weld_is_seen(module: ModuleType, exported: tuple[Path, TorchPath]) -> None:
    _, path = exported
    host = free_address()
    with module.controller("cb3", None, 3.0, host):
        rode = module.ride(host, "def idle():\n  sleep(0.5)\nend\n")
    assert rode.ended
    assert module.judged(rode, path, path.X_BT.p, 0.008)["off"] == np.inf
