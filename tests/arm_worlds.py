"""Compiled worlds for execution tests: the bare cell, its torch in the air, and the default scene."""

from functools import cache
from typing import Any

from weldsim.scene.cell import new_cell
from weldsim.scene.config import MaterialConfig
from weldsim.scene.tool import add_tool


@cache
def bare_model(tool: bool = True) -> Any:
    """Arm, table and room, with the torch and camera or without; no part."""
    spec = new_cell(MaterialConfig())
    if tool:
        add_tool(spec.body("wrist_3_link"))
    else:
        spec.body("wrist_3_link").add_site(name="torch_tip")
    return spec.compile()
