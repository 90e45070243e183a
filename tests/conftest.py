"""Shapes and types of every stage are enforced while the tests run; real data is found through WELDSIM_DATA."""

import os
from pathlib import Path

import pytest
from jaxtyping import install_import_hook

import tests.typecheck  # noqa: F401 - the hook finds it by name

os.environ.setdefault("MUJOCO_GL", "egl")
_hook = install_import_hook("weldsim", "tests.typecheck.typecheck")


@pytest.fixture(scope="session")
def real_data() -> Path:
    """The folder of captured data; tests that need it are skipped, saying so, where WELDSIM_DATA is unset."""
    folder = os.environ.get("WELDSIM_DATA")
    if not folder:
        pytest.skip("WELDSIM_DATA is not set: captured data is not part of the project")
    return Path(folder) / "real"
