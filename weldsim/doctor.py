"""What works on this machine, and what to install where something does not: the checks behind `weldsim doctor`.

Each library is imported in a process of its own: a missing system library shows as a failed check, a crash too, and
the checks leave nothing behind in the calling process.
"""

import os
import re
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from concurrent.futures import ThreadPoolExecutor
from dataclasses import dataclass
from importlib import metadata
from pathlib import Path

PYTHON_AT_LEAST = (3, 11)
IMPORT_TIMEOUT = 60.0  # [s] a library that takes longer hangs

# Import names that are not the distribution's name with - as _
_IMPORT_NAMES = {"opencv-python-headless": "cv2", "ur_rtde": "rtde_control"}

# Debian and Ubuntu packages of the shared libraries that the wheels expect to find
_APT_PACKAGES = {
    "libusb-1.0": "libusb-1.0-0",
    "libGL": "libgl1",
    "libEGL": "libegl1",
    "libOSMesa": "libosmesa6",
    "libX11": "libx11-6",
    "libudev": "libudev1",
    "libidn2": "libidn2-0",
    "libstdc++": "libstdc++6",
    "libgomp": "libgomp1",
}
_GL_REMEDY = "for OpenGL: sudo apt-get install libegl1 libegl-mesa0 libgl1-mesa-dri"
_SHARED_LIBRARY = re.compile(r"(lib[\w.+-]+?)\.so[\w.]*: cannot open shared object file")


@dataclass(frozen=True, kw_only=True)
class Check:
    """One thing that was tried.

    Attributes:
        name: what was tried.  ok: whether weldsim can work with what was found.  detail: what was found, one line.
        remedy: what to do about it, one line; empty when there is nothing to do.
    """

    name: str
    ok: bool
    detail: str
    remedy: str = ""


def diagnose() -> tuple[Check, ...]:
    """Every check, in the order people read them. Takes a few seconds: each library is imported once."""
    with ThreadPoolExecutor(max_workers=os.cpu_count()) as pool:
        rendering = pool.submit(check_rendering)
        libraries = tuple(pool.map(check_library, required_libraries()))
    return (
        check_python(sys.version_info[:3]),
        *libraries,
        check_ur_client(),
        rendering.result(),
        check_current_folder(),
        check_writable("cache folder", Path(os.environ.get("XDG_CACHE_HOME") or Path.home() / ".cache")),
        check_captured_data(os.environ.get("WELDSIM_DATA")),
    )


def check_python(version: tuple[int, ...]) -> Check:
    """Whether this Python is recent enough."""
    wanted = ".".join(map(str, PYTHON_AT_LEAST))
    ok = version >= PYTHON_AT_LEAST
    return Check(
        name="python",
        ok=ok,
        detail=".".join(map(str, version)),
        remedy="" if ok else f"make a virtual environment with Python {wanted} or newer",
    )


def required_libraries() -> Iterator[str]:
    """The distributions that weldsim declares as dependencies, extras aside, as its own metadata lists them."""
    for requirement in metadata.requires("weldsim") or ():
        specifier, _, marker = requirement.partition(";")
        if "extra" not in marker:
            yield re.split(r"[\s<>=!~\[(]", specifier.strip(), maxsplit=1)[0]


def check_library(distribution: str) -> Check:
    """Whether a library is installed and can be imported, in a process of its own."""
    module = _IMPORT_NAMES.get(distribution, distribution.replace("-", "_"))
    try:
        version = metadata.version(distribution)
    except metadata.PackageNotFoundError:
        return Check(name=distribution, ok=False, detail="not installed", remedy=f"pip install {distribution}")
    failure = _failure_of(f"import {module}")
    if failure is None:
        return Check(name=distribution, ok=True, detail=version)
    # A word in MUJOCO_GL that this machine has no library for keeps mujoco, and what needs it, from being imported at all.
    named = os.environ.get("MUJOCO_GL") and _failure_of(f"import os; del os.environ['MUJOCO_GL']; import {module}") is None
    remedy = _unset_remedy() if named else remedy_for(distribution, failure)
    return Check(name=distribution, ok=False, detail=f"{version}: {failure}", remedy=remedy)


def check_ur_client() -> Check:
    """Whether a UR arm, or the virtual controller, can be commanded; an extra, so that doing without it is no failure."""
    found = check_library("ur_rtde")
    if found.detail == "not installed":
        return Check(name="ur_rtde", ok=True, detail="not installed: only a UR arm needs it", remedy="pip install ur_rtde")
    return found


