"""Grooved plates are closed solids, their known seams lie on them, and contradictions are refused."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from hypothesis import given, settings
from hypothesis import strategies as st

from weldsim.errors import SceneError
from weldsim.frames import Transform, unit
from weldsim.records import KnownSeam
from weldsim.scene.mesh_cache import cached_mesh
from weldsim.scene.workpieces.centre_line import CentreLineConfig, make_centre_line
from weldsim.scene.workpieces.groove import GrooveConfig, make_section
from weldsim.scene.workpieces.plate import GroovePlate, PlainPlate, PlateConfig, make_groove_plate

LINES = {
    "straight": CentreLineConfig(shape="straight", offset=0.012),
    "arc": CentreLineConfig(shape="arc", radius=0.15),
    "s": CentreLineConfig(shape="s", radius=0.10, wavelength=0.30),
}
GROOVES = {
    "vee": GrooveConfig(),
    "flat": GrooveConfig(angle=np.radians(40.0)),
    "slot": GrooveConfig(angle=0.0, width=0.008, depth=0.012),
    "inside": GrooveConfig(margin=0.03),
}
CASES = [(line, groove) for line in LINES for groove in GROOVES]


def plate(line: str, groove: str) -> GroovePlate:
    return make_groove_plate(PlateConfig(), GROOVES[groove], LINES[line])


def distance_to_edges(mesh: trimesh.Trimesh, edges: np.ndarray, points: np.ndarray) -> np.ndarray:
    a, b = mesh.vertices[edges[:, 0]], mesh.vertices[edges[:, 1]]
    d = b - a
    u = np.clip(np.einsum("pej,ej->pe", points[:, None] - a, d) / np.einsum("ej,ej->e", d, d), 0, 1)
    return np.linalg.norm(points[:, None] - (a + u[..., None] * d), axis=2).min(axis=1)


def covered(vertices: np.ndarray, faces: np.ndarray, points: np.ndarray) -> np.ndarray:
    """Whether each point lies above or below one of the faces, seen along z."""
    corners = vertices[faces][:, :, :2]
    inside = np.ones((len(points), len(faces)), bool)
    for i in range(3):
        a, b = corners[:, i], corners[:, (i + 1) % 3]
        to = points[:, None, :2] - a
        inside &= (b[:, 0] - a[:, 0]) * to[..., 1] - (b[:, 1] - a[:, 1]) * to[..., 0] > -1e-12
    return inside.any(axis=1)


@pytest.mark.parametrize(("line", "groove"), CASES)
def test_solid_is_closed_and_small(line: str, groove: str) -> None:
    mesh = plate(line, groove).build_mesh().to_trimesh()
    assert mesh.is_watertight
    assert mesh.is_winding_consistent
    assert mesh.volume > 0
    assert len(mesh.faces) < 200_000


def test_straight_groove_removes_its_cross_section_times_its_length() -> None:
    part = plate("straight", "flat")
    section = part.section
    missing = (section.width + section.root_gap) / 2 * section.depth * part.plate.length
    whole = part.plate.length * part.plate.width * part.plate.thickness
    assert part.build_mesh().to_trimesh().volume == pytest.approx(whole - missing, rel=1e-9)


@pytest.mark.parametrize(("line", "groove"), CASES)
def test_known_seam_lies_on_the_mesh(line: str, groove: str) -> None:
    part = plate(line, groove)
    labelled = part.build_mesh()
    mesh, curve = labelled.to_trimesh(), part.seam_curves()[0]
    # The lips are the mesh's edges between groove faces and parent faces at the surface.
    pairs, faces = mesh.face_adjacency_edges, mesh.face_adjacency
    at_top = (np.abs(mesh.vertices[pairs][:, :, 2]) < 1e-9).all(axis=1)
    lips = pairs[at_top & (labelled.groove[faces[:, 0]] != labelled.groove[faces[:, 1]])]
    inside = slice(None, None, 7)
    for side in (curve.left, curve.right):
        points = side[inside]
        points = points[np.abs(points[:, 0]) < part.plate.length / 2 - 1e-6]
        assert distance_to_edges(mesh, lips, points).max() < 5e-6
    floor = np.abs(mesh.vertices[:, 2] + part.section.depth) < 1e-9
    root = curve.root[1:-1:7]
    if part.section.root_gap > 0:
        assert covered(mesh.vertices, mesh.faces[floor[mesh.faces].all(axis=1)], root).all()
    else:
        assert distance_to_edges(mesh, mesh.edges_unique[floor[mesh.edges_unique].all(axis=1)], root).max() < 1e-6
    assert np.abs(curve.root[:, 2] + part.section.depth).max() < 1e-12


@pytest.mark.parametrize("line", LINES)
def test_seam_is_consistent_with_itself(line: str) -> None:
    part = plate(line, "vee")
    X_BP = Transform.from_rotation_vector("BP", np.array([0.2, -0.1, 0.7]), np.array([0.1, -0.4, 0.05]))
    seam = part.known_seams(X_BP)[0]
    assert np.diff(seam.s).max() <= 0.5e-3 + 1e-9
    chord = np.diff(seam.opening_B, axis=0)
    assert np.allclose(np.linalg.norm(chord, axis=1), np.diff(seam.s), rtol=1e-5)  # arc length in closed form
    middle = unit(seam.tangents_B[1:] + seam.tangents_B[:-1])
    assert np.abs(unit(chord) - middle).max() < 1e-5  # tangents by finite differences
    assert np.abs((seam.left_B + seam.right_B) / 2 - seam.opening_B).max() < 1e-12
    assert np.abs(np.einsum("ij,ij->i", seam.tangents_B, seam.bisectors_B)).max() < 1e-12
    across = seam.left_B - seam.right_B
    assert np.allclose(np.linalg.norm(across, axis=1), part.section.width)
    # Left as seen along travel with the outward normal up: normal x tangent points left.
    assert (np.einsum("ij,ij->i", np.cross(-seam.bisectors_B, seam.tangents_B), across) > 0).all()
    assert np.abs(seam.opening_B + part.section.depth * seam.bisectors_B - seam.root_B).max() < 1e-12


@pytest.mark.parametrize(("shape", "radius"), [("arc", 0.15), ("arc", 0.2), ("s", 0.1), ("s", 0.2)])
def test_smallest_radius_is_that_of_the_curve(shape: str, radius: float) -> None:
    line = make_centre_line(CentreLineConfig(shape=shape, radius=radius), 0.24)  # type: ignore[arg-type]
    x = np.linspace(-0.1, 0.1, 20001)
    points = np.column_stack([x, line.y(x)])
    turn = np.linalg.norm(np.gradient(line.tangents(x), line.arc_length(x), axis=0), axis=1)
    assert 1 / turn[10:-10].max() == pytest.approx(radius, rel=1e-3)
    assert line.smallest_radius == pytest.approx(radius)
    slope = np.gradient(points[:, 1], x)
    assert np.abs(slope[1:-1] - line.slope(x)[1:-1]).max() < 1e-6


@pytest.mark.parametrize(
    ("message", "build"),
    [
        ("width of", {"groove": GrooveConfig(width=0.010, depth=0.008, angle=np.radians(90))}),
        ("through the plate", {"groove": GrooveConfig(width=0.030, depth=0.020)}),
        ("plate ends at", {"groove": GrooveConfig(width=0.230)}),
        ("plate ends at", {"line": CentreLineConfig(offset=0.11)}),
        ("margins", {"groove": GrooveConfig(margin=0.12)}),
        ("must be 0.2 to 500 mm", {"groove": GrooveConfig(width=0.0)}),
        ("must be 0.2 to 500 mm", {"groove": GrooveConfig(depth=0.0001)}),
        ("cannot span", {"line": CentreLineConfig(shape="arc", radius=0.1)}),
        ("under half the groove's width", {"line": CentreLineConfig(shape="s", radius=0.006, wavelength=0.05)}),
        ("under 180", {"groove": GrooveConfig(angle=3.2)}),
        ("over 0", {"plate": PlateConfig(thickness=0.0)}),
    ],
)
def test_contradictions_are_refused(message: str, build: dict) -> None:
    with pytest.raises(SceneError, match=message) as caught:
        make_groove_plate(
            build.get("plate", PlateConfig()), build.get("groove", GrooveConfig()), build.get("line", CentreLineConfig())
        )
    assert "\n" not in str(caught.value)
    assert "key" in caught.value.data


@settings(max_examples=25)
@given(width=st.floats(0.004, 0.03), depth=st.floats(0.002, 0.018), share=st.floats(0.0, 1.0))
def test_any_section_fits_its_sizes(width: float, depth: float, share: float) -> None:
    steepest = 2 * np.arctan(width / 2 / depth)
    section = make_section(GrooveConfig(width=width, depth=depth, angle=share * steepest))
    assert 0 <= section.root_gap <= width
    assert section.angle == pytest.approx(share * steepest, abs=1e-6)
    outline = section.outline(0.0)
    assert np.ptp(outline[:, 0]) == pytest.approx(width)
    assert outline[:, 1].min() == pytest.approx(-depth)


def test_groove_faces_are_those_below_the_surface() -> None:
    mesh = plate("s", "flat").build_mesh()
    centre = mesh.vertices[mesh.faces].mean(axis=1)
    half = PlateConfig().half
    inner = (
        (centre[:, 2] < -1e-9)
        & (centre[:, 2] > -0.0081)
        & (np.abs(centre[:, 0]) < half[0] - 1e-6)
        & (np.abs(centre[:, 1]) < half[1] - 1e-6)
    )
    assert (inner == mesh.groove).all()


def test_plain_plate_has_no_seam() -> None:
    part = PlainPlate(PlateConfig())
    assert part.known_seams(Transform.identity("BP")) == ()
    mesh = part.build_mesh()
    assert not mesh.groove.any()
    assert mesh.to_trimesh().is_watertight


def test_cache_keeps_what_was_made_and_survives_damage(tmp_path: Path) -> None:
    part = plate("arc", "vee")
    fresh = part.build_mesh()
    for _ in range(2):
        kept = cached_mesh(part, tmp_path)
        assert np.array_equal(kept.vertices, fresh.vertices)
        assert np.array_equal(kept.groove, fresh.groove)
    (file,) = tmp_path.iterdir()
    file.write_bytes(file.read_bytes()[:100])
    assert np.array_equal(cached_mesh(part, tmp_path).faces, fresh.faces)
    other = make_groove_plate(PlateConfig(), replace(GrooveConfig(), width=0.013), LINES["arc"])
    cached_mesh(other, tmp_path)
    assert len(list(tmp_path.iterdir())) == 2


def test_known_seam_is_a_record() -> None:
    assert isinstance(plate("s", "vee").known_seams(Transform.identity("BP"))[0], KnownSeam)
