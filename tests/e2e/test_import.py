"""`import weldsim` is cheap, and heavy libraries load where they are used."""

import resource
import subprocess
import sys

import pytest

import weldsim

HEAVY = {"open3d", "mujoco", "mink", "ruckig", "numba", "trimesh", "manifold3d", "plotly", "matplotlib"}
LIMIT = 0.3  # [s] over a bare interpreter


def loaded_by(statement: str) -> set[str]:
    """Top-level modules in sys.modules after a statement, in a process of its own."""
    program = f"import sys; {statement}; print(*{{name.split('.')[0] for name in sys.modules}})"
    return set(subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, check=True).stdout.split())


def seconds(program: str) -> float:
    """Processor time [s] of a process of its own: other work may run beside the tests, and an import waits for nothing."""
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    subprocess.run([sys.executable, "-c", program], check=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    return after.ru_utime - before.ru_utime + after.ru_stime - before.ru_stime


def test_import_takes_under_a_third_of_a_second():
    """Whole process less a bare interpreter, the best of several."""
    bare = min(seconds("pass") for _ in range(5))
    assert min(seconds("import weldsim") for _ in range(5)) - bare < LIMIT


def test_import_loads_no_library_at_all():
    assert loaded_by("import weldsim") & (HEAVY | {"numpy", "scipy", "cv2", "jaxtyping"}) == set()


@pytest.mark.parametrize("module", ["weldsim.cli", "weldsim.config", "weldsim.doctor"])
def test_commands_load_heavy_libraries_only_when_they_run(module):
    assert loaded_by(f"import {module}") & HEAVY == set()


@pytest.mark.parametrize("words", [["--help"], ["scenes"], ["scenes", "--json"], ["plan", "--help"], ["doctor", "--help"], ["run"]])
def test_what_computes_nothing_loads_no_library_that_computes(words):
    """Listing the scenes took a second, most of it numpy, scipy and OpenCV."""
    quiet = "import os; from weldsim.cli import main; kept = os.dup(1); os.dup2(os.open(os.devnull, os.O_WRONLY), 1)"
    loaded = loaded_by(f"{quiet}; main({words!r}); sys.stdout.flush(); os.dup2(kept, 1)")
    assert "weldsim" in loaded
    assert loaded & (HEAVY | {"numpy", "scipy", "cv2", "jaxtyping", "cattrs"}) == set()


def test_public_names_are_the_ones_that_load():
    assert set(weldsim.__all__) == {"__version__", *weldsim._PUBLIC}
    assert dir(weldsim) == weldsim.__all__
    for name in weldsim.__all__:
        assert getattr(weldsim, name) is not None
    with pytest.raises(AttributeError, match="no_such_name"):
        weldsim.no_such_name  # noqa: B018 - the access is the test
    with pytest.raises(AttributeError, match="did you mean 'load_scene'"):
        weldsim.read_scene  # noqa: B018
