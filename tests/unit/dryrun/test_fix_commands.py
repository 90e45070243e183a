"""Fixes are told in options: a dry run of the same file with those options passes."""

import json
import shlex
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.torch_paths import flat_curve, torch_path
from weldsim.cli import main
from weldsim.dryrun.fix import leaned, reposed, turned_about_wire
from weldsim.dryrun.program import Given
from weldsim.errors import SceneError
from weldsim.scene.config import FixtureConfig, SceneConfig
from weldsim.scene.world import build_world

DOWN = np.array([0.0, 0.0, -1.0])


def written(file: Path, points: np.ndarray, wire: np.ndarray = DOWN) -> Path:
    """A CSV of torch poses, their rotation about the wire given."""
    X_BT = torch_path(points, wire).X_BT
    np.savetxt(file, np.concatenate([X_BT.p, X_BT.rotation_vector], axis=1), delimiter=",", header="torch", fmt="%.9f")
    return file


def dry(capsys: pytest.CaptureFixture, *words: str) -> dict:
    main(["dry-run", *words, "--json"])
    return json.loads(capsys.readouterr().out)


@pytest.mark.parametrize(
    ("middle", "options", "kinds"),
    [
        ((0.072, -0.60, 0.03), ("--roll", "--scene", "straight"), {"take away"}),
        ((0.0, -1.25, 0.05), ("--roll",), {"move the part"}),
        ((0.0, -0.45, 0.1), ("--set", "motion.joint_speed_limit=0.011", "--roll"), {"slower"}),
    ],
)
def test_every_fix_passes_with_its_options(middle, options, kinds, tmp_path, capsys) -> None:
    file = written(tmp_path / "job.csv", flat_curve("line", 0.04) + np.array(middle))
    found = dry(capsys, str(file), *options)
    assert not found["passed"]
    fixes = found["trials"][0]["fixes"]
    assert kinds <= {fix["kind"] for fix in fixes}
    for fix in fixes:
        how = shlex.split(fix["how"].partition(";")[0])
        assert dry(capsys, str(file), *options, "--no-fix", *how)["passed"], fix


@pytest.mark.parametrize(("second", "broken"), [((0.0, -1.15, 0.05), False), ((0.0, -0.16, 0.05), True)])
def test_a_fix_of_one_seam_is_tried_on_the_others_of_its_file(second, broken, tmp_path, capsys) -> None:
    """An option changes every seam: where it helps one and harms another, that is told, and it is true."""
    rows = ["# torch", "seam,x,y,z,rx,ry,rz"]
    for name, middle in (("far", (0.0, -1.25, 0.05)), ("near", second)):
        X_BT = torch_path(flat_curve("line", 0.04) + np.array(middle), DOWN).X_BT
        table = np.concatenate([X_BT.p, X_BT.rotation_vector], axis=1)
        rows += [f"{name},{','.join(f'{value:.9f}' for value in row)}" for row in table]
    file = tmp_path / "job.csv"
    file.write_text("\n".join(rows))
    found = dry(capsys, str(file), "--roll")
    fixes = found["trials"][0]["fixes"]
    moves = [fix for fix in fixes if fix["kind"] == "move the part"]
    assert moves
    for fix in moves:
        assert (fix["breaks"] == ["near"]) == broken
        after = dry(capsys, str(file), "--roll", "--no-fix", *shlex.split(fix["how"]))
        assert [trial["passed"] for trial in after["trials"]] == [True, not broken]
    main(["dry-run", str(file), "--roll"])
    said = capsys.readouterr().out
    assert ("far alone would pass: move the part" in said) == broken
    assert ("; near would fail with it" in said) == broken


@pytest.mark.parametrize("turned", [(), ("--turn", "35 deg")])
def test_a_fix_of_a_leaned_torch_takes_the_place_of_that_option(turned, tmp_path, capsys) -> None:
    """The option that is told holds what was given and what is added: it is the whole of the change that was checked."""
    file = written(tmp_path / "job.csv", flat_curve("line", 0.04) + np.array((0.0, -0.45, 0.03)))
    command = (str(file), "--scene", "straight", *turned)
    (fix,) = dry(capsys, *command, "--lean", "50 deg, 40 deg")["trials"][0]["fixes"]
    option, value = shlex.split(fix["how"])
    work, travel = (float(part.removesuffix(" deg")) for part in value.split(", "))
    assert option == "--lean"
    assert (work, travel) == pytest.approx((50 + np.rad2deg(fix["lean"][0]), 40 + np.rad2deg(fix["lean"][1])))
    assert dry(capsys, *command, "--no-fix", option, value)["passed"]


