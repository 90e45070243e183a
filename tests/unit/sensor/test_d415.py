"""The parametric D415 reproduces the figures of public depth frames, and for grooves those of a simulated stereo pair.

Exact depth is in closed form (a plane, a groove, a fillet, a step), so that only the model is under test. Noise and rims are
held against what was measured on frames of a D415 (demo data of NVlabs/UnseenObjectClustering), grooves and fillets against
stereo matching on rendered infrared pairs at the same distances; several seeds each.
"""

from dataclasses import replace

import numpy as np
import pytest
from numpy import ndarray

from tests.depth_scenes import FLAT, fillet, points_in_part, profile_depth, v_groove
from weldsim.errors import ConfigError, RecordError
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics
from weldsim.sensor.base import Finish
from weldsim.sensor.d415 import (
    COARSENESS,
    D415_1280X720,
    D435_848X480,
    DROPOUT,
    D415Config,
    D435Config,
    d415,
    unit_intrinsics,
)
from weldsim.sensor.noise import NoiseField, total_sigma

SEEDS = range(4)
FINE = D415Config(depth_unit=1e-4)  # the model's own figures, not those of the millimetre steps
SMOOTH = D415Config(depth_unit=0.0, disparity_step=0.0)
FB = D415_640X480.fx * 0.055
THESIS_DISTANCES = [0.360, 0.391, 0.408, 0.428, 0.457, 0.501, 0.519, 0.530, 0.560, 0.605]  # [m]


def middle(image: ndarray) -> ndarray:
    """Away from the borders and the blind band on the left."""
    return image[20:-20, 130:-20]


@pytest.mark.parametrize("z", [0.36, 0.48, 0.60])
@pytest.mark.parametrize("tilt", [0.1, 0.8])
def test_plane_noise_is_that_of_public_frames(z: float, tilt: float) -> None:
    """0.095 px in all, at any distance and tilt: standard deviation of depth on a plane z^2 * 0.095 px / (f B)."""
    exact = profile_depth(D415_640X480, FLAT, z, tilt=tilt)
    sigma = [np.nanstd(middle(FB / d415(exact, D415_640X480, FINE, seed=[seed]) - FB / exact)) for seed in SEEDS]
    assert np.mean(sigma) == pytest.approx(0.095, rel=0.15)


def test_noise_is_alike_over_as_many_pixels_as_in_public_frames() -> None:
    """On parts of 160 x 120 px of a plane, tilt removed: down to 1/e at 11 to 16 px along rows and 8 to 9.5 px along columns."""
    exact = profile_depth(D415_640X480, FLAT, 0.67, tilt=0.1)
    correlation = np.zeros((2, 30))
    for seed in SEEDS:
        error = FB / d415(exact, D415_640X480, SMOOTH, seed=[seed]) - FB / exact
        for top, left in ((70, 130), (70, 290), (70, 450), (190, 130), (190, 290), (190, 450), (310, 130), (310, 290)):
            part = without_tilt(error[top : top + 120, left : left + 160])
            for axis in (0, 1):
                lines = np.moveaxis(part, 1 - axis, 0)
                correlation[axis] += [np.mean(lines[: len(lines) - lag] * lines[lag:]) for lag in range(30)]
    rows, columns = (np.interp(-np.exp(-1), -each / each[0], np.arange(30)) for each in correlation)
    assert 11.0 <= rows <= 16.0
    assert 8.0 <= columns <= 9.5


def without_tilt(image: ndarray) -> ndarray:
    """The image less the plane fitted to it."""
    rows, columns = np.indices(image.shape)
    A = np.stack([np.ones(image.size), rows.ravel(), columns.ravel()], axis=1)
    return (image.ravel() - A @ np.linalg.lstsq(A, image.ravel().astype(float), rcond=None)[0]).reshape(image.shape)


