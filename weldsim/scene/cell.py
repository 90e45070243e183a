"""The room about the arm: materials, light, floor, table, the Kinect on its mast, and the cameras for pictures."""

import mujoco
import numpy as np

from weldsim.errors import SceneError
from weldsim.mounts import KINECT_V2, X_WB, X_WC_KINECT
from weldsim.scene.config import MaterialConfig
from weldsim.scene.files import asset_path
from weldsim.scene.shapes import Spec, box, camera, look_at, rod

TABLE_TOP = 0.75  # [m] above the floor; B's z = 0
TABLE = np.array([[-0.60, -0.84], [0.60, 0.20]])  # [m] lowest and highest x and y of its top, in B
BASE_GEOM = "base_collision"  # what stands for the arm's base

MATERIALS: dict[str, tuple[tuple[float, float, float], float, float]] = {
    # name: colour, specular, shininess
    "table": ((0.30, 0.31, 0.33), 0.25, 0.35),
    "frame": ((0.20, 0.21, 0.23), 0.2, 0.3),
    "profile": ((0.70, 0.72, 0.74), 0.5, 0.6),
    "steel": ((0.52, 0.53, 0.55), 0.6, 0.6),
    "clamp": ((0.24, 0.25, 0.27), 0.4, 0.5),
    "zinc": ((0.72, 0.71, 0.66), 0.7, 0.7),
    "wedge": ((0.40, 0.33, 0.24), 0.1, 0.1),
    "brass": ((0.72, 0.55, 0.30), 0.7, 0.7),
    "copper": ((0.76, 0.45, 0.30), 0.7, 0.7),
    "rubber": ((0.10, 0.10, 0.11), 0.2, 0.2),
    "bracket": ((0.15, 0.16, 0.19), 0.15, 0.2),
    "d415_aluminium": ((0.74, 0.75, 0.77), 0.6, 0.6),
    "glass": ((0.04, 0.04, 0.06), 0.9, 0.9),
    "lens": ((0.16, 0.14, 0.24), 0.9, 0.9),
    "kinect": ((0.09, 0.09, 0.10), 0.3, 0.4),
    "collision": ((0.9, 0.4, 0.2), 0.0, 0.0),
}


def new_arm() -> Spec:
    """A model of the arm alone, expressed in W: nothing under it, about it or on its flange."""
    # The arm's file is the root rather than attached: attaching without a prefix to its names is warned about.
    spec = mujoco.MjSpec.from_file(str(asset_path("ur5", "ur5.xml")))
    spec.modelname = "weldsim"
    base = spec.body("ur5_base")
    base.pos, base.quat = X_WB.p, X_WB.quaternion
    spec.option.timestep = 0.002
    spec.option.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    return spec


def new_cell(material: MaterialConfig) -> Spec:
    """A model of the room with the bare arm on its table, expressed in W: everything but tool and part."""
    spec = new_arm()
    spec.stat.center, spec.stat.extent = [0.0, 0.3, 0.9], 1.6
    spec.visual.map.znear, spec.visual.map.zfar = 0.005, 30.0
    visual = spec.visual.global_
    visual.offwidth, visual.offheight = 1920, 1440
    spec.visual.quality.shadowsize = 4096
    spec.visual.headlight.ambient = [0.32, 0.32, 0.34]
    spec.visual.headlight.diffuse = [0.22, 0.22, 0.22]
    spec.visual.headlight.specular = [0.05, 0.05, 0.05]
    _add_materials(spec, material)
    _add_lights(spec)
    _add_table(spec)
    _add_kinect(spec)
    look_at(spec.worldbody, "overview", (1.60, 1.60, 1.80), (-0.06, 0.26, 0.98), 40)
    look_at(spec.worldbody, "closeup", (0.55, 0.98, 1.18), (0.0, 0.46, 0.82), 36)
    return spec


def _add_materials(spec: Spec, part: MaterialConfig) -> None:
    for key in ("red", "green", "blue"):
        if not 0 <= getattr(part, key) <= 1:
            raise SceneError(f"material: {key} {getattr(part, key):g} must be 0 to 1", key=key, limit=(0.0, 1.0))
    for name, (rgb, specular, shininess) in MATERIALS.items():
        spec.add_material(name=name, rgba=[*rgb, 1.0], specular=specular, shininess=shininess)
    gloss = {"matte": (0.05, 0.05), "mill_scale": (0.25, 0.3), "ground": (0.7, 0.7), "black": (0.2, 0.3)}[part.finish]
    shade = 0.12 if part.finish == "black" else 1.0
    rgb = np.array([part.red, part.green, part.blue]) * shade
    spec.add_material(name="part", rgba=[*rgb, 1.0], specular=gloss[0], shininess=gloss[1])
    spec.add_material(name="groove", rgba=[*(rgb * 0.92), 1.0], specular=gloss[0], shininess=gloss[1])
    spec.add_texture(
        name="sky",
        type=mujoco.mjtTexture.mjTEXTURE_SKYBOX,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_GRADIENT,
        rgb1=[0.90, 0.93, 0.96],
        rgb2=[0.55, 0.60, 0.66],
        width=256,
        height=256,
    )
    spec.add_texture(
        name="floor",
        type=mujoco.mjtTexture.mjTEXTURE_2D,
        builtin=mujoco.mjtBuiltin.mjBUILTIN_CHECKER,
        mark=mujoco.mjtMark.mjMARK_EDGE,
        rgb1=[0.56, 0.57, 0.58],
        rgb2=[0.53, 0.54, 0.55],
        markrgb=[0.48, 0.49, 0.50],
        width=300,
        height=300,
    )
    _add_hole_grid(spec)
    floor = spec.add_material(name="floor", texrepeat=[1.5, 1.5], texuniform=True, reflectance=0.04, specular=0.1, shininess=0.2)
    floor.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "floor"


