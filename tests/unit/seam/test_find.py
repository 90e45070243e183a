"""The whole default finder on clouds with a known groove: accuracy, ends, phantoms, several grooves, poor clouds."""

import inspect
from dataclasses import replace
from typing import NamedTuple

import numpy as np
import pytest

from tests.clouds import GROOVE, GrooveCloud, d415_depth, groove_cloud
from tests.clouds import two_grooves as made_two_grooves
from weldsim.cloud.filters import voxel_grid
from weldsim.cloud.merge import merge
from weldsim.curves import project
from weldsim.records import KnownSeam, PointCloud, Seam
from weldsim.seam.config import ProfileConfig, SeamConfig
from weldsim.seam.find import find_seams
from weldsim.seam.profile.atlas import make_atlas
from weldsim.seam.profile.find import _search, find_seams_profile
from weldsim.seam.profile.valley import CoarseLine

CONFIG = ProfileConfig()
CURVES = ("straight", "arc", "s")


class Error(NamedTuple):
    """Cross-track distance from the true opening [m], and the share of it covered."""

    mean: float
    p95: float
    coverage: float


def error(seam: Seam, truth: KnownSeam) -> Error:
    distance = project(seam.points_B, truth.opening_B)[0]
    covered = project(truth.opening_B, seam.points_B)[0] < 3e-3
    return Error(float(distance.mean()), float(np.quantile(distance, 0.95)), float(covered.mean()))


def only_seam(made: GrooveCloud) -> tuple[Seam, KnownSeam]:
    found = find_seams_profile(made.cloud, CONFIG)
    assert made.seam is not None
    assert len(found.seams) == 1, [refused.reason for refused in found.rejected]
    return found.seams[0], made.seam


def check_record(seam: Seam) -> None:
    """Everything about a seam that holds whatever the cloud was."""
    for values in (seam.points_B, seam.tangents_B, seam.normals_B, seam.left_B, seam.right_B, seam.sigma):
        assert values is not None
        assert np.isfinite(values).all()
    assert seam.left_B is not None
    assert seam.right_B is not None
    assert seam.sigma is not None
    np.testing.assert_allclose((seam.left_B + seam.right_B) / 2, seam.points_B, atol=1e-9)
    left = np.cross(seam.normals_B, seam.tangents_B)
    np.testing.assert_allclose(np.einsum("ij,ij->i", seam.left_B - seam.right_B, left), seam.width, atol=1e-9)
    assert (seam.sigma > 0).all()
    assert seam.sigma.max() < 2e-3
    assert 0 < seam.confidence <= 1


@pytest.mark.parametrize("curve", CURVES)
@pytest.mark.parametrize("surface", ["flat", "cylinder"])
def test_without_noise_it_is_exact_to_a_few_hundredths(curve, surface) -> None:
    made = groove_cloud(np.random.default_rng(0), curve=curve, surface=surface, clamps=2, tilt=0.1, yaw=0.5)
    seam, truth = only_seam(made)
    figures = error(seam, truth)
    assert figures.mean < 0.12e-3
    assert figures.p95 < 0.25e-3
    assert figures.coverage > 0.99
    assert seam.width == pytest.approx(0.014, abs=4e-4)
    at = np.searchsorted(truth.s, project(seam.points_B, truth.opening_B)[2]).clip(0, len(truth.s) - 1)
    lean = np.einsum("ij,ij->i", seam.normals_B, -truth.bisectors_B[at])
    assert np.quantile(lean, 0.05) > np.cos(np.radians(2.0)), "outward, along the bisector"
    check_record(seam)


@pytest.mark.parametrize(("width", "depth"), [(5, 2.5), (6, 2.0), (6, 3.43), (20, 12)])
def test_a_groove_along_the_image_has_its_width_and_depth(width: float, depth: float) -> None:
    """Without noise each column of pixels lies at one place across the groove, whatever the station."""
    made = groove_cloud(
        np.random.default_rng(0), width=width * 1e-3, depth=depth * 1e-3, camera_tilt=0.0, standoff=0.38, table=False
    )
    seam, truth = only_seam(made)
    assert error(seam, truth).p95 < 0.1e-3
    assert seam.width == pytest.approx(width * 1e-3, abs=1.5e-4)
    assert seam.depth == pytest.approx(depth * 1e-3, abs=1.0e-4)