def test_the_drivers_filter_takes_fine_noise_away_and_leaves_waves_and_a_large_groove() -> None:
    exact = profile_depth(D415_640X480, FLAT, 0.45, tilt=0.1)
    fine = replace(SMOOTH, noise=(NoiseField(sigma=0.1, along_rows=2.0, along_columns=2.0),))
    left = []
    for config in (fine, SMOOTH):
        plain, smooth = (
            middle(d415(exact, D415_640X480, replace(config, spatial_filter=on), seed=[0]) - exact) for on in (False, True)
        )
        left.append(np.nanstd(smooth) / np.nanstd(plain))
    assert left[0] < 0.6
    assert 0.8 < left[1] < 0.98
    groove = profile_depth(D415_640X480, v_groove(0.02, 0.012), 0.40)
    shown = [
        np.nanmax(np.nanmean(d415(groove, D415_640X480, replace(SMOOTH, spatial_filter=on), seed=[0])[100:300, 130:], axis=0))
        - 0.40
        for on in (False, True)
    ]
    assert 0.8 * shown[0] < shown[1] < shown[0]


def groove_profile(
    intrinsics: CameraIntrinsics, config: D415Config, z: float, rotation: float, seed: int
) -> tuple[ndarray, ndarray]:
    """Mean and standard deviation of height [m] in 1 mm strips along a 6 x 5 mm V, from 30 mm left of it to 30 mm right."""
    exact = profile_depth(intrinsics, v_groove(0.006, 0.005), z, rotation=rotation)
    depth = d415(exact, intrinsics, config, seed=[seed])
    across = points_in_part(intrinsics, exact, z, rotation=rotation)[..., 0]
    height = points_in_part(intrinsics, depth, z, rotation=rotation)[..., 2]
    seen = np.isfinite(depth)
    strips = [height[seen & (np.abs(across - x) < 0.5e-3)] for x in np.arange(-30, 31) * 1e-3]
    return np.array([s.mean() for s in strips]), np.array([s.std() for s in strips])


@pytest.mark.parametrize("rotation", [0.0, 0.6, np.pi / 2])
@pytest.mark.parametrize(
    ("intrinsics", "z", "shallowest", "deepest"),
    [(D415_640X480, 0.40, 1.9e-3, 2.9e-3), (D415_1280X720, 0.45, 2.5e-3, 3.3e-3)],
    ids=["640x480", "1280x720"],
)
def test_a_small_groove_is_rounded_off(
    intrinsics: CameraIntrinsics, z: float, shallowest: float, deepest: float, rotation: float
) -> None:
    """The 5 mm deep V looks 1.9 to 2.9 mm deep at 640 x 480 and 0.40 m, and is noisier than the plate."""
    profiles = [groove_profile(intrinsics, FINE, z, rotation, seed) for seed in SEEDS]
    mean, sigma = np.mean([m for m, _ in profiles], axis=0), np.mean([s for _, s in profiles], axis=0)
    assert shallowest <= -mean.min() <= deepest
    assert abs(mean[:15].mean()) < 0.15e-3  # pixel locking shifts a frontal plate by up to 0.1 mm
    if intrinsics is D415_640X480:
        assert 1.7 <= sigma[28:33].mean() / sigma[:15].mean() <= 2.3


@pytest.mark.parametrize(
    ("intrinsics", "z", "low", "high"),
    [(D415_640X480, 0.35, 0.5e-3, 0.8e-3), (D415_640X480, 0.40, 0.7e-3, 1.1e-3), (D415_1280X720, 0.45, 0.45e-3, 0.7e-3)],
    ids=["0.35", "0.40", "720p"],
)
def test_slice_centroids_scatter_as_in_stereo(intrinsics: CameraIntrinsics, z: float, low: float, high: float) -> None:
    """Centroid of what lies under the plate, in 2 mm slices along a 6 x 5 mm V, with millimetre steps."""
    exact = profile_depth(intrinsics, v_groove(0.006, 0.005), z)
    centroids = []
    for seed in range(12):  # noise is alike over several slices
        depth = d415(exact, intrinsics, D415Config(), seed=[seed])
        points = points_in_part(intrinsics, depth, z)
        near = np.isfinite(depth) & (np.abs(points[..., 0]) < 8e-3)
        x, y, below = points[near][:, 0], points[near][:, 1], np.clip(-points[near][:, 2], 0, None)
        for start in np.arange(-0.06, 0.06, 0.002):
            strip = (y >= start) & (y < start + 0.002)
            centroids.append(np.average(x[strip], weights=below[strip]))
    assert low <= np.std(centroids) <= high
    assert abs(np.mean(centroids)) < 0.3e-3


