"""Every command that draws, as started on a machine without a display on which nobody set MUJOCO_GL."""

import json
import os
import subprocess
import sys
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.e2e.test_cli_execute import document

HIDDEN = ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY", "WAYLAND_DISPLAY")
COMMAND = [sys.executable, "-c", "import sys; from weldsim.cli import main; sys.exit(main())"]
ONE_VIEW = ("--set", 'scene.views=[{standoff="400 mm"}]')
SHORT = ("--set", 'scene.plate.length="90 mm"', "--set", "scene.fixture.clamps=0", "--set", 'path.speed="20 mm/s"')


def headless(folder: Path, *words: str, environ: dict[str, str] | None = None) -> str:
    """Stdout of a command in `folder` that must end well and complain of nothing."""
    env = {key: value for key, value in os.environ.items() if key not in HIDDEN}
    done = subprocess.run(
        [*COMMAND, *words], cwd=folder, env={**env, **(environ or {})}, capture_output=True, text=True, timeout=300, check=False
    )
    assert (done.returncode, done.stderr) == (0, ""), done.stdout[-500:]
    assert "OpenGL" not in done.stdout
    return done.stdout


def shows_something(picture: Path) -> bool:
    """Whether a picture is there that is more than one colour."""
    image = cv2.imread(str(picture))
    return image is not None and float(np.std(image)) > 10.0


@pytest.mark.parametrize("environ", [{}, {"MUJOCO_GL": "disabled"}, {"MUJOCO_GL": "osmesa"}], ids=["unset", "disabled", "osmesa"])
def test_a_dry_run_is_drawn(tmp_path: Path, environ: dict[str, str]) -> None:
    (tmp_path / "path.json").write_text(json.dumps(document()))
    said = headless(tmp_path, "dry-run", "path.json", "--png", "cell.png", "--html", "page.html", environ=environ)
    assert "wrote cell.png" in said
    assert "wrote page.html" in said
    assert shows_something(tmp_path / "cell.png")
    assert "data:image/png;base64," in (tmp_path / "page.html").read_text()


def test_a_scene_is_drawn(tmp_path: Path) -> None:
    headless(tmp_path, "scenes", "show", "straight", "-o", "cell.png")
    assert shows_something(tmp_path / "cell.png")


def test_a_scan_its_plan_and_the_page_are_drawn(tmp_path: Path) -> None:
    headless(tmp_path, "scan", "straight", *SHORT[:4], *ONE_VIEW, "--sensor", "exact", "--out", "cloud.ply", "--depth", "depth.png")
    assert np.any(cv2.imread(str(tmp_path / "depth.png"), cv2.IMREAD_UNCHANGED))
    headless(tmp_path, "plan", "cloud.ply", "--report", "page.html")
    assert "</html>" in (tmp_path / "page.html").read_text()


@pytest.mark.render
@pytest.mark.slow
def test_a_weld_is_filmed_and_welded_again(tmp_path: Path) -> None:
    headless(tmp_path, "run", "straight", *SHORT, "--sensor", "exact", "--video", "weld.mp4", "--out", "job")
    film = cv2.VideoCapture(str(tmp_path / "weld.mp4"))
    _, first = film.read()
    assert first is not None
    assert first.std() > 10.0
    assert shows_something(tmp_path / "job" / "report.png")
    headless(tmp_path, "execute", "job/path.json", "--robot", "sim", "--scene", "straight", *SHORT, "--arc", "--out", "welded")
    assert shows_something(tmp_path / "welded" / "report.png")


@pytest.mark.slow
def test_a_regression_is_drawn(tmp_path: Path) -> None:
    words = ("--scenes", "straight", "--methods", "profile", "--seeds", "1", "--jobs", "1", "--html", "page.html")
    headless(tmp_path, "regress", *words)
    assert "data:image/jpeg;base64," in (tmp_path / "page.html").read_text()


@pytest.mark.render
def test_a_film_needs_no_variable_from_python_either(tmp_path: Path) -> None:
    """MuJoCo is imported first, so that it has chosen a platform with a display."""
    program = (
        "import mujoco\n"
        "from weldsim.execution.config import SimulationConfig\n"
        "from weldsim.execution.simulated import SimulatedRobot\n"
        "from weldsim.execution.video import VideoConfig, WeldVideo\n"
        "from weldsim.scene.config import SceneConfig\n"
        "from weldsim.scene.world import HOME, build_world\n"
        "with WeldVideo('weld.mp4', VideoConfig(width=320, height=180)) as film:\n"
        "    robot = SimulatedRobot(build_world(SceneConfig()).model, HOME, SimulationConfig(), on_frame=film)\n"
        "    film(robot)\n"
    )
    env = {key: value for key, value in os.environ.items() if key not in HIDDEN}
    done = subprocess.run(
        [sys.executable, "-c", program], cwd=tmp_path, env=env, capture_output=True, text=True, timeout=120, check=False
    )
    assert (done.returncode, done.stderr) == (0, "")
    assert (tmp_path / "weld.mp4").stat().st_size > 1000
