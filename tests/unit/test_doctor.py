"""doctor says what works and what to install where something does not."""

import sys
import tomllib
from importlib import metadata
from pathlib import Path

from weldsim import doctor

ROOT = Path(__file__).parents[2]


def test_every_dependency_is_checked():
    declared = tomllib.loads((ROOT / "pyproject.toml").read_text())["project"]["dependencies"]
    names = {requirement.split(">")[0].lower() for requirement in declared}
    assert {name.lower() for name in doctor.required_libraries()} == names


def test_a_library_that_works_is_named_with_its_version():
    check = doctor.check_library("numpy")
    assert check.ok
    assert check.detail[0].isdigit()
    assert not check.remedy


def test_a_library_that_is_not_installed_says_how_to_install_it():
    check = doctor.check_library("no-such-library-as-this")
    assert not check.ok
    assert check.remedy == "pip install no-such-library-as-this"


def test_the_ur_client_is_an_extra(monkeypatch):
    def without(name: str) -> str:
        raise metadata.PackageNotFoundError(name)

    monkeypatch.setattr(doctor.metadata, "version", without)
    check = doctor.check_ur_client()
    assert check.ok
    assert "not installed" in check.detail
    assert check.remedy == "pip install ur_rtde"


def test_a_missing_system_library_is_named_with_its_package(tmp_path, monkeypatch):
    """The library is installed, but its import fails as open3d's does where libusb is missing."""
    error = "libusb-1.0.so.0: cannot open shared object file: No such file or directory"
    (tmp_path / "plyfile.py").write_text(f"raise ImportError({error!r})\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    check = doctor.check_library("plyfile")
    assert not check.ok
    assert error in check.detail
    assert check.remedy == "sudo apt-get install libusb-1.0-0"


def test_a_crash_on_import_is_a_failed_check(tmp_path, monkeypatch):
    (tmp_path / "plyfile.py").write_text("import os, signal\nos.kill(os.getpid(), signal.SIGSEGV)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    check = doctor.check_library("plyfile")
    assert not check.ok
    assert "signal 11" in check.detail


def test_a_hanging_import_is_a_failed_check(tmp_path, monkeypatch):
    (tmp_path / "plyfile.py").write_text("import time\ntime.sleep(60)\n")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setattr(doctor, "IMPORT_TIMEOUT", 0.5)
    check = doctor.check_library("plyfile")
    assert not check.ok
    assert "0.5 s" in check.detail


def test_rendering_says_which_back_end_draws():
    check = doctor.check_rendering()
    assert check.ok
    assert check.detail.split(":")[0] in {"egl", "osmesa", "glfw", "embree"}


def test_a_word_that_is_no_platform_is_a_failed_check(monkeypatch):
    monkeypatch.setenv("MUJOCO_GL", "nonsense")
    check = doctor.check_rendering()
    assert not check.ok
    assert "nonsense" in check.detail
    assert "MUJOCO_GL" in check.remedy


def test_an_old_python_is_a_failed_check():
    assert doctor.check_python(sys.version_info[:3]).ok
    old = doctor.check_python((3, 10, 12))
    assert not old.ok
    assert "3.11" in old.remedy


def test_a_folder_is_tried_by_writing(tmp_path):
    before = list(tmp_path.iterdir())
    assert doctor.check_writable("folder", tmp_path).ok
    assert doctor.check_writable("folder", tmp_path / "not" / "there" / "yet").ok
    assert list(tmp_path.iterdir()) == before


def test_a_folder_that_cannot_be_written_is_a_failed_check(tmp_path, monkeypatch):
    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(doctor.tempfile, "TemporaryFile", refuse)
    check = doctor.check_writable("folder", tmp_path)
    assert not check.ok
    assert "Permission denied" in check.detail
    assert check.remedy


def test_captured_data_may_be_unset_but_not_wrong(tmp_path):
    assert doctor.check_captured_data(None).ok
    assert not doctor.check_captured_data(str(tmp_path)).ok
    (tmp_path / "real").mkdir()
    assert doctor.check_captured_data(str(tmp_path)).ok


def test_every_library_of_a_machine_that_was_set_up_imports_and_none_is_left_behind():
    before = set(sys.modules)
    checks = doctor.diagnose()
    libraries = set(doctor.required_libraries())
    assert [check for check in checks if check.name in libraries and not check.ok] == []
    assert len({check.name for check in checks}) == len(checks)
    assert all(check.ok or check.remedy for check in checks)
    assert all("\n" not in check.detail + check.remedy for check in checks)
    assert not {"open3d", "numba"} & (set(sys.modules) - before)


def test_ray_casting_counts_only_where_its_library_loads(tmp_path, monkeypatch):
    (tmp_path / "open3d.py").write_text('raise ImportError("libEGL.so.1: cannot open shared object file: No such file")\n')
    monkeypatch.setenv("MUJOCO_GL", "disabled")
    assert doctor.check_rendering().detail.startswith("embree")
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    check = doctor.check_rendering()
    assert not check.ok
    assert "libegl1" in check.remedy


def test_a_platform_that_mujoco_cannot_load_is_what_is_blamed(tmp_path, monkeypatch):
    """mujoco cannot be imported where MUJOCO_GL names a platform without its library; installing it again would not help."""
    (tmp_path / "plyfile.py").write_text(
        "import os\nif os.environ.get('MUJOCO_GL') == 'osmesa': raise AttributeError('glGetError')\n"
    )
    monkeypatch.setenv("PYTHONPATH", str(tmp_path))
    monkeypatch.setenv("MUJOCO_GL", "osmesa")
    check = doctor.check_library("plyfile")
    assert not check.ok
    assert "glGetError" in check.detail
    assert check.remedy == "unset MUJOCO_GL, or sudo apt-get install libosmesa6"
    monkeypatch.setenv("MUJOCO_GL", "egl")
    assert doctor.check_library("plyfile").ok


def test_a_current_folder_that_is_gone_is_a_failed_check(tmp_path, monkeypatch):
    folder = tmp_path / "gone"
    folder.mkdir()
    monkeypatch.chdir(folder)
    folder.rmdir()
    check = doctor.check_current_folder()
    assert not check.ok
    assert check.remedy