def test_poses_turned_and_leaned_further_are_those_of_the_sums() -> None:
    rng = np.random.default_rng(4)
    read = torch_path(flat_curve("line", 0.04), DOWN).X_BT
    for turn, more, work, travel, w, t in rng.uniform(-0.6, 0.6, (20, 6)):
        before = leaned(turned_about_wire(read, turn), work, travel)
        after = leaned(turned_about_wire(read, turn + more), work + w, travel + t)
        found = reposed(before, Given(turn=turn, lean=(work, travel)), more, (w, t))
        np.testing.assert_allclose(found.R, after.R, atol=1e-12)


def test_a_script_turned_or_moved_is_judged_there(tmp_path, capsys) -> None:
    file = tmp_path / "far.script"
    file.write_text("movej(p[0, -0.5, 0.1, 0, 3.1416, 0])\nmovel(p[0.05, -0.5, 0.1, 0, 3.1416, 0], v=0.02)\n")
    assert dry(capsys, str(file))["passed"]
    assert dry(capsys, str(file), "--move", "20 mm, -10 mm", "--turn", "-10 deg")["passed"]
    assert not dry(capsys, str(file), "--move", "0 mm, -600 mm")["passed"]
    assert main(["dry-run", str(file), "--lean", "5 deg, 0"]) == 2
    assert main(["dry-run", str(file), "--move", "5 mm"]) == 2


def test_a_program_is_turned_past_its_first_failure(tmp_path, capsys) -> None:
    """Turns at which some posture is clear but the one the arm comes to is not are no reason to give up."""
    file = tmp_path / "job.script"
    file.write_text("movej(p[0, -0.5, 0.1, 3.1416, 0, 0])\nmovel(p[0.05, -0.5, 0.1, 3.1416, 0, 0], v=0.02)\n")
    found = dry(capsys, str(file))
    assert not found["passed"]
    turns = [fix for fix in found["trials"][0]["fixes"] if fix["kind"] == "turn about the wire"]
    assert turns
    assert dry(capsys, str(file), *shlex.split(turns[0]["how"]))["passed"]
    further = dry(capsys, str(file), "--turn", "2 deg")["trials"][0]["fixes"][0]["how"]  # told is the whole turn, not what is added
    assert shlex.split(further)[0] == "--turn"
    assert float(shlex.split(further)[1].removesuffix(" deg")) % 5 == pytest.approx(2.0)
    assert dry(capsys, str(file), *shlex.split(further))["passed"]


def test_clamps_and_bolts_are_left_out_by_name() -> None:
    def names(**fixture: object) -> set[str]:
        model = build_world(SceneConfig(fixture=FixtureConfig(**fixture))).model  # type: ignore[arg-type]
        return {model.geom(i).name for i in range(model.ngeom)}

    whole, less = names(clamps=4, bolts=2), names(clamps=4, bolts=2, without=("clamp_2", "clamp_bolt_0"))
    gone = whole - less
    assert gone
    assert all(name.startswith(("clamp_2_", "clamp_bolt_0_")) for name in gone)
    assert not any(name.startswith(("clamp_2_", "clamp_bolt_0_")) for name in less)
    with pytest.raises(SceneError, match="without 'clamp_7': this scene has clamp_0, clamp_1"):
        names(without=("clamp_7",))


def test_six_clamps_are_one_line() -> None:
    # In a process of its own: here the tests' own type check would come first.
    command = [sys.executable, "-c", "from weldsim.scene.config import FixtureConfig; FixtureConfig(clamps=6)"]
    said = subprocess.run(command, capture_output=True, text=True, check=False).stderr
    assert said.splitlines()[-1].endswith("SceneError: fixture: 6 clamps; 0, 2 or 4 can be placed")
