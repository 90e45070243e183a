"""A small MuJoCo scene for sensor tests: a grooved plate on a table, a clamp, and an arm of one joint with a camera."""

import mujoco
import numpy as np
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.mounts import X_WB
from weldsim.sensor.base import Label
from weldsim.sensor.exact import TwinScene

PLATE_TOP = 0.77  # [m] above the floor of the world
CENTRE_W = np.array([0.02, 0.45, PLATE_TOP])
_NAMES = {
    "floor": Label.ROOM,
    "table": Label.TABLE,
    "plate": Label.PART,
    "groove": Label.GROOVE,
    "clamp": Label.CLAMP,
    "bolt": Label.CLAMP,
    "pin": Label.CLAMP,
    "stud": Label.CLAMP,
    "arm": Label.ROBOT,
    "ghost": Label.ROOM,
}
_SCENE = """
<mujoco>
  <compiler angle="radian"/>
  <visual><global offwidth="640" offheight="480"/></visual>
  <asset>
    <mesh name="plate" inertia="shell" vertex="{plate_vertices}" face="{plate_faces}"/>
    <mesh name="groove" inertia="shell" vertex="{groove_vertices}" face="{groove_faces}"/>
  </asset>
  <worldbody>
    <light pos="0.5 0.2 2" dir="-0.2 0.1 -1"/>
    <geom name="floor" type="plane" size="0.9 0.9 0.1" pos="0 0.4 0" rgba="0.3 0.3 0.32 1"/>
    <geom name="table" type="box" size="0.5 0.4 0.02" pos="0 0.4 0.73" rgba="0.55 0.45 0.35 1"/>
    <geom name="plate" type="mesh" mesh="plate" pos="0.02 0.45 0.77" euler="0 0 0.2" rgba="0.6 0.6 0.65 1"/>
    <geom name="groove" type="mesh" mesh="groove" pos="0.02 0.45 0.77" euler="0 0 0.2" rgba="0.5 0.5 0.6 1"/>
    <geom name="clamp" type="box" size="0.015 0.03 0.01" pos="0.11 0.45 0.78" euler="0 0 0.3" rgba="0.8 0.2 0.2 1"/>
    <geom name="bolt" type="cylinder" size="0.008 0.006" pos="-0.06 0.40 0.776" rgba="0.2 0.2 0.2 1"/>
    <geom name="pin" type="capsule" size="0.006 0.01" pos="-0.06 0.50 0.78" rgba="0.2 0.6 0.2 1"/>
    <geom name="stud" type="ellipsoid" size="0.012 0.008 0.006" pos="0.08 0.53 0.77" rgba="0.2 0.2 0.7 1"/>
    <geom name="ghost" type="box" size="0.5 0.5 0.01" pos="0 0.4 1.0" group="3"/>
    <site name="mark" type="box" size="0.05 0.05 0.002" pos="0.02 0.45 0.80"/>
    <body name="arm" pos="-0.60 0.45 1.20">
      <joint name="shoulder" type="hinge" axis="0 1 0" range="-2 2"/>
      <geom name="arm" type="capsule" fromto="0 0 0 0.25 0 0" size="0.02"/>
      <camera name="wrist" pos="0.60 0 0"/>
    </body>
  </worldbody>
</mujoco>
"""


def grooved_scene() -> TwinScene:
    """The scene at its rest pose, kinematics done."""
    plate, groove = _grooved_plate(half_length=0.09, half_width=0.07, thickness=0.02, lip=0.007, depth=0.008)
    model = mujoco.MjModel.from_xml_string(
        _SCENE.format(
            plate_vertices=_text(plate[0]),
            plate_faces=_text(plate[1]),
            groove_vertices=_text(groove[0]),
            groove_faces=_text(groove[1]),
        )
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    labels = np.array([_NAMES[model.geom(i).name] for i in range(model.ngeom)], np.uint8)
    return TwinScene(model=model, data=data, X_WB=X_WB, labels=labels)


def camera_above(seed: int, *, tilt: float = 0.3) -> Transform:
    """X_WC: a camera 0.35 to 0.5 m from the plate's middle, tilted up to `tilt` rad and turned any way, from `seed`."""
    rng = np.random.default_rng(seed)
    down = Transform("WC", np.diag([1.0, -1.0, -1.0]), np.zeros(3))
    turn = np.append(rng.uniform(-tilt, tilt, 2), rng.uniform(-np.pi, np.pi)) * [1, 1, 1]
    spin = Transform.from_rotation_vector("CC", np.array([0, 0, turn[2]]), np.zeros(3))
    lean = Transform.from_rotation_vector("CC", np.array([turn[0], turn[1], 0]), np.zeros(3))
    R = (down @ lean @ spin).R
    target = CENTRE_W + rng.uniform(-0.02, 0.02, 3) * [1, 1, 0]
    return Transform("WC", R, target - rng.uniform(0.35, 0.5) * R[:, 2])


def _grooved_plate(*, half_length: float, half_width: float, thickness: float, lip: float, depth: float) -> tuple[tuple, tuple]:
    """Vertices and outward faces of the plate's outside and of its V groove along y, top face at z = 0."""
    section = [(-half_length, 0), (-half_length, -thickness), (half_length, -thickness), (half_length, 0), (lip, 0), (-lip, 0)]
    section = np.array(section, float)
    n = len(section)
    vertices = np.concatenate([np.column_stack([section[:, 0], np.full(n, y), section[:, 1]]) for y in (-half_width, half_width)])
    sides = [(k, (k + 1) % n) for k in range(n) if k != n - 2]  # the side from lip to lip is the groove's mouth
    quads = [(b, a, a + n, b + n) for a, b in sides]
    faces = [face for a, b, c, d in quads for face in ((a, b, c), (a, c, d))]
    walls = np.array([(x, y, z) for y in (-half_width, half_width) for x, z in ((-lip, 0), (0, -depth), (lip, 0))], float)
    walls_faces = np.array([(0, 1, 4), (0, 4, 3), (1, 2, 5), (1, 5, 4)])
    return (vertices, np.array(faces)), (walls, walls_faces)


def _text(array: ndarray) -> str:
    return " ".join(f"{value:.9g}" for value in np.asarray(array, float).ravel())
