"""Cylinder, cuboid and Y: closed solids, their closed-form seams against the mesh itself, and where the thesis had them."""

import json
from pathlib import Path

import numpy as np
import pytest
from hypothesis import given, settings
from hypothesis import strategies as st

from weldsim.config import load_toml, structure
from weldsim.curves import project
from weldsim.errors import ConfigError, SceneError
from weldsim.frames import unit
from weldsim.scene.config import SceneConfig
from weldsim.scene.files import scene_path
from weldsim.scene.workpieces.base import LabelledMesh, SeamCurve, Workpiece
from weldsim.scene.workpieces.branches import BranchesConfig, make_branched_plate
from weldsim.scene.workpieces.centre_line import CentreLineConfig
from weldsim.scene.workpieces.cuboid import CuboidConfig, make_cuboid
from weldsim.scene.workpieces.cylinder import CylinderConfig, make_cylinder
from weldsim.scene.workpieces.groove import GrooveConfig
from weldsim.scene.workpieces.plate import PlateConfig, make_groove_plate
from weldsim.scene.workpieces.triangles import distance_to_faces, ray_lengths
from weldsim.scene.world import build_world

MM = 1e-3
KINDS = ("plate", "cylinder", "cuboid", "y", "y_branches")


def groove(rng: np.random.Generator, *, level: bool = False) -> GrooveConfig:
    """A groove 5 to 25 mm wide and 3 to 14 mm deep: V or flat-bottomed, sides level or not, through the edges or not."""
    width, depth = rng.uniform(5, 25) * MM, rng.uniform(3, 14) * MM
    return GrooveConfig(
        width=width,
        depth=depth,
        root_gap=width * rng.uniform(0, 0.6) if rng.integers(2) else None,
        misalignment=0.0 if level or rng.integers(2) else depth * rng.uniform(0.05, 0.5),
        margin=rng.uniform(5, 20) * MM if rng.integers(2) else 0.0,
    )


def part(kind: str, seed: int) -> Workpiece:
    rng = np.random.default_rng([seed, KINDS.index(kind)])
    if kind == "plate":
        plate = PlateConfig(rng.uniform(180, 300) * MM, rng.uniform(180, 250) * MM, rng.uniform(16, 30) * MM)
        line = CentreLineConfig(shape=("straight", "arc", "s")[rng.integers(3)], radius=0.2)  # type: ignore[arg-type]
        return make_groove_plate(plate, groove(rng), line)
    if kind == "cylinder":
        shell = CylinderConfig(
            radius=rng.uniform(80, 500) * MM,
            thickness=rng.uniform(15, 30) * MM,
            length=rng.uniform(60, 300) * MM,
            span=np.radians(rng.uniform(50, 150)),
        )
        return make_cylinder(shell, groove(rng))
    if kind == "cuboid":
        body = CuboidConfig(rng.uniform(80, 450) * MM, rng.uniform(60, 250) * MM, rng.uniform(80, 350) * MM)
        return make_cuboid(body, groove(rng))
    plate = PlateConfig(rng.uniform(220, 300) * MM, rng.uniform(200, 250) * MM, rng.uniform(16, 30) * MM)
    if kind == "y":
        return make_branched_plate(plate, groove(rng), BranchesConfig(branches=1))
    shape = BranchesConfig(3, rng.uniform(-20, 20) * MM, np.radians(rng.uniform(60, 150)))
    return make_branched_plate(plate, groove(rng, level=True), shape)


CASES = [(kind, seed) for kind in KINDS for seed in range(5)]


def surface_distance(labelled: LabelledMesh, groove_faces: bool, points: np.ndarray) -> np.ndarray:
    """Distance [m] of points from the groove's faces, or from all others."""
    return distance_to_faces(*labelled.part(groove=groove_faces), points)


