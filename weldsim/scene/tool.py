"""What hangs on the flange: the torch, the wrist camera and its printed bracket, dimensioned about the mounts."""

from functools import partial
from itertools import pairwise

import numpy as np

from weldsim.frames import Transform
from weldsim.mounts import D415_640X480, PAYLOAD, PAYLOAD_COG, X_FC, X_FT
from weldsim.records import CameraIntrinsics
from weldsim.scene.shapes import Body, Group, box, camera, rod

STICK_OUT = 0.015  # [m] wire beyond the contact tip
GRAVITY_COMPENSATION = 1.0  # share of the tool's weight that the controller knows of (its payload setting)
CORE = 0.9  # of a capsule's radius: the cylinder inside it


def add_tool(flange: Body, intrinsics: CameraIntrinsics = D415_640X480) -> None:
    """Add torch, bracket, D415, the sites and the camera to the flange's body, whose frame is F."""
    tool = flange.add_body(name="tool", gravcomp=GRAVITY_COMPENSATION)
    tool.mass, tool.ipos = PAYLOAD, PAYLOAD_COG
    tool.inertia = [0.0055, 0.0045, 0.0035]
    tool.explicitinertial = True
    _add_torch(tool)
    _add_camera(tool, intrinsics)


def _add_torch(tool: Body) -> None:
    """Nozzle about the wire, a neck that bends away from it, and a clamp on the flange: as on a common air-cooled torch."""
    tip, wire = X_FT.p, X_FT.R[:, 2]

    def along(distance: float) -> np.ndarray:
        """The point of the wire's axis `distance` [m] behind the tip."""
        return tip - distance * wire

    draw_rod, draw_box = partial(rod, tool, group=Group.ROBOT), partial(box, tool, group=Group.ROBOT)
    draw_rod("wire", tip, along(STICK_OUT), 0.0006, "copper")
    draw_rod("contact_tip", along(STICK_OUT), along(STICK_OUT + 0.006), 0.004, "copper")
    draw_rod("nozzle_mouth", along(STICK_OUT + 0.001), along(0.045), 0.0085, "brass")
    draw_rod("nozzle", along(0.030), along(0.085), 0.0105, "brass")
    draw_rod("insulator", along(0.083), along(0.093), 0.0120, "rubber")
    bend = [along(0.090), along(0.112), *np.array([[0.0, -0.033, 0.128], [0.0, -0.030, 0.105], [0.0, -0.026, 0.085]])]
    for i, (a, b) in enumerate(pairwise(bend)):
        draw_rod(f"neck_{i}", a, b, 0.0085, "steel", round_ends=True)
    draw_rod("torch_body", (0.0, -0.026, 0.090), (0.0, -0.020, 0.030), 0.017, "rubber")
    draw_box("torch_clamp", (0.0, -0.020, 0.040), (0.026, 0.024, 0.012), "steel")
    draw_rod("tool_plate", (0.0, 0.0, 0.0), (0.0, 0.0, 0.012), 0.0375, "ur_aluminium")
    draw_box("torch_post", (0.0, -0.008, 0.021), (0.022, 0.020, 0.010), "steel")
    # The nozzle's mouth has a rim and is a cylinder: a capsule's round end would leave it out. The wire alone may touch.
    hit_rod, hit_box = (partial(draw, tool, material="collision", group=Group.COLLISION, collide=True) for draw in (rod, box))
    hit_rod("nozzle_mouth_collision", along(STICK_OUT), along(0.045), 0.0085)
    for name, a, b, radius in (
        ("nozzle_collision", along(STICK_OUT + 0.011), along(0.093), 0.011),
        ("insulator_collision", along(0.085), along(0.091), 0.0122),
        *((f"neck_{i}_collision", a, b, 0.0095) for i, (a, b) in enumerate(pairwise(bend))),
        ("torch_collision", (0.0, -0.024, 0.085), (0.0, -0.018, 0.025), 0.024),
    ):
        hit_rod(name, a, b, radius, round_ends=True)
        # MuJoCo misses one capsule in ten whose axis runs through a thin box; a cylinder inside it does not get lost.
        hit_rod(name.replace("_collision", "_core_collision"), a, b, CORE * radius)
    hit_rod("tool_plate_collision", (0.0, 0.0, 0.0), (0.0, 0.0, 0.012), 0.0375)
    hit_box("torch_clamp_collision", (0.0, -0.020, 0.040), (0.026, 0.024, 0.012))
    hit_box("torch_post_collision", (0.0, -0.008, 0.021), (0.022, 0.020, 0.010))
    tool.add_site(name="torch_tip", pos=X_FT.p, quat=X_FT.quaternion, size=[0.002, 0.002, 0.002], group=4)


def _add_camera(tool: Body, intrinsics: CameraIntrinsics) -> None:
    """The D415's housing, 99 x 20 x 23 mm, its front just behind the optical centre; the bracket carries it from the flange."""
    draw_rod, draw_box = partial(rod, tool, group=Group.ROBOT), partial(box, tool, group=Group.ROBOT)

    def at(x: float, y: float, z: float) -> np.ndarray:
        return X_FC.points(np.array([[x, y, z]]))[0]

    # The left imager is the optical centre; it sits 20 mm from the middle of the housing, which reaches further to image right.
    draw_box("d415_housing", at(0.020, 0.0, -0.0115), (0.0400, 0.0115, 0.0100), "d415_aluminium")
    for i, x in enumerate((-0.020, 0.060)):
        draw_rod(f"d415_end_{i}", at(x, 0, -0.0215), at(x, 0, -0.0015), 0.0115, "d415_aluminium")
    draw_box("d415_window", at(0.020, 0.0, -0.0014), (0.0440, 0.0085, 0.0002), "glass")
    for i, (x, radius) in enumerate(((-0.0175, 0.0035), (0.0, 0.0042), (0.030, 0.0030), (0.055, 0.0042))):
        draw_rod(f"d415_lens_{i}", at(x, 0, -0.0013), at(x, 0, -0.0010), radius, "lens")
    draw_box("d415_back", at(0.020, 0.0, -0.0235), (0.024, 0.009, 0.002), "bracket")
    _bracket(tool, np.array([0.0, -0.030, 0.006]), at(0.020, 0.0, -0.024))
    box(tool, "d415_collision", at(0.020, 0.0, -0.0125), (0.0515, 0.0135, 0.0130), "collision", group=Group.COLLISION, collide=True)
    camera(tool, "d415", X_FC, intrinsics)


def _bracket(tool: Body, start: np.ndarray, end: np.ndarray) -> None:
    """A printed arm: a plate on the flange, out to under the camera, and a post up to its back."""
    foot = np.array([end[0], end[1], start[2]])
    middle, span = (start + foot) / 2, foot - start
    length = float(np.linalg.norm(span))
    arm = Transform("FF", np.column_stack([span / length, np.cross([0, 0, 1.0], span / length), [0, 0, 1.0]]), middle)
    draw_box = partial(box, tool, group=Group.ROBOT)
    geom = draw_box("bracket_arm", arm.p, (length / 2 + 0.008, 0.016, 0.004), "bracket")
    geom.quat = arm.quaternion
    post = (foot + end) / 2, (0.016, 0.004, float(end[2] - foot[2]) / 2 + 0.002)
    draw_box("bracket_post", *post, "bracket")
    hit_box = partial(box, tool, material="collision", group=Group.COLLISION, collide=True)
    geom = hit_box("bracket_collision", arm.p, (length / 2 + 0.008, 0.016, 0.005))
    geom.quat = arm.quaternion
    hit_box("bracket_post_collision", *post)
