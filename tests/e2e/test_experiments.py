"""The numbered experiments: what they recompute from printed tables, and that they run."""

import importlib.util
import json
import subprocess
import sys
from pathlib import Path
from types import ModuleType

import cv2
import numpy as np
import pytest

EXPERIMENTS = Path(__file__).parents[2] / "experiments"


def script(name: str) -> ModuleType:
    """A numbered script as a module."""
    spec = importlib.util.spec_from_file_location(name[3:], EXPERIMENTS / f"{name}.py")
    assert spec is not None
    assert spec.loader is not None
    module = importlib.util.module_from_spec(spec)
    sys.modules[spec.name] = module
    spec.loader.exec_module(module)
    return module


@pytest.mark.render
def test_errors_of_the_thesis_are_recomputed_from_its_pairs(real_data):
    tables = json.loads((real_data.parent / "thesis_tables.json").read_text())
    module = script("10_thesis_tables")
    guidance = module.guidance(tables, seeds=1)
    assert guidance["recomputed"] == pytest.approx(32.8e-3, abs=0.05e-3)
    assert 0 < guidance["ours"] < 2e-3
    first, second = module.depth(tables, seeds=1)
    assert first["recomputed"] == pytest.approx(3.5e-3, abs=0.05e-3)
    assert first["ours"] < 1e-3 < second["ours"]
    for name, pair, across, seconds in (("cylinder", 5.0, 3.0, 40.15), ("cuboid", 6.1, 4.4, 61.11), ("y", 6.4, 3.9, 25.65)):
        time, distance, cross, _ = module.part(name, tables, None)
        assert time["recomputed"] == pytest.approx(seconds, abs=0.1)
        assert distance["recomputed"] == pytest.approx(pair * 1e-3, abs=0.06e-3)
        assert cross["recomputed"] == pytest.approx(across * 1e-3, abs=0.35e-3)
    assert "| 6.1 |" in module.markdown([guidance, first], 1)


@pytest.mark.render
def test_sensitivity_is_measured_and_drawn(tmp_path):
    command = [
        sys.executable,
        str(EXPERIMENTS / "11_sensitivity.py"),
        "--quick",
        "--only",
        "width",
        "--jobs",
        "1",
        "--out",
        str(tmp_path),
    ]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    rows = json.loads((tmp_path / "11_sensitivity.json").read_text())["sweeps"]["width"]
    assert len(rows) == 4
    ours = [row for row in rows if row["method"] == "profile" and row["value"] > 0.01]
    assert all(row["mean"] < 0.6e-3 for row in ours)
    assert cv2.imread(str(tmp_path / "11_sensitivity.png")).std() > 5


@pytest.mark.render
def test_a_scene_is_held_to_its_limits_and_one_that_breaks_them_is_named(tmp_path, capsys, monkeypatch):
    module = script("04_five_scenes")
    words = ["04", "--scenes", "straight", "--seeds", "1", "--parts", "d415", "offset", "--jobs", "1", "--out", str(tmp_path)]
    monkeypatch.setattr(sys, "argv", words)
    assert module.main() == 0
    assert "Limits broken: none." in (tmp_path / "04_five_scenes.md").read_text()
    bare, clamped = json.loads((tmp_path / "04_five_scenes.json").read_text())["cases"]
    assert [bare["condition"], clamped["condition"]] == ["bare", "4 clamps"]
    assert bare["rows"][0]["mean"] < 0.4e-3
    monkeypatch.setitem(module.MOST, "straight", {"mean": 1e-6})
    assert module.main() == 1
    assert "* straight, bare, seed 0: mean mm" in capsys.readouterr().out


@pytest.mark.render
def test_smoothing_is_measured_and_drawn(tmp_path):
    command = [sys.executable, str(EXPERIMENTS / "13_smoothing.py"), "--quick", "--out", str(tmp_path)]
    done = subprocess.run(command, capture_output=True, text=True, timeout=300, check=False)
    assert done.returncode == 0, done.stderr
    content = json.loads((tmp_path / "13_smoothing.json").read_text())
    exact = {(row["smoother"], row["radius"]): row for row in content["rows"] if row["noise"] == "none"}
    assert abs(exact["mls", 0.0]["root_lost"]) < 0.05e-3
    assert exact["mls", 0.005]["root_lost"] > 0.2e-3
    assert abs(exact["section", None]["wider"]) < 0.2e-3
    for row in content["curves"]:
        bias, scatter = ([each[k] for each in row["by_strength"]] for k in (1, 2))
        assert (np.diff(bias) > -1e-8).all()  # but for rounding
        assert (np.diff(scatter) < 1e-8).all()
    assert cv2.imread(str(tmp_path / "13_smoothing.png")).std() > 5


def test_the_budget_is_a_table_of_every_source():
    module = script("12_error_budget")
    names = [*module.sources(0)]
    rows = [
        {"source": name, "scene": "straight", "unit": unit, "planned": 1e-4 * k, "executed": None, "tracking": 5e-5}
        for unit in range(2)
        for k, name in enumerate(names)
    ]
    lines = module.markdown(rows, ["straight"], 2).splitlines()
    assert lines[-1] == "| straight | " + " | ".join(f"{0.1 * k:.2f} / -" for k in range(len(names))) + " | 0.05 |"
    one, other = (module.sources(unit)["hand-eye"][1].twin for unit in (0, 1))
    assert not np.allclose(one.X_FC.p, other.X_FC.p)


