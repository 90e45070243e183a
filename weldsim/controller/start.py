"""A controller from a profile and a scene, ready to be run."""

from weldsim.controller.arm import Arm
from weldsim.controller.config import ControllerConfig
from weldsim.controller.machine import Machine
from weldsim.controller.profile import PROFILES, Series
from weldsim.controller.server import Server
from weldsim.scene.cell import new_cell
from weldsim.scene.config import MaterialConfig, SceneConfig
from weldsim.scene.quiet import keep_quiet
from weldsim.scene.tool import add_tool
from weldsim.scene.world import HOME, build_world


def new_machine(series: Series = "cb3", scene: SceneConfig | None = None, config: ControllerConfig | None = None) -> Machine:
    """A controller at rest in HOME, powered and with its brakes released.

    Args:
        series: which profile.  scene: what stands on the table, nothing where None.  config: how it behaves.
    """
    if scene is not None:
        model = build_world(scene).model
    else:
        keep_quiet()
        spec = new_cell(MaterialConfig())
        add_tool(spec.body("wrist_3_link"))
        model = spec.compile()
    profile = PROFILES[series]
    return Machine(profile, Arm(model, HOME.tolist(), profile), config)


def new_server(
    series: Series = "cb3", scene: SceneConfig | None = None, config: ControllerConfig | None = None, host: str = "127.0.0.1"
) -> Server:
    """That controller on its sockets. Raises InputError where an address or port cannot be had."""
    return Server(new_machine(series, scene, config), host)