def test_a_fillet_corner_is_raised_but_its_planes_are_true() -> None:
    """Two plates at 90 deg, 1280 x 720 at 0.45 m: the corner seems 0.9 to 1.4 mm nearer, as the mean over the window is;
    fitted planes meet within 0.1 mm of it."""
    z, corner, crossing = 0.45, [], []
    exact = profile_depth(D415_1280X720, fillet(), z)
    across = np.abs(points_in_part(D415_1280X720, exact, z)[..., 0])
    for seed in SEEDS:
        depth = d415(exact, D415_1280X720, FINE, seed=[seed])
        points = points_in_part(D415_1280X720, depth, z)
        corner.append(np.nanmean(points[..., 2][across < 0.4e-3]))
        x, y, height = points[np.isfinite(depth)].T
        for start in np.arange(-0.05, 0.05, 0.01):
            strip = (y >= start) & (y < start + 0.01)
            left, right = (
                np.polyfit(x[s], height[s], 1) for s in (strip & (x < -8e-3) & (x > -4e-2), strip & (x > 8e-3) & (x < 4e-2))
            )
            meet = (right[1] - left[1]) / (left[0] - right[0])
            crossing.append((meet, left[0] * meet + left[1]))
    assert 0.9e-3 <= np.mean(corner) <= 1.4e-3
    assert (np.abs(np.mean(crossing, axis=0)) < 0.1e-3).all()
    assert (np.std(crossing, axis=0) < 0.35e-3).all()


@pytest.mark.parametrize("z", [0.35, 0.45, 0.55])
def test_the_left_band_is_blind(z: float) -> None:
    """The right imager does not see the first f B / z columns."""
    depth = d415(profile_depth(D415_640X480, FLAT, z), D415_640X480, D415Config(), seed=[0])
    first = np.isfinite(depth).argmax(axis=1)
    assert np.abs(first - FB / z).max() <= 3
    assert np.isfinite(depth[:, first.max() :]).all()


def test_nothing_is_seen_nearer_than_the_search_range() -> None:
    exact = profile_depth(D415_640X480, FLAT, 0.30, tilt=0.5)
    depth = d415(exact, D415_640X480, D415Config(), seed=[1])
    nearest = FB / 126
    assert np.nanmin(exact) < nearest < np.nanmin(depth) + 0.5e-3
    assert np.isnan(depth[exact < nearest - 2e-3]).all()
    assert np.isfinite(depth[exact > nearest + 2e-3]).mean() > 0.8


def test_plane_means_are_true_without_a_view_offset() -> None:
    """At the thesis's ten distances, within 0.2 mm."""
    for seed, z in enumerate(THESIS_DISTANCES):
        exact = profile_depth(D415_640X480, FLAT, z, tilt=0.05)
        assert abs(np.nanmean(d415(exact, D415_640X480, D415Config(), seed=[seed]) - exact)) < 0.2e-3


def test_view_offsets_scatter_as_the_thesis_distances_do() -> None:
    """With 3.5 mm the rms error of ten mean distances lies in 2 to 5 mm for nearly every unit; the thesis has 3.5 mm."""
    small = CameraIntrinsics(width=160, height=60, fx=D415_640X480.fx, fy=D415_640X480.fy, cx=20.0, cy=30.0)
    config = replace(D415Config(), offset_sigma=3.5e-3)
    rms = []
    for unit in range(20):
        errors = []
        for view, z in enumerate(THESIS_DISTANCES):
            exact = profile_depth(small, FLAT, z)
            errors.append(np.nanmean(d415(exact, small, config, seed=[unit, view]) - exact))
        rms.append(np.sqrt(np.mean(np.square(errors))))
        assert (np.abs(errors) < 0.02 * np.array(THESIS_DISTANCES) + 0.5e-3).all()
    assert np.mean((np.array(rms) > 2e-3) & (np.array(rms) < 5e-3)) >= 0.8