@pytest.mark.parametrize(("width", "depth"), [(6, 3.43), (14, 8), (20, 12)])
@pytest.mark.parametrize("noise", [0.0, 1.5e-4])
def test_a_groove_that_two_views_show_has_its_width_and_depth(width: float, depth: float, noise: float) -> None:
    """A sharp sensor's; each view puts the bottom where its sight lines meet the plate, one to the left and one to the right."""
    rng = np.random.default_rng(0)
    first, second = (
        groove_cloud(rng, width=width * 1e-3, depth=depth * 1e-3, camera_tilt=0.25, camera_azimuth=azimuth, table=False)
        for azimuth in (1.2, -1.6)
    )
    both = merge([first.cloud, second.cloud])
    both = replace(both, points=both.points + noise * rng.standard_normal(both.points.shape))
    seam, truth = only_seam(first._replace(cloud=both))
    assert error(seam, truth).p95 < 0.2e-3
    assert seam.width == pytest.approx(width * 1e-3, abs=3e-4)
    assert seam.depth == pytest.approx(depth * 1e-3, abs=2e-4)


@pytest.mark.parametrize(("width", "depth"), [(12, 1.8), (12, 3), (16, 2.4), (20, 3), (25, 3)])
@pytest.mark.parametrize("sigma", [0.0, 3e-4])
def test_a_shallow_groove_has_its_width(width: float, depth: float, sigma: float) -> None:
    """A V looks like a square groove of half its width under a window of that width: a sharp sensor has no such window."""
    sizes = {"width": width * 1e-3, "depth": depth * 1e-3}
    made = groove_cloud(np.random.default_rng(1), **sizes, tilt=0.1, yaw=0.5, standoff=0.5, noise="iid", sigma=sigma)
    seam, truth = only_seam(made)
    assert error(seam, truth).p95 < 0.4e-3
    assert seam.width == pytest.approx(width * 1e-3, abs=3e-4)
    assert seam.depth == pytest.approx(depth * 1e-3, abs=1e-4)


@pytest.mark.parametrize(
    ("width", "slant", "sigma"), [(8, 30, 0.0), (12, 25, 3e-4), (12, 30, 3e-4), (16, 35, 1e-4), (20, 40, 2e-4)]
)
def test_a_bevel_seen_along_its_ramp_has_its_middle(width: int, slant: int, sigma: float) -> None:
    """One wall upright, the other at 45 deg, both seen: its looks are those of a narrow groove, its lips are elsewhere."""
    rng, half, place = np.random.default_rng(0), width * 0.5e-3, np.array([0.0, 0.5, 0.0])
    eye = np.array([0.0, 0.43 * np.tan(np.radians(slant)), 0.43])
    x, angle = np.meshgrid(np.arange(-0.1, 0.1, 7e-4), np.radians(slant) + np.arange(-0.22, 0.22, 0.0016))
    beside = eye[1] - eye[2] * np.tan(angle)  # where a sight line meets the plate
    on_wall = (beside + half) / np.tan(angle)  # how deep it is when it meets the wall at y = -half
    on_ramp = (half - beside) / (1 - np.tan(angle))  # and the ramp, which falls towards it
    inside = np.abs(beside) < half
    deep = np.where(inside, np.minimum(on_wall, on_ramp), 0.0)
    points = np.stack([x, beside - deep * np.tan(angle), -deep], axis=-1).reshape(-1, 3)
    sight = (points - eye) / np.linalg.norm(points - eye, axis=1, keepdims=True)
    points = points + sight * rng.normal(0.0, sigma + 1e-12, len(points))[:, None]
    found = find_seams_profile(PointCloud(points=points - place, viewpoints=eye[None] - place), CONFIG)
    (seam,) = found.seams
    assert np.abs(seam.points_B[:, 1] + 0.5).max() < 0.2e-3
    assert seam.width == pytest.approx(2 * half, abs=2e-4)


@pytest.mark.parametrize("width", [6, 8, 10, 14, 19, 25])
def test_widths_under_a_d415(width: int) -> None:
    """Over the seeds; one curve each, clamps and a tilt."""
    for seed in range(2):
        rng = np.random.default_rng([seed, width])
        made = groove_cloud(
            rng,
            width=width * 1e-3,
            curve=CURVES[(seed + width) % 3],
            clamps=int(rng.integers(0, 5)),
            tilt=rng.uniform(-0.2, 0.2),
            yaw=rng.uniform(-3, 3),
            offset=rng.uniform(-0.02, 0.02),
            noise="d415",
        )
        seam, truth = only_seam(made)
        figures = error(seam, truth)
        assert figures.mean < (0.6e-3 if width < 8 else 0.4e-3), seed
        assert figures.coverage > 0.95, seed
        check_record(seam)


