"""A controller from a profile and a scene, ready to be run."""

from weldsim.arm import Arm as OwnArm
from weldsim.controller.arm import Arm
from weldsim.controller.calibration import Calibration
from weldsim.controller.config import ControllerConfig
from weldsim.controller.machine import Machine
from weldsim.controller.profile import PROFILES, Series
from weldsim.controller.server import Server
from weldsim.scene.cell import new_arm
from weldsim.scene.config import SceneConfig
from weldsim.scene.fitted import fitted_model
from weldsim.scene.quiet import keep_quiet
from weldsim.scene.world import HOME, build_world


def new_machine(series: Series = "cb3", scene: SceneConfig | None = None, config: ControllerConfig | None = None) -> Machine:
    """A controller at rest, powered and with its brakes released; its arm waits where a dry run of the scene has it, else at HOME.

    Args:
        series: which profile.  config: how it behaves.
        scene: what stands on the table; where None the arm is alone, without table and torch, and can do whatever a UR5 can.
    """
    if scene is not None:
        world = build_world(scene)
        model, q = world.model, world.start_joints()
    else:
        keep_quiet()
        spec = new_arm()
        spec.body("wrist_3_link").add_site(name="torch_tip")
        model, q = spec.compile(), HOME
    if config is not None and config.calibration != Calibration():
        model = fitted_model(model, OwnArm(dh=config.calibration.dh))
    profile = PROFILES[series]
    return Machine(profile, Arm(model, q.tolist(), profile), config)


def new_server(
    series: Series = "cb3", scene: SceneConfig | None = None, config: ControllerConfig | None = None, host: str = "127.0.0.1"
) -> Server:
    """That controller on its sockets. Raises InputError where an address or port cannot be had."""
    return Server(new_machine(series, scene, config), host)
