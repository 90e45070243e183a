"""Paths, CSVs and robot programs spoilt at random: each is read, or refused in one line with exit code 2."""

import json
import random
import re
from pathlib import Path

import numpy as np
import pytest

from tests.torch_paths import flat_curve, torch_path
from weldsim.cli import main
from weldsim.dryrun.read import read_program
from weldsim.errors import InputError

CASES = 150
WRONG = ["nan", "inf", "-inf", "1e999", "", "abc", "99999", "0/0", "p[0]", "[]", "null", "true", "(", "2**3", "1e-320"]
MARKS = '\x00\n "(),-.09[]{}aenπ'


def files() -> dict[str, str]:
    """One good file of each kind."""
    X = torch_path(flat_curve("line", 0.03, 0.002) + np.array([0, -0.45, 0.08]), np.array([0, 0, -1.0])).X_BT
    rows = [",".join(f"{v:.6f}" for v in row) for row in np.concatenate([X.p, X.rotation_vector], axis=1)]
    poses = [{"s": 0.002 * i, "position": X.p[i].tolist(), "quaternion_wxyz": X.quaternion[i].tolist()} for i in range(len(X))]
    seam = {"id": "seam-1", "joint": "groove", "reference": "opening", "length": 0.03, "width": 0.01, "confidence": 1.0}
    document = {"schema": "weldsim.path/1", "frame": "base", "units": {"length": "m", "angle": "rad"}}
    document |= {"seams": [{**seam, "points": X.p.tolist(), "sigma": [1e-4] * len(X), "poses": poses}]}
    lines = [
        "def job():",
        "  set_tcp(p[0.0,0.048,0.227,-0.85,0.0,0.0])",
        "  movej([-1.57,-1.92,-1.6,-1.1,1.57,0.0], a=1.4, v=1.05)",
    ]
    lines += [f"  movel(p[{row}], a=0.5, v=0.05)" for row in rows[:4]] + ["  sleep(0.1)", "end"]
    return {"json": json.dumps(document), "csv": "\n".join(rows), "script": "\n".join(lines)}


def spoilt(text: str, rng: random.Random) -> str:
    """The text with a number replaced, or some characters changed, dropped or doubled."""
    if rng.random() < 0.5:
        first, last = rng.choice([match.span() for match in re.finditer(r"-?\d+\.\d+", text)])
        return text[:first] + rng.choice(WRONG) + text[last:]
    for _ in range(rng.choice((1, 1, 3, 20))):
        at = rng.randrange(len(text))
        text = text[:at] + rng.choice(("", rng.choice(MARKS), text[at : at + 7] * 2)) + text[at + rng.choice((0, 1, 30)) :]
        text = text or "x"
    return text


@pytest.mark.parametrize("kind", ["json", "csv", "script"])
def test_a_spoilt_file_is_read_or_refused_in_one_line(kind: str, tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    good, rng, refused = files()[kind], random.Random(5), []
    file = tmp_path / f"job.{kind}"
    file.write_text(good)
    assert read_program(file)
    for _ in range(CASES):
        text = spoilt(good, rng)
        file.write_text(text)
        try:
            program = read_program(file)
        except InputError as error:
            refused.append((text, error))
        else:
            targets = [path.X_BT.p for path in program.paths] + [m.X_BT.p[None] for m in program.motions if m.X_BT is not None]
            assert all(np.abs(p).max() < 5 for p in targets), text
    assert len(refused) > CASES / 3
    for text, error in refused:
        assert error.exit_code == 2, text
        assert "\n" not in str(error), text
        assert len(str(error)) < 400, text
    for text, _ in refused[:5]:
        file.write_text(text)
        capsys.readouterr()
        assert main(["dry-run", str(file), "--empty", "--export", str(tmp_path / "out.script")]) == 2
        assert len(capsys.readouterr().err.strip().splitlines()) == 1
    assert [path.name for path in tmp_path.iterdir()] == [file.name]
