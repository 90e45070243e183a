"""The compiled cell: parts lie where they should, cameras project as they say, every scene can be scanned and welded."""

from pathlib import Path

import mujoco
import numpy as np
import pytest

from weldsim.config import load_toml, structure
from weldsim.errors import ConfigError, SceneError, UnreachableError
from weldsim.frames import Transform
from weldsim.kinematics import inverse
from weldsim.mounts import KINECT_V2, X_FT, X_WC_KINECT
from weldsim.records import CameraIntrinsics
from weldsim.scene.config import FixtureConfig, GrooveConfig, MaterialConfig, PartPoseConfig, SceneConfig, ViewConfig
from weldsim.scene.files import asset_path, scene_names, scene_path
from weldsim.scene.variations import VariationConfig, vary
from weldsim.scene.workpieces.centre_line import CentreLineConfig
from weldsim.scene.world import World, build_world

CURVE = SceneConfig(name="curve", centre_line=CentreLineConfig(shape="s"))


@pytest.fixture(scope="module")
def tilted() -> World:
    pose = PartPoseConfig(x=0.02, y=-0.46, yaw=0.4, tilt=0.2, tilt_heading=1.0)
    return build_world(SceneConfig(centre_line=CentreLineConfig(shape="s"), pose=pose))


def geom_vertices(model: mujoco.MjModel, data: mujoco.MjData, name: str) -> np.ndarray:
    geom = model.geom(name).id
    mesh = model.geom_dataid[geom]
    start, count = model.mesh_vertadr[mesh], model.mesh_vertnum[mesh]
    return model.mesh_vert[start : start + count] @ data.geom_xmat[geom].reshape(3, 3).T + data.geom_xpos[geom]


def test_meshes_lie_where_the_part_lies(tilted: World) -> None:
    """MuJoCo moves a mesh to its own inertial frame; the geom's pose must undo that."""
    data = tilted.new_data()
    mesh = tilted.workpiece.build_mesh()
    for name, groove in (("groove", True), ("part", False)):
        vertices, _ = mesh.part(groove=groove)
        expected = (tilted.X_WB @ tilted.X_BP).points(vertices)
        found = geom_vertices(tilted.model, data, name)
        assert np.abs(found[np.lexsort(found.round(6).T)] - expected[np.lexsort(expected.round(6).T)]).max() < 5e-7


def test_part_rests_on_the_table(tilted: World) -> None:
    lowest = tilted.X_BP.points(tilted.workpiece.base_corners)[:, 2].min()
    assert lowest == pytest.approx(0.0, abs=1e-12)
    table = tilted.model.geom("table")
    assert table.pos[2] + table.size[2] == pytest.approx(tilted.X_WB.p[2], abs=1e-12)


def test_rays_hit_the_groove_where_the_seam_says(tilted: World) -> None:
    """The root seen by a ray cast along the bisector, and the parent surface just outside the lips."""
    data, seam = tilted.new_data(), tilted.known_seams[0]
    visual, geom = np.array([1, 1, 1, 0, 0, 0], np.uint8), np.zeros(1, np.int32)
    for i in range(20, len(seam.s) - 20, 23):
        across = (seam.left_B[i] - seam.right_B[i]) / np.linalg.norm(seam.left_B[i] - seam.right_B[i])
        for offset, depth, label in (
            (1e-5, 0.008, "groove"),
            (0.0069, None, "groove"),
            (0.0071, 0.0, "part"),
            (-0.0071, 0.0, "part"),
        ):
            start = tilted.X_WB.points((seam.opening_B[i] + offset * across - 0.05 * seam.bisectors_B[i])[None])[0]
            ray = tilted.X_WB.R @ seam.bisectors_B[i]
            distance = mujoco.mj_ray(tilted.model, data, start, ray, visual, 1, -1, geom, None)
            assert tilted.labels[int(geom[0])] == label
            if depth is not None:
                assert distance == pytest.approx(0.05 + depth, abs=2e-5)


def test_every_geom_has_one_label(tilted: World) -> None:
    assert set(tilted.labels) == set(range(tilted.model.ngeom))
    assert len(tilted.geoms("groove")) == 1
    for label in ("part", "clamp", "table", "robot", "room"):
        assert len(tilted.geoms(label))  # type: ignore[arg-type]
    plain = build_world(SceneConfig(workpiece="plain_plate"))
    assert len(plain.geoms("groove")) == 0
    assert plain.known_seams == ()