def test_the_region_is_the_groove() -> None:
    made = groove_cloud(np.random.default_rng(1), curve="arc", noise="d415", clamps=2)
    region = find_seams_profile(made.cloud, CONFIG).region > 0
    truth = made.labels == GROOVE
    assert (region & truth).sum() / (region | truth).sum() > 0.85


@pytest.mark.parametrize("seed", range(6))
def test_a_plain_plate_has_no_seam(seed: int) -> None:
    rng = np.random.default_rng([seed, 99])
    made = groove_cloud(
        rng,
        width=0.0,
        clamps=int(rng.integers(2, 5)),
        bolts=int(rng.integers(0, 6)),
        strays=int(rng.integers(0, 300)),
        tilt=rng.uniform(-0.3, 0.3),
        yaw=rng.uniform(-3, 3),
        standoff=rng.uniform(0.3, 0.55),
        surface="cylinder" if seed % 4 == 3 else "flat",
        noise="d415",
    )
    found = find_seams_profile(made.cloud, CONFIG)
    assert found.seams == ()
    assert not found.region.any()


@pytest.mark.parametrize("seed", range(3))
def test_bolts_clamps_and_strays_beside_a_groove_change_little(seed: int) -> None:
    rng = np.random.default_rng([seed, 7])
    made = groove_cloud(rng, curve=CURVES[seed], clamps=4, bolts=4, strays=200, noise="d415")
    figures = error(*only_seam(made))
    assert figures.mean < 0.45e-3
    assert figures.coverage > 0.95


@pytest.mark.parametrize("margin", [0.02, 0.06])
def test_ends_inside_the_plate_are_found(margin: float) -> None:
    for seed in range(2):
        made = groove_cloud(np.random.default_rng(seed), curve=CURVES[seed], margin=margin, noise="d415", clamps=2)
        seam, truth = only_seam(made)
        gaps = np.linalg.norm(seam.points_B[[0, -1], None] - truth.opening_B[None, [0, -1]], axis=2)
        assert np.minimum(np.diag(gaps).max(), np.diag(gaps[::-1]).max()) < 3e-3
        assert error(seam, truth).mean < 0.45e-3


def two_grooves(seed: int, first: dict, second: dict, **both) -> tuple[PointCloud, list[KnownSeam]]:
    """One plate with two grooves as a D415 sees it: of two plates with one each, whichever is deeper at a pixel."""
    made = [groove_cloud(np.random.default_rng(seed), **one, **both) for one in (first, second)]
    intrinsics, X_BC = made[0].cloud.intrinsics, made[0].cloud.X_BC
    assert intrinsics is not None
    assert X_BC is not None
    z = np.full((2, intrinsics.height * intrinsics.width), np.nan)
    for row, one in zip(z, made, strict=True):
        row[one.cloud.pixel] = X_BC.inverse().points(one.cloud.points)[:, 2]
    depth = d415_depth(z.max(axis=0).reshape(intrinsics.height, intrinsics.width), intrinsics.fx, np.random.default_rng(seed))
    pixel = np.flatnonzero(np.isfinite(depth.ravel()))
    points = X_BC.points((intrinsics.rays() * depth[..., None]).reshape(-1, 3)[pixel])
    cloud = PointCloud(points=points, viewpoints=X_BC.p[None], pixel=pixel, intrinsics=intrinsics, X_BC=X_BC)
    return cloud, [one.seam for one in made if one.seam is not None]