def _add_hole_grid(spec: Spec) -> None:
    """The table's material: dark steel with 16 mm holes every 100 mm, drawn, not cut."""
    size, pitch, radius = 128, 0.100, 0.008
    u = (np.arange(size) + 0.5) / size * pitch - pitch / 2
    distance = np.hypot(u[:, None], u[None, :])
    edge = np.clip((distance - radius) / (pitch / size), 0.0, 1.0)  # one pixel of softness
    ring = 1 + 0.25 * np.exp(-(((distance - radius - 0.001) / 0.0007) ** 2))
    colour = np.array(MATERIALS["table"][0])[None, None, :] * (0.15 + 0.85 * edge[..., None]) * ring[..., None]
    texture = spec.add_texture(name="table", type=mujoco.mjtTexture.mjTEXTURE_2D, width=size, height=size, nchannel=3)
    texture.data = (np.clip(colour, 0, 1) * 255).astype(np.uint8).tobytes()
    top = spec.add_material(name="table_top", texrepeat=[2 / pitch, 2 / pitch], texuniform=True, specular=0.25, shininess=0.35)
    top.textures[mujoco.mjtTextureRole.mjTEXROLE_RGB] = "table"


def _add_lights(spec: Spec) -> None:
    directional = mujoco.mjtLightType.mjLIGHT_DIRECTIONAL
    for name, pos, direction, brightness, shadow in (
        ("key", (1.2, 1.6, 3.0), (-0.45, -0.55, -1.1), 0.58, True),
        ("fill", (-1.6, 0.8, 2.6), (0.7, -0.2, -1.0), 0.22, False),
        ("back", (0.0, -1.5, 2.5), (0.0, 0.8, -0.9), 0.15, False),
    ):
        light = spec.worldbody.add_light(name=name, pos=pos, dir=direction, type=directional, castshadow=shadow)
        light.diffuse, light.specular, light.ambient = [brightness] * 3, [brightness * 0.5] * 3, [0.0] * 3


def _add_table(spec: Spec) -> None:
    """A welding table, its top at B's z = 0, and the floor."""
    world = spec.worldbody
    # A view from the side sees all of it, and a cloud that spans 5 m would pass for millimetres.
    floor = world.add_geom(
        name="floor", type=mujoco.mjtGeom.mjGEOM_PLANE, pos=[0.0, 0.32, 0.0], size=[2.2, 2.2, 0.1], contype=1, conaffinity=1
    )
    floor.material = "floor"
    corners = X_WB.points(np.column_stack([TABLE, [-0.04, 0.0]]))
    middle, half = corners.mean(axis=0), np.ptp(corners, axis=0) / 2
    box(world, "table", middle, half, "table_top", collide=True)
    for i, (sx, sy) in enumerate(((-1, -1), (1, -1), (1, 1), (-1, 1))):
        x, y = middle[0] + sx * (half[0] - 0.05), middle[1] + sy * (half[1] - 0.05)
        box(world, f"table_leg_{i}", (x, y, (TABLE_TOP - 0.04) / 2), (0.035, 0.035, (TABLE_TOP - 0.04) / 2), "frame")
    for i, y in enumerate((middle[1] - half[1] + 0.05, middle[1] + half[1] - 0.05)):
        box(world, f"table_rail_{i}", (0.0, y, 0.20), (half[0] - 0.05, 0.02, 0.03), "frame")


def _add_kinect(spec: Spec) -> None:
    """The Kinect v2, 249 x 66 x 67 mm, under a beam whose mast stands beside the table."""
    world, (x, y, z) = spec.worldbody, X_WC_KINECT.p
    mast_x, top = -0.72, z + 0.10
    box(world, "kinect_mast", (mast_x, y, top / 2), (0.0225, 0.0225, top / 2), "profile")
    box(world, "kinect_foot", (mast_x, y, 0.01), (0.14, 0.20, 0.01), "frame")
    box(world, "kinect_beam", ((mast_x + x) / 2, y, top), ((x - mast_x) / 2 + 0.0225, 0.0225, 0.0225), "profile")
    # The depth lens is not in the middle of the housing: about 6 cm to one side of it.
    box(world, "kinect_housing", (x + 0.06, y, z + 0.0345), (0.1245, 0.033, 0.0335), "kinect")
    box(world, "kinect_post", (x, y, z + 0.0725), (0.015, 0.015, 0.0055), "frame")
    for i, (dx, radius) in enumerate(((0.0, 0.010), (-0.03, 0.007), (0.06, 0.012))):
        rod(world, f"kinect_lens_{i}", (x + dx, y, z + 0.001), (x + dx, y, z + 0.0015), radius, "lens")
    camera(world, "kinect", X_WC_KINECT, KINECT_V2)
