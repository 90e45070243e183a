"""`weldsim execute` after a stop: where it was, how much is welded, how to go on; an earlier run directory is kept."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tests.path_files import advice, document, stopped_at, written
from weldsim.cli import main
from weldsim.execution.simulated import SimulatedRobot


@pytest.mark.parametrize("options", [["--arc"], []])
def test_a_stopped_weld_says_where_how_much_and_how_to_go_on_and_that_works(
    options: list[str], tmp_path: Path, capsys: pytest.CaptureFixture[str]
) -> None:
    out, file = tmp_path / "out", written(tmp_path, document())
    with stopped_at(0.0123):
        assert main(["execute", file, "--robot", "sim", *options, "--out", str(out), "--set", "execution.settle=0.1 s"]) == 1
    said = capsys.readouterr().out
    word = "welded" if options else "travelled with the arc off"
    assert f"stopped at s = 12.3 mm: {word} 12 of 30 mm" in said
    progress = json.loads((out / "run.json").read_text())["progress"]
    assert progress["s_to"] == pytest.approx(0.0123, abs=2e-4)
    assert progress["welded"] == pytest.approx(progress["s_to"], abs=1e-5)
    assert progress["length"] == pytest.approx(0.03, abs=1e-6)
    assert progress["arc"] == bool(options)
    report = json.loads((out / "report.json").read_text())
    assert report["stopped"] == "protective stop"
    page = (out / "report.html").read_text()
    for text in (">STOPPED<", f"at s = 12.3 mm: {word} 12 of 30 mm", "stopped here", "stopped at 12.3 mm", "to go on from there"):
        assert text in page

    words = advice(said)
    assert ("--arc" in words) == bool(options)
    assert main([*words, "--json"]) == 0
    rest = json.loads(capsys.readouterr().out)
    assert rest["passed"]
    assert rest["from"] == pytest.approx(progress["s_to"], abs=1e-4)
    assert rest["from"] <= progress["s_to"] + 1e-9
    assert rest["progress"]["s_from"] == pytest.approx(rest["from"] - 5e-3, abs=1e-9)
    assert rest["progress"]["s_to"] == pytest.approx(0.03, abs=2e-4)
    assert rest["kept"] is None
    folder = Path(rest["written"][0])
    assert folder == tmp_path / "out-from-12"
    tip = np.load(folder / "log.npz")
    weld = tip["segments"] == "weld"
    start = np.array(document()["seams"][0]["poses"][0]["position"])
    assert np.linalg.norm(tip["position_B"][weld][0] - start) == pytest.approx(rest["progress"]["s_from"], abs=5e-4)
    assert (out / "run.json").exists()  # the first run is as it was


def test_a_rest_that_is_stopped_again_is_gone_on_with_again(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    out, file = tmp_path / "out", written(tmp_path, document())
    start = ["execute", file, "--robot", "sim", "--arc", "--set", "execution.overlap=2 mm"]
    with stopped_at(0.02):
        assert main([*start, "--from", "12 mm", "--out", str(out)]) == 1
    said = capsys.readouterr().out
    assert re.search(r"stopped at s = 19\.[89] mm: welded 10 of 30 mm from s = 10 mm on", said)
    words = advice(said)
    assert words[-4:] == ["--from", words[-3], "--out", f"{out}-from-20"]
    assert main(words) == 0
    assert main([*start, "--from", "0 mm", "--out", str(out), "--json"]) == 0
    said = json.loads(capsys.readouterr().out.rpartition("\n{\n")[2].join(["{", ""]))
    assert said["kept"] == str(tmp_path / "out.1")


def test_a_stop_before_the_weld_and_one_after_it(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file = written(tmp_path, document())
    with stopped_at(-1.0):  # on its way there
        assert main(["execute", file, "--robot", "sim", "--arc", "--out", str(tmp_path / "a")]) == 1
    said = capsys.readouterr().out
    assert "stopped before the weld began: 0 of 30 mm welded" in said
    assert "--from" not in advice(said)
    with stopped_at(0.0299):
        assert main(["execute", file, "--robot", "sim", "--arc", "--out", str(tmp_path / "b")]) == 1
    said = capsys.readouterr().out
    assert re.search(r"0\.[12] mm of the seam are left, too little to go on with", said)
    assert "--from" not in said


@pytest.mark.parametrize(
    ("length", "says"),
    [
        ("12", '"12 mm"'),
        ("1.2e1", '"1.2e1 mm"'),
        ("12 deg", "deg"),
        ("half", "half"),
        ("nan mm", "nan mm"),
        ("31 mm", "from 0 to 30.0 mm"),
        ("-3 mm", "from 0 to 30.0 mm"),
        ("29 mm", "1.0 mm of seam-1 are left"),
        ("12 m", "from 0 to 30.0 mm"),
    ],
)
def test_where_to_go_on_is_a_length_on_the_seam(
    length: str, says: str, tmp_path: Path, monkeypatch: pytest.MonkeyPatch, capsys: pytest.CaptureFixture[str]
) -> None:
    file, moves = written(tmp_path, document()), []
    monkeypatch.setattr(SimulatedRobot, "connect", lambda self: moves.append("connect"))
    assert main(["execute", file, "--robot", "sim", f"--from={length}", "--out", str(tmp_path / "out")]) == 2
    error = capsys.readouterr().err
    assert error.count("\n") == 1
    assert "--from" in error
    assert says in error
    assert not moves


def test_a_second_run_keeps_the_first_and_says_where(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    file, out = written(tmp_path, document(shift=(0.0, -1.2, 0.1))), tmp_path / "out"
    words = ["execute", file, "--robot", "sim", "--out", str(out)]
    assert main(words) == 1
    first = (out / "run.json").read_bytes()
    assert "is now" not in capsys.readouterr().out
    for n in (1, 2):
        assert main(words) == 1
        assert f"the run that was in {out} is now {out}.{n}" in capsys.readouterr().out
    assert Path(f"{out}.1/run.json").read_bytes() == first
    assert sorted(path.name for path in tmp_path.iterdir()) == ["out", "out.1", "out.2", "path.json"]