@pytest.mark.parametrize("seed", range(3))
def test_two_grooves_are_both_returned_best_first(seed: int) -> None:
    cloud, truths = two_grooves(
        seed, {"width": 0.016, "offset": 0.05}, {"width": 0.010, "offset": -0.05}, curve=CURVES[seed], clamps=2
    )
    found = find_seams_profile(cloud, CONFIG)
    assert len(found.seams) == 2
    matched = []
    for number, seam in enumerate(found.seams, start=1):
        figures = [error(seam, truth) for truth in truths]
        best = int(np.argmin([one.mean for one in figures]))
        matched.append(best)
        assert figures[best].mean < 0.45e-3
        assert figures[best].coverage > 0.95
        near = project(cloud.points[found.region == number], seam.points_B)[0]
        assert np.quantile(near, 0.95) < 0.012, "each region goes with its seam"
    assert sorted(matched) == [0, 1]
    assert found.seams[0].confidence >= found.seams[1].confidence - 0.011


def test_what_a_coarse_line_has_beside_a_groove_found_before_is_not_lost() -> None:
    """The second line runs along the first groove for 110 mm, then over to the other one for 80 mm."""
    cloud = made_two_grooves()
    x, up = np.linspace(-0.135, 0.135, 271), np.array([0.0, 0.0, 1.0])
    first = np.stack([x, np.full(271, -0.45), np.full(271, 0.02)], axis=1)
    other = np.stack([x[95:175], np.full(80, -0.55), np.full(80, 0.02)], axis=1)
    second = np.concatenate([first[60:170], other[::-1]])
    lines = [CoarseLine(line, np.tile(up, (len(line), 1)), 1.0, 1.0) for line in (first, second)]
    pieces, _ = _search(make_atlas(cloud), lines, CONFIG)
    middles = sorted(float(np.median(piece.fit.rail.points[:, 1])) for piece in pieces)
    np.testing.assert_allclose(middles, [-0.55, -0.45], atol=1e-3)


@pytest.mark.parametrize("seed", range(3))
def test_sparse_clouds_of_a_plate(seed: int) -> None:
    made = groove_cloud(np.random.default_rng(seed), curve=CURVES[seed], table=False, noise="d415", clamps=2)
    chosen = np.zeros(len(made.cloud), bool)
    chosen[np.random.default_rng(seed).choice(len(made.cloud), 10_000, replace=False)] = True
    figures = error(*only_seam(GrooveCloud(made.cloud.select(chosen), made.seam, made.labels[chosen])))
    assert figures.mean < 0.5e-3
    assert figures.coverage > 0.9
    thinned = voxel_grid(made.cloud, 0.002)
    assert error(*only_seam(GrooveCloud(thinned, made.seam, made.labels))).mean < 0.5e-3


@pytest.mark.parametrize("noise", ["none", "d415"])
def test_without_a_viewpoint(noise) -> None:
    made = groove_cloud(np.random.default_rng(4), curve="arc", noise=noise, clamps=2)
    blind = PointCloud(points=made.cloud.points)
    figures = error(*only_seam(GrooveCloud(blind, made.seam, made.labels)))
    assert figures.mean < (0.1e-3 if noise == "none" else 0.4e-3)
    assert figures.coverage > 0.95


@pytest.mark.parametrize("n", [1, 2, 3, 10, 300])
def test_a_few_points_are_no_seam_and_no_crash(n: int) -> None:
    rng = np.random.default_rng(n)
    for spread in ((1, 1, 1), (1, 1, 0), (1, 0, 0), (0, 0, 0)):
        cloud = PointCloud(points=rng.uniform(-0.1, 0.1, (n, 3)) * spread + [0, -0.4, 0], viewpoints=np.array([[0.0, -0.4, 0.5]]))
        assert find_seams_profile(cloud, CONFIG).seams == ()


def test_every_refusal_has_its_place_and_reason() -> None:
    made = groove_cloud(np.random.default_rng(0), width=0.014, noise="none")
    strict = ProfileConfig(max_width=0.010)
    found = find_seams_profile(made.cloud, strict)
    assert found.seams == ()
    assert any("over the 10 mm of seam.profile.max_width" in refused.reason for refused in found.rejected)
    for refused in found.rejected:
        assert refused.length > 0
        assert np.isfinite(refused.position_B).all()


def test_only_the_cloud_goes_in() -> None:
    assert list(inspect.signature(find_seams).parameters) == ["cloud", "config"]
    made = groove_cloud(np.random.default_rng(5), noise="d415")
    bare = PointCloud(points=made.cloud.points, viewpoints=made.cloud.viewpoints)
    seen, unseen = (find_seams(cloud, SeamConfig()) for cloud in (made.cloud, bare))
    assert np.array_equal(seen.seams[0].points_B, unseen.seams[0].points_B)