def test_part_of_the_noise_changes_between_exposures() -> None:
    exact = profile_depth(D415_640X480, FLAT, 0.45)
    frames = np.array([middle(d415(exact, D415_640X480, SMOOTH, seed=[3], exposure=k)) for k in range(6)])
    total, temporal = np.nanstd(frames - middle(exact)), np.nanmean(np.nanstd(frames, axis=0, ddof=1))
    assert temporal / total == pytest.approx(0.42, abs=0.05)
    still = replace(SMOOTH, temporal_fraction=0.0)
    again = [d415(exact, D415_640X480, still, seed=[3], exposure=k) for k in (0, 1)]
    assert np.array_equal(*again, equal_nan=True)


def step_scene(step: float, *, near: float = 0.40, column: int = 330) -> ndarray:
    """A frontal plane [m] whose right part, from `column` on, lies `step` nearer."""
    exact = np.full((480, 640), near + step, np.float32)
    exact[:, column:] = near
    return exact


def test_a_large_step_leaves_a_shadow_on_its_left_and_little_between() -> None:
    """40 mm: two surfaces, the far one blind for 1.1 to 2.3 px more than the disparities differ, and now and then a pixel between
    them at the rim, which moves from row to row by about half a pixel."""
    exact = step_scene(0.040)
    wider, mixed, moved = [], [], []
    for seed in SEEDS:
        depth = d415(exact, D415_640X480, D415Config(), seed=[seed])
        between = (depth > 0.40 + 4e-3) & (depth < 0.44 - 4e-3)
        assert not between[:, :325].any()
        assert not between[:, 335:].any()
        mixed.append(between.sum(axis=1).mean())
        wider.append(np.isnan(depth[:, 330 - 25 : 340]).sum(axis=1).mean() - (FB / 0.40 - FB / 0.44))
        moved.append(np.std(np.diff((depth[:, 300:360] < 0.402).argmax(axis=1))) / np.sqrt(2))
        assert np.isfinite(depth[:, 340:]).all()
        assert np.isfinite(depth[:, 130:300]).all()
    assert 1.1 <= np.mean(wider) <= 2.3
    assert 0.15 <= np.mean(mixed) <= 0.24
    assert 0.4 <= np.mean(moved) <= 0.6


def test_a_small_step_is_smeared_over_the_window() -> None:
    """10 mm is a disparity step of 2 px: the mean depth passes through the middle and nothing is lost."""
    exact = step_scene(0.010)
    depth = d415(exact, D415_640X480, FINE, seed=[2])
    assert np.isfinite(depth[:, 130:]).all()
    profile = depth.mean(axis=0) - 0.40
    assert 3e-3 < profile[329:331].mean() < 7e-3
    assert profile[336 + 3 :].mean() == pytest.approx(0, abs=0.2e-3)
    assert profile[200 : 324 - 3].mean() == pytest.approx(0.010, abs=0.2e-3)


def test_units_and_views_differ_and_repeat() -> None:
    exact = profile_depth(D415_640X480, FLAT, 0.45)
    first, again, other = (d415(exact, D415_640X480, D415Config(), seed=[s]) for s in (5, 5, 6))
    assert first.tobytes() == again.tobytes()
    assert (first != other).mean() > 0.3


def test_dark_and_shiny_parts_have_holes_and_the_rest_has_not() -> None:
    exact = profile_depth(D415_640X480, FLAT, 0.45)
    part = np.arange(640)[None, :] >= 320 + np.zeros((480, 1), int)
    holes, sigma = [], []
    for finish in Finish:
        finishes = np.where(part, finish, Finish.MATTE).astype(np.uint8)
        depth = d415(exact, D415_640X480, FINE, seed=[1], finishes=finishes)
        assert np.isfinite(depth[:, 130:320]).all()
        holes.append(np.isnan(depth)[:, 320:].mean())
        sigma.append(np.nanstd((depth - exact)[:, 320:]) / np.nanstd((depth - exact)[:, 130:320]))
    assert holes[0] == 0 < holes[1]
    assert holes == sorted(holes)
    assert holes == pytest.approx([DROPOUT[finish] for finish in Finish], abs=0.04)
    assert sigma == pytest.approx([COARSENESS[finish] for finish in Finish], rel=0.1)


def test_matte_everywhere_is_the_default() -> None:
    exact = profile_depth(D415_640X480, v_groove(0.014, 0.008), 0.4)
    plain = d415(exact, D415_640X480, D415Config(), seed=[4])
    said = d415(exact, D415_640X480, D415Config(), seed=[4], finishes=np.zeros(exact.shape, np.uint8))
    assert plain.tobytes() == said.tobytes()