def remedy_for(distribution: str, failure: str) -> str:
    """What to do about an import that failed with the line `failure`."""
    if found := _SHARED_LIBRARY.search(failure):
        package = _APT_PACKAGES.get(found[1])
        return f"sudo apt-get install {package}" if package else f"install the system library {found[1]}"
    return f"pip install --force-reinstall {distribution}"


def check_rendering() -> Check:
    """Which rendering back end draws; without OpenGL the ray-cast one does, so that is no failure."""
    program = (
        "from weldsim.opengl import backend_failures, rendering_backend\n"
        "backend = rendering_backend()\n"
        "if backend == 'embree': import open3d\n"
        "print(backend, *backend_failures().values(), sep='\\n')"
    )
    run = _run(program)
    if isinstance(run, str) or run.returncode:
        failure = run if isinstance(run, str) else _last_line(run.stderr)
        return Check(name="rendering", ok=False, detail=failure, remedy=_rendering_remedy(failure))
    backend, *failures = run.stdout.strip().splitlines()
    if backend == "embree":
        why = f" ({'; '.join(failures)})" if failures else ""
        remedy = _unset_remedy() if os.environ.get("MUJOCO_GL") else _GL_REMEDY
        return Check(name="rendering", ok=True, detail=f"embree: ray casting, no OpenGL{why}", remedy=remedy)
    return Check(name="rendering", ok=True, detail=f"{backend}: OpenGL")


def _rendering_remedy(failure: str) -> str:
    """What to do where nothing draws."""
    if found := _SHARED_LIBRARY.search(failure):  # one of the ray caster's own
        return remedy_for("open3d", found[0])
    return _unset_remedy() if os.environ.get("MUJOCO_GL") else _GL_REMEDY


def _unset_remedy() -> str:
    """What to do where MUJOCO_GL asks for what is not there."""
    osmesa = os.environ.get("MUJOCO_GL", "").lower().strip() == "osmesa"
    return "unset MUJOCO_GL" + (", or sudo apt-get install libosmesa6" if osmesa else "")


def check_current_folder() -> Check:
    """Whether files can be made where the command was started, which may no longer exist."""
    name = "current folder"
    try:
        return check_writable(name, Path.cwd())
    except OSError as error:
        return Check(name=name, ok=False, detail=error.strerror or type(error).__name__, remedy="go to a folder that exists")


def check_writable(name: str, folder: Path) -> Check:
    """Whether files can be made in a folder, or the folder itself where it is not there yet."""
    existing = next(path for path in (folder, *folder.parents) if path.exists())
    try:
        with tempfile.TemporaryFile(dir=existing):
            pass
    except OSError as error:
        reason = error.strerror or type(error).__name__
        return Check(name=name, ok=False, detail=f"{folder}: {reason}", remedy="work in a folder that you may write to")
    return Check(name=name, ok=True, detail=f"{folder}: writable")


def check_captured_data(folder: str | None) -> Check:
    """Whether WELDSIM_DATA, where it is set, points to a folder that holds captured data."""
    name = "captured data"
    if not folder:
        return Check(name=name, ok=True, detail="WELDSIM_DATA is not set: only the tests on captured data need it")
    if (Path(folder) / "real").is_dir():
        return Check(name=name, ok=True, detail=folder)
    return Check(
        name=name,
        ok=False,
        detail=f"WELDSIM_DATA={folder}: no folder 'real' in it",
        remedy="set WELDSIM_DATA to the folder that holds 'real', or unset it",
    )


def _run(program: str) -> subprocess.CompletedProcess[str] | str:
    """The finished process of a Python program, or why it did not finish."""
    try:
        return subprocess.run([sys.executable, "-c", program], capture_output=True, text=True, timeout=IMPORT_TIMEOUT, check=False)
    except subprocess.TimeoutExpired:
        return f"did not finish within {IMPORT_TIMEOUT:g} s"


def _failure_of(program: str) -> str | None:
    """None where the program succeeds, else why not, one line."""
    run = _run(program)
    if isinstance(run, str):
        return run
    if run.returncode < 0:
        return f"killed by signal {-run.returncode}"
    return _last_line(run.stderr) if run.returncode else None


def _last_line(text: str) -> str:
    """The last line that says something: the error itself, in a Python traceback."""
    lines = [line.strip() for line in text.splitlines() if line.strip()]
    return lines[-1] if lines else "failed without a word"