def test_fault_drills_judge_by_the_controllers_own_record() -> None:
    module = script("23_fault_drills")
    period, t = 0.008, 0.008 * np.arange(1, 251)
    text = "the controller hung up (t = 1.000 s)"

    def judged(arc_until: float, **changes: object) -> dict:
        rows = {"t": t, "arc": (t <= arc_until).astype(float), "speed": np.where(t <= 1.05, 0.1, 0.0)}
        seen = {"rule": "link", "text": text, "log": (t - t[0]).tolist(), "origin": t[0], "period": period, "last_arc": False}
        seen |= {"last_speed": 0.0, "events": [(1.0, "link", text)], "disconnect": 0.1, "late": 0}
        seen["box"] = {"reason": text, "t": seen["log"], "kinds": ["link"], "speed": 0.0, "arc": False}
        answer = {"struck": [[1.0, "link-drop"]], "log": [], "lost": 0.0}
        return module.judged(module.CASES["link dropped"], "link dropped", "weld", seen | changes, rows, answer)

    good = judged(1.1)
    assert good["wrong"] == []
    assert (good["arc"], good["rest"]) == (pytest.approx(0.096), pytest.approx(0.048))
    lost = np.delete(t - t[0], 50).tolist()
    for row, said in (
        (judged(1.4), "arc after 0.392 s"),
        (judged(1.1, rule="client"), "reason client"),
        (judged(1.1, log=lost), "1 periods not in the log"),
        (judged(1.1, box=None), "no black box"),
        (judged(1.1, last_arc=True), "log ends with arc True"),
        (judged(1.1, disconnect=9.0), "disconnect took"),
    ):
        assert any(said in line for line in row["wrong"]), (said, row["wrong"])


def test_bare_surfaces_are_as_they_are_called():
    """A table cropped like the public scans, and a plate with round holes down to the table."""
    module = script("24_bare_surfaces")
    found = list(module.tables(1, "measured", False))
    assert [bare.surface.split()[-1] for bare in found] == ["true", "wrong", "none"]
    assert [len(bare.cloud.viewpoints) for bare in found] == [1, 1, 0]
    points = np.asarray(found[0].cloud.points)
    assert 30_000 < len(points) < 45_000  # the scans have 40,000
    a, b, c = module.TABLE
    off = points[:, 2] - points[:, :2] @ (a, b) - c
    assert 1e-3 < off.std() < 6e-3

    camera = module.D415_640X480
    X_BC = module.looking(np.array([0.0, -0.45, 0.4 + module.THICKNESS]), np.pi / 2)
    depth = module.drilled_depth(camera, X_BC, module.THICKNESS).astype(float)
    height = (camera.rays() * depth[..., None]) @ X_BC.R.T + X_BC.p
    open_share = np.pi * module.HOLE_RADIUS**2 / module.HOLE_PITCH**2
    assert np.mean(height[..., 2] < module.THICKNESS - 1e-6) == pytest.approx(open_share, abs=0.01)
    assert height[..., 2].min() == pytest.approx(0.0, abs=1e-6)
    axis = height[..., :2] - module.HOLE_PITCH * np.rint(height[..., :2] / module.HOLE_PITCH)
    inside = (height[..., 2] < module.THICKNESS - 1e-6) & (height[..., 2] > 1e-6)
    assert np.linalg.norm(axis[inside], axis=1) == pytest.approx(module.HOLE_RADIUS, abs=1e-6)


@pytest.mark.parametrize(("wavelength", "band"), [(7.0, 1), (35.0, 3), (75.0, 4)])
def test_a_wave_is_counted_in_its_band(wavelength, band):
    module = script("25_noise_spectrum")
    x = np.arange(400) * module.GRID * 1e3
    image = 2e-3 * np.sin(2 * np.pi * x / wavelength)[:, None] * np.ones(400)
    found = module.bands(image)
    assert found[band] == pytest.approx(2e-3 / np.sqrt(2), rel=0.1)
    assert np.delete(found, band).max() < 0.3 * found[band]
    assert np.abs(module.without_tilt(0.3 * image + 0.01 * x[:, None] - 0.02 * x)).max() < 2e-3


def test_the_twins_roughness_of_a_flat_part_is_that_of_public_frames():
    """A D415 at 0.67 m: rms in each band from 20 to 400 mm within a factor of 1.8, none of it where the frames have none."""
    module = script("25_noise_spectrum")
    part = module.PARTS[0]
    sigma, twin, _ = module.spectrum(part, 0)
    assert sigma == pytest.approx(part.sigma, rel=0.15)
    ratio = 1e3 * twin / part.real
    assert ((ratio[3:] > 1 / 1.8) & (ratio[3:] < 1.8)).all()
    assert (ratio[:3] < 1.0).all()


@pytest.mark.render
def test_the_points_of_a_seam_are_counted_within_their_own_sigma():
    module = script("26_sigma")
    found = module.shares(("y", 0))
    assert len(found) == 1
    points, one, two, sigma = found[0]
    assert points > 100
    assert one <= two <= 1.0
    assert 5e-5 < sigma < 1e-3
    assert module.holds({"within_one": 0.68, "within_two": 0.95})
    assert not module.holds({"within_one": 0.85, "within_two": 0.99}), "sigma is too wide"
    assert not module.holds({"within_one": 0.60, "within_two": 0.85}), "sigma is too narrow"