def test_visual_meshes_never_collide(tilted: World) -> None:
    meshes = tilted.model.geom_type == mujoco.mjtGeom.mjGEOM_MESH
    assert meshes.any()
    assert not tilted.model.geom_contype[meshes].any()
    assert not tilted.model.geom_conaffinity[meshes].any()


@pytest.mark.render
@pytest.mark.parametrize("intrinsics", [None, CameraIntrinsics(width=320, height=240, fx=300, fy=310, cx=170.5, cy=101.25)])
def test_rendered_seam_is_where_the_intrinsics_project_it(intrinsics: CameraIntrinsics | None) -> None:
    """Pins the sign of MuJoCo's principal point and the optical frame, by the centroid of the groove's pixels."""
    world = build_world(CURVE) if intrinsics is None else build_world(CURVE, intrinsics)
    K = world.intrinsics
    data = world.new_data(world.view_joints())
    renderer = mujoco.Renderer(world.model, K.height, K.width)
    renderer.enable_segmentation_rendering()
    renderer.update_scene(data, "d415")
    rows, columns = np.nonzero(np.isin(renderer.render()[..., 0], world.geoms("groove")))
    renderer.close()
    seam, X_CB = world.known_seams[0], world.views[0].inverse()
    pixels = []
    for line in (seam.left_B, seam.right_B):
        points = X_CB.points(line)
        pixels.append(points[:, :2] / points[:, 2:] * [K.fx, K.fy] + [K.cx, K.cy])
    expected = np.vstack(pixels)
    assert len(rows) > 500
    assert abs(columns.mean() + 0.5 - expected[:, 0].mean()) < 0.5
    assert abs(rows.mean() + 0.5 - expected[:, 1].mean()) < 0.5
    # The crests of the S, away from the plate's edges where one lip outruns the other.
    assert abs(rows.min() - expected[:, 1].min()) < 1.5
    assert abs(rows.max() + 1 - expected[:, 1].max()) < 1.5


def test_kinect_sees_the_part() -> None:
    world = build_world(SceneConfig())
    corners = (X_WC_KINECT.inverse() @ world.X_WB @ world.X_BP).points(world.workpiece.base_corners)
    pixels = corners[:, :2] / corners[:, 2:] * [KINECT_V2.fx, KINECT_V2.fy] + [KINECT_V2.cx, KINECT_V2.cy]
    assert (pixels > 0).all()
    assert (pixels < [KINECT_V2.width, KINECT_V2.height]).all()


@pytest.mark.parametrize("name", scene_names())
def test_scene_files_build(name: str) -> None:
    config = structure(load_toml(scene_path(name)), SceneConfig, where=name)
    assert config.name == name
    world = build_world(config)
    for view in range(len(world.views)):
        q = world.view_joints(view)
        assert np.abs(world.site_pose(world.new_data(q), "flange").p).max() < 1.0
    assert (len(world.known_seams) > 0) == (config.workpiece != "plain_plate")


def weldable(world: World, step: int) -> bool:
    """Whether every `step`-th point of each seam has a joint solution with the wire along the bisector, for some turn about it."""
    points = [(seam, i) for seam in world.known_seams for i in range(0, len(seam.s), step)]
    for seam, i in points:
        z, x0 = seam.bisectors_B[i], seam.tangents_B[i]
        turns = [np.cos(a) * x0 + np.sin(a) * np.cross(z, x0) for a in np.radians([0, 90, 180, 270])]
        poses = [Transform("BT", np.column_stack([x, np.cross(z, x), z]), seam.opening_B[i]) for x in turns]
        if not any(len(inverse(pose @ X_FT.inverse())) for pose in poses):
            return False
    return True


@pytest.mark.parametrize("name", ["straight", "curve", "cylinder", "cuboid", "y", "y_branches"])
def test_whole_seam_is_in_reach(name: str) -> None:
    assert weldable(build_world(structure(load_toml(scene_path(name)), SceneConfig)), step=10)


