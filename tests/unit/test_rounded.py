"""Floats in JSON: no digits that nobody means, and nothing lost that is read back."""

import json
import re
from pathlib import Path

import numpy as np
import pytest

from tests.seams import findings, found_seam, sine_seam, torch_path
from weldsim.cli.show import print_json
from weldsim.path.files import path_document, path_text
from weldsim.report.weld import report_json, weld_report
from weldsim.rounded import FINE, rounded
from weldsim.run_folder import write_json

RNG = np.random.default_rng(3)


def longest(text: str) -> int:
    """Significant digits of the longest number in a JSON text."""
    numbers = re.findall(r"-?\d+\.\d+(?:e[-+]?\d+)?|-?\d+e[-+]?\d+", text)
    return max((len(re.sub(r"e.*|[-.]", "", number).lstrip("0")) for number in numbers), default=0)


@pytest.mark.parametrize(
    ("value", "text"),
    [
        (0.1 + 0.2, "0.3"),
        (3e-4 - 1e-19, "0.0003"),
        (7.562070403954914e-05, "7.56207e-05"),
        (0.9746519157206727, "0.974651916"),
        (-1e-13, "-1e-13"),
        (-0.0, "0.0"),
        (1234.5678901234567, "1234.567890123"),
        (True, "true"),
        (3, "3"),
        (None, "null"),
        (np.float64(0.1) * 3, "0.3"),
    ],
)
def test_a_number_is_what_a_person_would_write(value: object, text: str) -> None:
    assert json.dumps(rounded(value)) == text


@pytest.mark.parametrize("seed", range(3))
def test_what_is_rounded_is_within_a_nanometre(seed: int) -> None:
    rng = np.random.default_rng(seed)
    values = (rng.normal(size=2000) * 10.0 ** rng.uniform(-12, 1, 2000)).tolist()
    near = np.array(rounded(values))
    assert np.abs(near - values).max() <= 0.5000001e-9
    assert (np.abs(near / values - 1) <= 0.5000001e-5).all()
    assert rounded(rounded(values)) == rounded(values)
    assert np.abs(np.array(rounded(values, FINE)) - values).max() <= 0.5000001e-12


def test_a_quaternion_keeps_its_length_and_an_arm_its_own_figures() -> None:
    quaternion = (RNG.normal(size=4)).tolist()
    dh = RNG.normal(size=(6, 4)).tolist()
    content = {"pose": {"quaternion_wxyz": quaternion, "position": [1 / 3]}, "facts": [{"dh": dh}]}
    out = rounded(content)
    assert np.abs(np.array(out["pose"]["quaternion_wxyz"]) - quaternion).max() <= 0.5000001e-12
    assert out["pose"]["position"] == [0.333333333]
    assert out["facts"][0]["dh"] == dh


def test_nothing_that_is_written_or_printed_has_more_digits(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    known = sine_seam(RNG)
    seam = found_seam(known, 2e-4 * np.sin(known.s / 0.02))
    path, found = torch_path(seam), findings((seam,), np.zeros(10, bool))
    report = report_json(weld_report(found, (path,), scene="sine", known=(known,), timing={"seam": 1 / 3}))
    assert longest(json.dumps(report)) > 12, "otherwise this test sees nothing"
    print_json(report)
    write_json(tmp_path / "report.json", report)
    assert longest(capsys.readouterr().out) <= 10
    assert longest((tmp_path / "report.json").read_text()) <= 10
    document = path_document((seam,), (path,), {}, {"viewpoints": [[1 / 3, 0.1 + 0.2, 2 / 3]]}, "0")
    assert longest(path_text(document)) <= 10