def test_units_differ_within_their_ranges_and_repeat() -> None:
    units = [D415Config.randomised(seed) for seed in range(200)]
    assert units == [D415Config.randomised(seed) for seed in range(200)]
    short, long = ([unit.noise[k] for unit in units] for k in (0, 1))
    for values, low, high in (
        ([unit.focal_scale for unit in units], 0.985, 1.015),
        ([unit.baseline for unit in units], 0.0547, 0.0553),
        ([unit.window for unit in units], 9, 13),
        ([field.sigma for field in short], 0.06, 0.10),
        ([field.along_rows for field in short], 8.0, 16.0),
        ([field.along_rows / field.along_columns for field in short], 1.3, 1.7),
        ([field.sigma for field in long], 0.03, 0.10),
        ([field.along_rows for field in long], 40.0, 150.0),
        ([field.along_rows / field.along_columns for field in long], 1.3, 1.7),
        ([unit.pixel_locking for unit in units], 0.0, 0.02),
        ([unit.temporal_fraction for unit in units], 0.4, 0.75),
        ([unit.edge_shadow for unit in units], 0.7, 1.9),
        ([unit.mixed_pixels for unit in units], 0.15, 0.5),
    ):
        assert low <= min(values) < max(values) <= high
        assert max(values) - min(values) > 0.9 * (high - low)
    assert 0.4 < np.mean([unit.spatial_filter for unit in units]) < 0.6
    base = D415Config(offset_sigma=2e-3, depth_unit=1e-4)
    assert {(u.offset_sigma, u.depth_unit) for u in (D415Config.randomised(seed, base) for seed in range(5))} == {(2e-3, 1e-4)}


def test_a_d435_is_the_same_model_with_its_imagers_nearer_together() -> None:
    plain = D435Config()
    assert plain == D435Config(**vars(replace(D415Config(), baseline=0.050)))
    unit = D435Config.randomised(1)
    assert isinstance(unit, D435Config)
    assert unit.baseline == pytest.approx(0.050, abs=0.3e-3)
    exact = profile_depth(D435_848X480, FLAT, 0.6, tilt=0.1)
    error = middle(d415(exact, D435_848X480, replace(plain, depth_unit=0.0), seed=[0]) - exact)
    assert np.nanstd(error) == pytest.approx(0.6**2 * 0.095 / (424.4 * 0.050), rel=0.15)


@pytest.mark.parametrize("seed", range(6))
def test_any_unit_sees_planes_where_they_are(seed: int) -> None:
    """Focal length and baseline belong to the unit and it knows them: no scale error, and the noise is its own."""
    unit = replace(D415Config.randomised(seed, SMOOTH), spatial_filter=False)
    intrinsics = unit_intrinsics(D415_640X480, unit)
    exact = profile_depth(intrinsics, FLAT, 0.45, tilt=0.1)
    error = middle(d415(exact, intrinsics, unit, seed=[seed]) - exact)
    assert abs(np.nanmean(error)) < 0.2e-3
    law = 0.45**2 * total_sigma(unit.noise) / (intrinsics.fx * unit.baseline)
    assert np.nanstd(error) == pytest.approx(law, rel=0.25)


def test_an_empty_view_gives_an_empty_image() -> None:
    nothing = np.full((480, 640), np.nan, np.float32)
    assert np.isnan(d415(nothing, D415_640X480, D415Config(offset_sigma=1e-3), seed=[0])).all()


@pytest.mark.parametrize(
    ("key", "value"),
    [
        ("baseline", 0.0),
        ("window", -1),
        ("window", 10),
        ("noise_gain", -0.1),
        ("edge_shadow", -1.0),
        ("mixed_pixels", 1.5),
        ("temporal_fraction", 1.5),
    ],
)
def test_impossible_figures_are_refused(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=key):
        D415Config(**{key: value})


def test_a_depth_image_of_another_size_is_refused() -> None:
    with pytest.raises(RecordError, match=r"640.*|shape"):
        d415(np.ones((10, 10), np.float32), D415_640X480, D415Config(), seed=[0])