@pytest.mark.parametrize("seed", range(12))
def test_varied_scenes_can_be_scanned_and_welded(seed: int) -> None:
    model = SceneConfig(
        name="curve" if seed % 2 else "straight", centre_line=CentreLineConfig(shape="s" if seed % 2 else "straight")
    )
    config = vary(model, seed)
    assert config == vary(model, seed)
    assert config != vary(model, seed + 1)
    limits = VariationConfig()
    assert limits.width_low <= config.groove.width <= limits.width_high
    assert abs(config.pose.yaw) <= limits.yaw
    assert 0 <= config.pose.tilt <= limits.tilt
    world = build_world(config)
    world.view_joints()
    assert weldable(world, step=40)
    K, seam, X_CB = world.intrinsics, world.known_seams[0], world.views[0].inverse()
    points = X_CB.points(np.vstack([seam.left_B, seam.right_B]))
    pixels = points[:, :2] / points[:, 2:] * [K.fx, K.fy] + [K.cx, K.cy]
    assert (pixels > 20).all()
    assert (pixels < [K.width - 20, K.height - 20]).all()


@pytest.mark.parametrize(("tilt", "heading", "roll"), [(0.0, 0.0, 0.0), (0.3, 0.5, 1.0), (0.2, -2.0, 0.0)])
def test_view_looks_at_the_part_from_its_standoff(tilt: float, heading: float, roll: float) -> None:
    X_PC = ViewConfig(standoff=0.37, tilt=tilt, heading=heading, roll=roll, shift_x=0.01).pose_in_part()
    assert np.linalg.norm(X_PC.p - [0.01, 0, 0]) == pytest.approx(0.37)
    assert np.allclose(X_PC.p + 0.37 * X_PC.R[:, 2], [0.01, 0, 0])
    assert np.arccos(-X_PC.R[2, 2]) == pytest.approx(tilt, abs=1e-7)
    if tilt:
        lean = X_PC.p[:2] - [0.01, 0]
        assert np.arctan2(lean[1], lean[0]) == pytest.approx(heading)


def test_view_can_be_an_explicit_pose() -> None:
    table = {"views": [{"camera_in_base": {"x": "0 mm", "y": "-450 mm", "z": "420 mm", "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]}}]}
    world = build_world(structure(table, SceneConfig))
    assert np.allclose(world.views[0].p, [0.0, -0.45, 0.42])
    assert np.allclose(world.views[0].R, np.diag([1.0, -1.0, -1.0]))


def test_bad_scenes_are_refused(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match="straight"):
        scene_path("strait")
    with pytest.raises(SceneError, match="no such file"):
        scene_path(tmp_path / "mine.toml")
    with pytest.raises(SceneError, match="not found"):
        asset_path("ur5", "ur6.xml")
    with pytest.raises(ConfigError, match="widht"):
        structure({"groove": {"widht": "14 mm"}}, SceneConfig)
    with pytest.raises(SceneError, match="tilt"):
        build_world(SceneConfig(pose=PartPoseConfig(tilt=1.2)))
    with pytest.raises(SceneError, match="sink"):
        build_world(SceneConfig(pose=PartPoseConfig(clearance=-0.01)))
    with pytest.raises(SceneError, match="overlap"):
        build_world(SceneConfig(fixture=FixtureConfig(overlap=0.2)))
    with pytest.raises(SceneError, match="bolts"):
        build_world(SceneConfig(fixture=FixtureConfig(bolts=9)))
    many = FixtureConfig()
    object.__setattr__(many, "clamps", 6)  # types are checked here and nowhere else
    with pytest.raises(SceneError, match="clamps = 6: must be one of 0, 2, 4"):
        build_world(SceneConfig(fixture=many))
    with pytest.raises(SceneError, match="standoff"):
        build_world(SceneConfig(views=(ViewConfig(standoff=0.0),)))
    with pytest.raises(SceneError, match="no scan view"):
        build_world(SceneConfig(views=()))
    with pytest.raises(SceneError, match="red"):
        build_world(SceneConfig(material=MaterialConfig(red=200.0)))
    with pytest.raises(UnreachableError, match="scan view 1"):
        build_world(SceneConfig(views=(ViewConfig(standoff=1.2),))).view_joints()
    with pytest.raises(SceneError, match="beyond the table's edge"):
        build_world(SceneConfig(pose=PartPoseConfig(y=-1.4)))


def test_user_scene_file_is_found(tmp_path: Path) -> None:
    path = tmp_path / "mine.toml"
    path.write_text('name = "mine"\n[groove]\nwidth = "10 mm"\ndepth = "6 mm"\nangle = "50 deg"\n')
    config = structure(load_toml(scene_path(path)), SceneConfig, where=str(path))
    assert config.groove == GrooveConfig(width=0.010, depth=0.006, angle=float(np.radians(50.0)))
    assert build_world(config).known_seams[0].name == "groove plate"
