"""The wheel works where there is no checkout: it carries assets and scenes."""

import json
import os
import subprocess
import sys
import sysconfig
import zipfile
from pathlib import Path

import numpy as np
import pytest

ROOT = Path(__file__).parents[2]


@pytest.fixture(scope="module")
def wheel(tmp_path_factory) -> Path:
    folder = tmp_path_factory.mktemp("wheel")
    build = [sys.executable, "-m", "hatchling", "build", "--target", "wheel", "--directory", str(folder)]
    subprocess.run(build, cwd=ROOT, check=True, capture_output=True)
    return next(folder.glob("weldsim-*.whl"))


@pytest.fixture(scope="module")
def clean(wheel, tmp_path_factory) -> Path:
    """A virtual environment with the wheel in it; its dependencies are read from the running one, weldsim is not."""
    folder = tmp_path_factory.mktemp("clean")
    subprocess.run([sys.executable, "-m", "venv", "--without-pip", str(folder)], check=True)
    install = [
        sys.executable,
        "-m",
        "pip",
        "--python",
        str(folder / "bin" / "python"),
        "install",
        "--quiet",
        "--no-deps",
        str(wheel),
    ]
    subprocess.run([*install, "--no-index", "--disable-pip-version-check"], check=True, capture_output=True)
    site = next(folder.glob("lib/python*/site-packages"))
    # A line of a .pth is searched but its own .pth files are not read: the editable weldsim stays out of sight.
    (site / "dependencies.pth").write_text(sysconfig.get_path("purelib") + "\n")
    return folder


def run(clean: Path, *words: str) -> str:
    environment = {key: value for key, value in os.environ.items() if not key.startswith("PYTHON")}
    done = subprocess.run([str(clean / "bin" / words[0]), *words[1:]], cwd=clean, env=environment, capture_output=True, text=True)
    assert done.returncode == 0, done.stderr
    return done.stdout


def groove_cloud() -> np.ndarray:
    """A V-groove 14 mm wide and 8 mm deep along x in a level plate, seen from above: points (n, 3) [m] in the base."""
    rng = np.random.default_rng(5)
    x, y = np.meshgrid(np.arange(-0.1, 0.1, 0.8e-3), np.arange(-0.08, 0.08, 0.8e-3))
    z = -np.clip(0.008 * (1 - np.abs(y) / 0.007), 0, None)
    points = np.stack([x, y - 0.45, z + 0.02], axis=-1).reshape(-1, 3)
    return points + rng.normal(scale=0.1e-3, size=points.shape)


def test_wheel_holds_the_package_assets_scenes_and_licence_and_nothing_else(wheel):
    names = set(zipfile.ZipFile(wheel).namelist())
    files = [path for folder in ("assets", "scenes", "weldsim") for path in (ROOT / folder).rglob("*") if path.is_file()]
    ours = [path.relative_to(ROOT).as_posix() for path in files if "__pycache__" not in path.parts]
    assert len(ours) > 200
    for path in ours:
        assert (path if path.startswith("weldsim/") else f"weldsim/_data/{path}") in names
    assert any(name.endswith("licenses/LICENSE") for name in names)
    assert {name.split("/")[0].split("-")[0] for name in names} == {"weldsim"}


def test_installed_package_is_not_the_checkout(clean):
    place = run(clean, "python", "-c", "import weldsim; print(weldsim.__file__)")
    assert place.startswith(str(clean))


def test_scenes_are_listed_from_the_wheel(clean):
    listed = run(clean, "weldsim", "scenes", "--json")
    assert json.loads(listed)
    for file in (ROOT / "scenes").glob("*.toml"):
        assert file.stem == "cell" or file.stem in listed


def test_a_scene_is_exported_from_the_wheel_and_stock_mujoco_loads_it(clean):
    run(clean, "weldsim", "scenes", "export", "straight", "-o", "cell.xml")
    load = "import mujoco; print(mujoco.MjModel.from_xml_path('cell.xml').ngeom)"
    assert int(run(clean, "python", "-c", load)) > 100


def test_a_cloud_is_planned_from_the_wheel(clean):
    np.savez(clean / "cloud.npz", points=groove_cloud())
    run(clean, "weldsim", "plan", "cloud.npz", "--viewpoint", "0", "-0.45", "0.5", "--out", "path.json")
    document = json.loads((clean / "path.json").read_text())
    assert document["schema"] == "weldsim.path/1"
    (seam,) = document["seams"]
    line = np.array(seam["points"])
    assert np.abs(line[:, 1] + 0.45).max() < 1e-3
    assert seam["length"] > 0.18