def inner(curve: SeamCurve, kind: str, width: float) -> np.ndarray:
    """Samples whose lips no edge of the part and no neighbouring branch cuts off."""
    reach = {"cuboid": 0.5 * MM, "cylinder": 0.5 * MM, "y": 0.5 * MM}.get(kind, 1.2 * width)
    samples = np.flatnonzero((curve.s > reach) & (curve.s < curve.s[-1] - reach))
    return samples[:: max(1, len(samples) // 40)]


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_solid_is_closed_small_and_labelled(kind: str, seed: int) -> None:
    labelled = part(kind, seed).build_mesh()
    mesh = labelled.to_trimesh()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert len(mesh.faces) < 200_000
    assert 0 < labelled.groove.sum() < len(mesh.faces)


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_lips_lie_where_groove_and_parent_meet_and_the_root_on_the_bottom(kind: str, seed: int) -> None:
    piece = part(kind, seed)
    labelled, section = piece.build_mesh(), piece.section  # type: ignore[attr-defined]
    for curve in piece.seam_curves():
        inside = inner(curve, kind, section.width)
        for line in (curve.left, curve.right):
            assert surface_distance(labelled, True, line[inside]).max() < 5e-6
            assert surface_distance(labelled, False, line[inside]).max() < 5e-6
        assert surface_distance(labelled, True, curve.root[inside]).max() < 5e-6
        # Nothing of the part lies above the root: a ray along the bisector, a little aside of edges, meets the bottom.
        above = curve.opening[inside] - 0.02 * curve.bisectors[inside] + 1e-6
        ray = ray_lengths(labelled.vertices, labelled.faces, above, curve.bisectors[inside])
        deep = section.depth - section.opening_depth
        straight_below = np.linalg.norm(curve.root - curve.opening, axis=1)[inside] < deep + 1e-9
        assert np.abs(ray - 0.02 - deep)[straight_below].max() < 1e-5


@pytest.mark.parametrize(("kind", "seed"), CASES)
def test_seam_is_consistent_with_itself(kind: str, seed: int) -> None:
    piece = part(kind, seed)
    section = piece.section  # type: ignore[attr-defined]
    for curve in piece.seam_curves():
        # Over the cuboid's edge the lips of sides that are not level turn at different heights.
        turning = near_turns(curve, section.misalignment / 2) if kind == "cuboid" else np.zeros(len(curve.s), bool)
        assert np.abs((curve.left + curve.right) / 2 - curve.opening)[~turning].max() < 1e-9
        assert np.abs(np.einsum("ij,ij->i", curve.tangents, curve.bisectors)).max() < 1e-9
        assert np.allclose(np.linalg.norm(curve.tangents, axis=1), 1)
        assert np.allclose(curve.normals, -curve.bisectors)
        chord = np.diff(curve.opening, axis=0)
        assert (np.diff(curve.s) > 0).all()
        assert np.diff(curve.s).max() <= 0.5 * MM + 1e-9
        # Arc length and tangents against differences, but where the cuboid turns over its edge in one sample.
        turn = np.einsum("ij,ij->i", curve.tangents[1:], curve.tangents[:-1]) < 0.9
        assert turn.sum() == (4 if kind == "cuboid" else 0)
        assert np.allclose(np.linalg.norm(chord, axis=1), np.diff(curve.s), rtol=2e-5)
        middle = unit(curve.tangents[1:] + curve.tangents[:-1])
        assert np.abs(unit(chord) - middle)[~turn].max() < 2e-5
        across = curve.left - curve.right
        assert (np.einsum("ij,ij->i", np.cross(curve.normals, curve.tangents), across) > 0).all()
        lower = np.einsum("ij,ij->i", across, curve.normals)
        assert np.allclose(lower[~turning], -section.misalignment)
        assert np.allclose(np.linalg.norm(across[~turning], axis=1), np.hypot(section.width, section.misalignment))


def near_turns(curve: SeamCurve, reach: float) -> np.ndarray:
    """Whether each sample of a cuboid's seam is within `reach` [m] of where it turns over an edge."""
    corners = np.flatnonzero(np.abs(np.abs(curve.tangents[:, 0] * curve.tangents[:, 2]) - 0.5) < 1e-9)
    assert len(corners) == 2
    return (np.abs(curve.s[:, None] - curve.s[corners]) <= reach + 1e-9).any(axis=1)


@pytest.mark.parametrize("low", [0.0, 2 * MM])
def test_cuboid_turns_over_its_edges_as_its_docstring_says(low: float) -> None:
    piece = make_cuboid(CuboidConfig(), GrooveConfig(misalignment=low))
    (curve,) = piece.seam_curves()
    (first, last) = np.flatnonzero(np.abs(np.abs(curve.tangents[:, 0] * curve.tangents[:, 2]) - 0.5) < 1e-9)
    for i, side in ((first, -1), (last, 1)):
        edge = np.array([side * 0.21, 0.0, 0.0])
        inwards = np.array([-side, 0.0, -1.0])
        assert np.allclose(curve.opening[i], edge + low / 2 * inwards)
        assert np.allclose(curve.right[i], edge - [0, 0.007, 0])
        assert np.allclose(curve.left[i], edge + [0, 0.007, 0] + low * inwards)
        assert np.allclose(curve.root[i], edge + 0.008 * inwards)
        assert np.allclose(curve.bisectors[i], unit(inwards))
        near = np.flatnonzero(np.abs(curve.s - curve.s[i]) < 0.0075 - low / 2)
        assert np.allclose(curve.root[near], curve.root[i])  # nothing of the groove lies straight below them
    assert np.allclose(curve.tangents[first - 1], [0, 0, 1])
    assert np.allclose(curve.tangents[first + 1], [1, 0, 0])
    assert np.allclose(curve.tangents[last + 1], [0, 0, -1])
    assert curve.s[-1] == pytest.approx(2 * 0.33 + 0.42 - 2 * low)


def test_branches_meet_at_the_junction() -> None:
    piece = make_branched_plate(PlateConfig(), GrooveConfig(), BranchesConfig(junction=0.01))
    stem, left, right = piece.seam_curves()
    for line in (stem.opening[-1], left.opening[0], right.opening[0]):
        assert np.allclose(line, [0.01, 0, 0])
    assert left.opening[-1, 1] > 0 > right.opening[-1, 1]
    assert stem.opening[0, 0] == pytest.approx(-0.12)


@pytest.mark.parametrize(
    ("scene", "table"),
    [("cylinder", "cylinder_path_6_4"), ("cuboid", "cuboid_path_6_6"), ("y", "y_path_6_8"), ("y_branches", "y_path_6_8")],
)
def test_seams_pass_through_the_thesis_true_points(scene: str, table: str, real_data: Path) -> None:
    """Within 4.5 mm, all of them; a point's foot is on the seam and not at its end."""
    points = np.array(json.loads((real_data.parent / "thesis_tables.json").read_text())[table]["true"])
    world = build_world(structure(load_toml(scene_path(scene)), SceneConfig, where=scene))
    seam = world.known_seams[0]
    distance, _, s = project(points, seam.opening_B)
    assert distance.max() <= 4.5 * MM
    assert s.min() >= 0
    assert s.max() < seam.length


@settings(max_examples=40)
@given(
    kind=st.sampled_from(("cylinder", "cuboid", "y")),
    sizes=st.lists(st.floats(-0.1, 2.5), min_size=4, max_size=4),
    width=st.floats(-0.01, 0.3),
    depth=st.floats(-0.01, 0.3),
    step=st.floats(-0.01, 0.1),
    margin=st.floats(-0.01, 0.3),
)
def test_any_dimensions_make_a_closed_solid_or_one_line_of_error(
    kind: str, sizes: list[float], width: float, depth: float, step: float, margin: float
) -> None:
    try:
        cut = GrooveConfig(width=width, depth=depth, misalignment=step, margin=margin)
        if kind == "cylinder":
            piece = make_cylinder(CylinderConfig(*sizes), cut)
        elif kind == "cuboid":
            piece = make_cuboid(CuboidConfig(*sizes[:3]), cut)
        else:
            piece = make_branched_plate(PlateConfig(*sizes[:3]), cut, BranchesConfig(junction=sizes[3]))
    except (SceneError, ConfigError) as error:
        refused = error
    else:
        refused = None
    if refused is not None:
        assert "\n" not in str(refused)
        assert refused.exit_code == 2
        return
    mesh = piece.build_mesh().to_trimesh()
    assert mesh.is_watertight
    assert mesh.volume > 0
    assert len(mesh.faces) < 200_000


@pytest.mark.parametrize(
    ("message", "build"),
    [
        ("wider than the cylinder", lambda: make_cylinder(CylinderConfig(length=0.1), GrooveConfig(width=0.12))),
        ("through the wall", lambda: make_cylinder(CylinderConfig(thickness=0.006), GrooveConfig())),
        ("wider than the cuboid", lambda: make_cuboid(CuboidConfig(width=0.01), GrooveConfig())),
        ("cuts the cuboid in two", lambda: make_cuboid(CuboidConfig(length=0.03), GrooveConfig(depth=0.016))),
        ("margin", lambda: make_cuboid(CuboidConfig(), GrooveConfig(margin=0.4))),
        ("half the radius", lambda: make_cylinder(CylinderConfig(radius=0.03), GrooveConfig())),
        ("span", lambda: make_cylinder(CylinderConfig(span=4.0), GrooveConfig())),
        ("wider than the plate", lambda: make_branched_plate(PlateConfig(), GrooveConfig(width=0.3), BranchesConfig())),
        ("twice the groove", lambda: make_branched_plate(PlateConfig(), GrooveConfig(), BranchesConfig(junction=0.119))),
        ("spread", lambda: make_branched_plate(PlateConfig(), GrooveConfig(), BranchesConfig(spread=0.1))),
        ("one branch", lambda: make_branched_plate(PlateConfig(), GrooveConfig(misalignment=0.001), BranchesConfig())),
        ("0.8 of the depth", lambda: make_cuboid(CuboidConfig(), GrooveConfig(misalignment=0.007))),
        ("give one", lambda: make_cuboid(CuboidConfig(), GrooveConfig(root_gap=0.002, angle=1.0))),
        ("root_gap", lambda: make_cuboid(CuboidConfig(), GrooveConfig(root_gap=0.02))),
    ],
)
def test_contradictions_are_refused_in_one_line(message: str, build) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        build()
    assert "\n" not in str(caught.value)
    assert caught.value.data["key"]
