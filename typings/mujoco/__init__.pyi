"""mujoco's names come from compiled modules without types: everything is `Any` to the type checker."""

from typing import Any

def __getattr__(name: str) -> Any: ...
