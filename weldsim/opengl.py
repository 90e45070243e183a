"""Which rendering back end works here, found by trying it.

MuJoCo chooses its OpenGL platform from MUJOCO_GL when it is imported and fails in many ways when the platform is not
there (missing library, no device, no display). The trial here makes a context and draws on it, so an answer other than
"embree" means that pictures really come out.
"""

import importlib
import os
import subprocess
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal

from weldsim.errors import SensorError

Backend = Literal["egl", "osmesa", "glfw", "embree"]
GlPlatform = Literal["egl", "osmesa", "glfw"]

PATIENCE = 60.0  # [s] for a trial in a process of its own: a busy machine is no missing driver

_OFF = ("disable", "disabled", "off", "false", "0")
_ANY = ("", "enable", "enabled", "on", "true", "1")


def rendering_backend() -> Backend:
    """The back end that `make_renderer(model)` will use: an OpenGL platform that draws, else "embree"."""
    return probe()[0]


def backend_failures() -> dict[str, str]:
    """Why each OpenGL platform that was tried does not draw, one line each; for `doctor`."""
    return dict(probe()[1])


def gl_candidates(environ: dict[str, str]) -> tuple[GlPlatform, ...]:
    """The OpenGL platforms to try, best first: the one MUJOCO_GL names, else those that need no display first.

    Raises:
        SensorError: MUJOCO_GL holds a word that is no platform (MuJoCo itself could not be imported then).
    """
    wish = environ.get("MUJOCO_GL", "").lower().strip()
    if wish in _OFF:
        return ()
    if wish in _ANY:
        if not sys.platform.startswith("linux"):
            return ("glfw",)
        return ("egl", "osmesa", "glfw") if environ.get("DISPLAY") else ("egl", "osmesa")
    known: dict[str, GlPlatform] = {"egl": "egl", "osmesa": "osmesa", "glfw": "glfw", "glx": "glfw", "wgl": "glfw", "cgl": "glfw"}
    if wish not in known:
        raise SensorError(
            f"MUJOCO_GL={wish!r} is no OpenGL platform; use egl, osmesa, glfw or disabled, or unset it",
            backend=wish,
            allowed=["egl", "osmesa", "glfw", "disabled"],
        )
    return (known[wish],)


@lru_cache(maxsize=1)
def probe() -> tuple[Backend, tuple[tuple[str, str], ...]]:
    """The back end that works, and the reason for each that does not. Tried once a process.

    MuJoCo takes the first OpenGL library that a process has loaded, so a platform that failed here would spoil the next:
    with more than one candidate each is tried in a process of its own (0.4 s); name one in MUJOCO_GL to save that.
    """
    candidates = gl_candidates(dict(os.environ))
    attempt = _try_here if len(candidates) == 1 else _try_apart
    failures = []
    for platform in candidates:
        reason = attempt(platform)
        if reason is None:
            return platform, tuple(failures)
        failures.append((platform, reason))
    return "embree", tuple(failures)


def gl_context_class(platform: GlPlatform) -> Callable[[int, int], Any]:
    """MuJoCo's context class of one platform, past the choice that MUJOCO_GL froze when mujoco was imported."""
    if sys.platform.startswith("linux"):
        return importlib.import_module(f"mujoco.{platform}").GLContext
    return importlib.import_module("mujoco.rendering.classic.gl_context").GLContext


def _try_here(platform: GlPlatform) -> str | None:
    """None if the platform draws in this process, else why not."""
    try:
        draw_once(platform)
    except Exception as error:  # drivers fail with ImportError, AttributeError, OSError, RuntimeError, FatalError, GLError
        return " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return None


def _try_apart(platform: GlPlatform) -> str | None:
    """The same in a new process, which may even crash."""
    code = f"from weldsim.opengl import draw_once; draw_once({platform!r})"
    environ = {**os.environ, "PYTHONPATH": os.pathsep.join(filter(None, sys.path))}
    try:
        child = subprocess.run(
            [sys.executable, "-c", code], env=environ, capture_output=True, text=True, timeout=PATIENCE, check=False
        )
    except subprocess.TimeoutExpired:
        return f"gave no answer in {PATIENCE:g} s"
    if child.returncode == 0:
        return None
    lines = child.stderr.strip().splitlines() or [f"ended with code {child.returncode}"]
    return " ".join(lines[-1].split())[:300]


def draw_once(platform: GlPlatform) -> None:
    """Makes a context and a MuJoCo drawing on it. Raises whatever the driver raises."""
    import mujoco  # heavy: a fifth of a second

    model = mujoco.MjModel.from_xml_string("<mujoco><worldbody><geom type='sphere' size='1'/></worldbody></mujoco>")
    context = gl_context_class(platform)(16, 16)
    try:
        context.make_current()
        drawing = mujoco.MjrContext(model, mujoco.mjtFontScale.mjFONTSCALE_50.value)
        drawing.free()
    finally:
        context.free()


def open_renderer(model: Any, height: int, width: int, what: str) -> Any:
    """MuJoCo's own renderer of a model, on the platform that draws here, whatever MUJOCO_GL was when mujoco was imported.

    Args:
        height, width: of the picture [px].  what: is to be drawn, for the error.
    Raises:
        SensorError: no OpenGL platform draws here.
    """
    import mujoco

    platform, failures = probe()
    if platform != "embree":
        chosen: Any = importlib.import_module(mujoco.Renderer.__module__).gl_context
        had = getattr(chosen, "GLContext", None)
        chosen.GLContext = gl_context_class(platform)
        try:
            return mujoco.Renderer(model, height, width)
        except (AttributeError, ImportError, RuntimeError, mujoco.FatalError) as error:  # as its platform likes to fail
            failures = ((platform, " ".join(f"{type(error).__name__}: {error}".split())[:300]),)
        finally:
            chosen.GLContext = had
    reason = "; ".join(f"{name}: {why}" for name, why in failures) or f"MUJOCO_GL is {os.environ.get('MUJOCO_GL', 'unset')}"
    raise SensorError(
        f"{what}: no OpenGL back end ({reason}); `weldsim doctor` says what is missing, or leave it out",
        backend=os.environ.get("MUJOCO_GL", ""),
        reason=reason,
    )
