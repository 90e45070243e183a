"""Which rendering back end works here, found by trying it.

MuJoCo chooses its OpenGL platform from MUJOCO_GL when it is imported and fails in many ways when the platform is not
there (missing library, no device, no display). The trial here makes a context and draws on it, so an answer other than
"embree" means that pictures really come out.
"""

import importlib
import os
import sys
from collections.abc import Callable
from functools import lru_cache
from typing import Any, Literal

from weldsim.errors import SensorError

Backend = Literal["egl", "osmesa", "glfw", "embree"]
GlPlatform = Literal["egl", "osmesa", "glfw"]

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
    """The back end that works, and the reason for each that does not. Tried once a process."""
    failures = []
    for platform in gl_candidates(dict(os.environ)):
        reason = _try_platform(platform)
        if reason is None:
            return platform, tuple(failures)
        failures.append((platform, reason))
    return "embree", tuple(failures)


def gl_context_class(platform: GlPlatform) -> Callable[[int, int], Any]:
    """MuJoCo's context class of one platform, past the choice that MUJOCO_GL froze when mujoco was imported."""
    if sys.platform.startswith("linux"):
        return importlib.import_module(f"mujoco.{platform}").GLContext
    return importlib.import_module("mujoco.rendering.classic.gl_context").GLContext


def _try_platform(platform: GlPlatform) -> str | None:
    """None if the platform draws, else why not."""
    had_platform = "PYOPENGL_PLATFORM" in os.environ
    try:
        _draw_once(platform)
    except Exception as error:  # drivers fail with ImportError, AttributeError, OSError, RuntimeError, FatalError, GLError
        if not had_platform:
            _forget_pyopengl()
        return " ".join(f"{type(error).__name__}: {error}".split())[:300]
    return None


def _draw_once(platform: GlPlatform) -> None:
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


def _forget_pyopengl() -> None:
    """Undoes the platform choice PyOpenGL made at import, so that the next platform can be tried in this process."""
    os.environ.pop("PYOPENGL_PLATFORM", None)
    for name in list(sys.modules):
        if name.split(".")[0] == "OpenGL" or name in ("mujoco.egl", "mujoco.egl.egl_ext", "mujoco.osmesa"):
            del sys.modules[name]
