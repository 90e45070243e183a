"""Shapes and types of every stage are enforced while the tests run; real data is found through WELDSIM_DATA.

hypothesis draws the same examples in every run, on any machine, however busy; with WELDSIM_FUZZ set, new ones in each.
"""

import os
from pathlib import Path

import pytest
from hypothesis import HealthCheck, settings
from jaxtyping import install_import_hook

import tests.typecheck  # noqa: F401 - the hook finds it by name

os.environ.setdefault("MUJOCO_GL", "egl")
_hook = install_import_hook("weldsim", "tests.typecheck.typecheck")

settings.register_profile(
    "weldsim",
    derandomize="WELDSIM_FUZZ" not in os.environ,
    database=None,
    deadline=None,
    suppress_health_check=[HealthCheck.too_slow, HealthCheck.function_scoped_fixture],
)
settings.load_profile("weldsim")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of captured data; tests that need it are skipped, saying so, where WELDSIM_DATA is unset."""
    folder = os.environ.get("WELDSIM_DATA")
    if not folder:
        pytest.skip("WELDSIM_DATA is not set: captured data is not part of the project")
    return Path(folder) / "real"
