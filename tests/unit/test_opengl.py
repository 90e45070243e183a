"""The back end is found by trying, and its absence never stops a capture: each case in its own process."""

import os
import subprocess
import sys

import pytest

from weldsim.errors import SensorError
from weldsim.opengl import gl_candidates, rendering_backend

PROBE = """
from tests.twin_scenes import camera_above, grooved_scene
from weldsim.mounts import D415_640X480
from weldsim.opengl import backend_failures, rendering_backend
from weldsim.sensor.renderer import make_renderer
scene = grooved_scene()
depth = make_renderer(scene.model).render(scene.data, camera_above(0), D415_640X480).depth
print(rendering_backend(), *backend_failures(), round(float(depth[240, 320]), 6))
"""


def run(**environ: str) -> str:
    base = {key: value for key, value in os.environ.items() if key not in ("MUJOCO_GL", "PYOPENGL_PLATFORM", "DISPLAY")}
    result = subprocess.run([sys.executable, "-c", PROBE], env={**base, **environ}, capture_output=True, text=True, timeout=300)
    assert result.returncode == 0, result.stderr[-500:]
    assert "Traceback" not in result.stderr
    return result.stdout.strip()


@pytest.mark.parametrize(
    ("environ", "tried"),
    [
        ({"MUJOCO_GL": "disabled"}, ""),
        ({"MUJOCO_GL": "egl", "MUJOCO_EGL_DEVICE_ID": "99"}, "egl"),
        ({"MUJOCO_GL": "egl", "PYOPENGL_PLATFORM": "osmesa"}, "egl"),
        ({"MUJOCO_GL": "glfw"}, "glfw"),
    ],
    ids=["disabled", "no-device", "wrong-platform", "no-display"],
)
def test_without_opengl_rays_are_cast(environ: dict[str, str], tried: str) -> None:
    backend, *rest = run(**environ).split()
    assert backend == "embree"
    assert rest[:-1] == tried.split()


def test_an_unset_choice_finds_the_same_as_the_default() -> None:
    """Nothing set, no display: what draws here is found, and both give the same depth."""
    backend, *_, depth = run().split()
    assert backend == rendering_backend()
    assert depth == run(MUJOCO_GL="disabled").split()[-1]


def test_where_the_first_choice_fails_the_next_is_found() -> None:
    """Each is tried in a process of its own; off-screen Mesa may or may not be installed."""
    backend, *failed, depth = run(MUJOCO_EGL_DEVICE_ID="99").split()
    assert failed == {"osmesa": ["egl"], "embree": ["egl", "osmesa"]}[backend]
    assert depth == run(MUJOCO_GL="disabled").split()[-1]


@pytest.mark.parametrize(
    ("wish", "expected"),
    [("egl", ("egl",)), ("OSMesa ", ("osmesa",)), ("off", ()), ("glx", ("glfw",))],
)
def test_mujoco_gl_is_obeyed(wish: str, expected: tuple[str, ...]) -> None:
    assert gl_candidates({"MUJOCO_GL": wish}) == expected


def test_a_word_that_is_no_platform_is_named() -> None:
    with pytest.raises(SensorError, match=r"bogus.*egl, osmesa, glfw or disabled"):
        gl_candidates({"MUJOCO_GL": "bogus"})
