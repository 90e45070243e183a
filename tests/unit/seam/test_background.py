"""A groove stands out against what its own surface does elsewhere; waves of a depth camera do not."""

import numpy as np
import pytest
from numpy import ndarray

from tests.clouds import groove_cloud
from weldsim.cloud.files import read_cloud
from weldsim.records import PointCloud
from weldsim.seam.config import ProfileConfig
from weldsim.seam.profile.background import Standing
from weldsim.seam.profile.find import find_seams_profile
from weldsim.seam.profile.judge import DOUBTFUL, FOUND, MOST_LAPSES, doubt, most_lapses
from weldsim.sensor.noise import NoiseField, disparity_noise

CONFIG = ProfileConfig()
WAVES = (NoiseField(sigma=0.09, along_rows=13.0, along_columns=8.6), NoiseField(sigma=0.045, along_rows=60.0, along_columns=40.0))


def wavy_plate(seed: int, depth: float = 0.0, distance: float = 0.6, tilt: float = 0.0, table: bool = False) -> PointCloud:
    """A plate of 300 x 300 mm under a D415's noise [m], with a smooth furrow 14 mm wide and `depth` deep along x.

    Args:
        distance: from the camera [m].  tilt: of the plate about x [rad].  table: whether a table lies 0.3 m behind it.
    """
    rng = np.random.default_rng(seed)
    h, w, f, scale = 400, 400, 617.0, 617.0 * 0.055
    v, u = np.mgrid[:h, :w] + 0.5
    rays = np.stack([(u - w / 2) / f, (v - h / 2) / f, np.ones((h, w))], axis=-1)
    z = distance / (1.0 - np.tan(tilt) * rays[..., 1])
    points = rays * z[..., None]
    across = points[..., 1] / np.cos(tilt)
    furrow = depth * np.cos(np.pi * across / 0.014) ** 2 * (np.abs(across) < 0.007) * (np.abs(points[..., 0]) < 0.12)
    z = z + furrow
    on_plate = (np.abs(points[..., 0]) < 0.15) & (np.abs(across) < 0.15)
    z = np.where(on_plate, z, distance + 0.3 if table else np.nan)
    noisy = scale / (scale / z + disparity_noise(WAVES, (h, w), 0.0, rng, rng))
    points = (rays * noisy[..., None])[np.isfinite(z)]
    return PointCloud(
        points=points @ np.diag([1.0, -1.0, -1.0]) + [0.0, -0.5, distance], viewpoints=np.array([[0.0, -0.5, distance]])
    )


@pytest.mark.parametrize("seed", range(4))
@pytest.mark.parametrize("distance", [0.4, 0.6])
def test_waves_of_a_bare_plate_are_no_groove(distance: float, seed: int) -> None:
    assert find_seams_profile(wavy_plate(seed, distance=distance), CONFIG).seams == ()


@pytest.mark.parametrize("seed", range(3))
def test_a_furrow_that_the_waves_cannot_make_is_found(seed: int) -> None:
    (seam,) = find_seams_profile(wavy_plate(seed, depth=0.006), CONFIG).seams
    assert np.abs(seam.points_B[:, 1] + 0.5).mean() < 0.6e-3
    assert seam.length == pytest.approx(0.24, abs=0.035)  # where it fades into the waves is not to be seen to a centimetre


def test_a_furrow_no_deeper_than_the_waves_is_not_found() -> None:
    assert find_seams_profile(wavy_plate(1, depth=0.0008), CONFIG).seams == ()


@pytest.mark.parametrize(
    ("score", "told"), [(FOUND + 0.1, None), (FOUND - 0.1, True), (DOUBTFUL + 0.1, True), (DOUBTFUL - 0.1, False)]
)
def test_what_may_be_a_groove_is_told_apart_from_waves(score: float, told: bool | None) -> None:
    """Of four independent stretches a line that chooses its way gains two deviations, and two may lie in one odd place."""
    ratio = 2.0 + score * np.sqrt(1.5)
    why = doubt([Standing(ratio=ratio, looks=4.0, spread=0.2, alike=2.0, elsewhere=900)])
    assert (None if why is None else why[1]) is told
    assert why is None or ("doubtful" in why[0]) is told


def test_pieces_of_one_seam_stand_out_together() -> None:
    one = Standing(ratio=2.0 + 0.8 * FOUND * np.sqrt(1.5), looks=4.0, spread=0.2, alike=2.0, elsewhere=900)
    assert doubt([one]) is not None
    assert doubt([one, one]) is None
    unseen = doubt([None, None])
    assert unseen is not None, "what no chart shows is no groove"
    assert "too little of it shows together with 10 mm of surface" in unseen[0], "it was compared with nothing"
    assert not unseen[1]


def test_short_grooves_may_hardly_fade_on_the_way() -> None:
    """Two holes 30 mm apart, looked at over 25 mm, are one groove of 50 mm whose depth is absent over a seventh of it."""
    assert most_lapses(0.05, 0.025) < 1 / 14
    assert most_lapses(0.05, 0.007) == most_lapses(0.24, 0.025) == MOST_LAPSES
    assert most_lapses(0.02, 0.025) == 0


def test_few_looks_are_believed_less() -> None:
    """A dent of a bare table is as deep as its waves are nowhere else, over as little as two of their lengths."""
    few, many = (Standing(ratio=7.5 + np.sqrt(looks), looks=looks, spread=0.2, alike=2.0, elsewhere=900) for looks in (2.0, 12.0))
    assert doubt([few]) is not None
    assert doubt([many]) is None


@pytest.mark.parametrize(("elsewhere", "sighted", "found"), [(0, True, True), (0, False, False), (40, False, True)])
def test_what_nothing_can_be_compared_with_is_doubtful_without_a_viewpoint(elsewhere: int, sighted: bool, found: bool) -> None:
    why = doubt([Standing(ratio=30.0, looks=9.0, spread=0.1, alike=1.0, elsewhere=elsewhere, sighted=sighted)])
    assert (why is None) is found
    assert why is None or why[1], "it may be one"


@pytest.mark.parametrize("view", ["known", "unknown"])
def test_a_table_behind_a_tilted_plate_is_no_background_of_its_groove(view: str) -> None:
    cloud = wavy_plate(0, depth=0.006, tilt=0.6, table=True)
    if view == "unknown":
        cloud = PointCloud(points=cloud.points)
    seams = find_seams_profile(cloud, CONFIG).seams
    assert len(seams) == 1
    assert seams[0].confidence > 0.5


def test_confidence_tells_a_clear_groove_from_a_faint_one() -> None:
    clear, faint = (find_seams_profile(wavy_plate(2, depth=depth), CONFIG).seams[0] for depth in (0.010, 0.005))
    assert clear.confidence > faint.confidence


@pytest.mark.parametrize(
    "name", ["wavy_table/a", "wavy_table/b", "wavy_table/c", "wavy_table/d", "fin_shadow/fin", "tee_tubes/tee"]
)
@pytest.mark.parametrize("viewpoint", [[(0.0, -0.75, 0.75)], [(0.0, 0.0, 0.6)], []], ids=["true", "wrong", "none"])
def test_real_tables_shadows_and_holes_hold_no_groove(real_data, name: str, viewpoint: list) -> None:
    cloud = read_cloud(real_data / f"{name}.pcd")
    seen: ndarray = np.array(viewpoint, float).reshape(-1, 3)
    assert find_seams_profile(PointCloud(points=cloud.points, viewpoints=seen), CONFIG).seams == ()


@pytest.mark.parametrize("name", ["a", "b", "c", "d"])
def test_another_sample_of_a_real_table_holds_no_groove_either(real_data, name: str) -> None:
    """Other tables are to be had only by leaving points out, and by mirroring."""
    points = read_cloud(real_data / f"wavy_table/{name}.pcd").points
    for seed in range(2):
        keep = np.random.default_rng(seed).random(len(points)) < 0.8
        cloud = PointCloud(points=points[keep] * [1 - 2 * seed, 1, 1], viewpoints=np.array([[0.0, -0.75, 0.75]]))
        assert find_seams_profile(cloud, CONFIG).seams == ()


@pytest.mark.parametrize("seed", range(2))
def test_grooves_side_by_side_do_not_hide_each_other(seed: int) -> None:
    """Each is the other's surroundings."""
    one = groove_cloud(np.random.default_rng(seed), noise="d415", width=0.012, depth=0.007, offset=0.03)
    other = groove_cloud(np.random.default_rng(seed), noise="d415", width=0.012, depth=0.007, offset=-0.03)
    _, a, b = np.intersect1d(one.cloud.pixel, other.cloud.pixel, return_indices=True)
    first, second = one.cloud.points[a], other.cloud.points[b]
    both = np.where((first[:, 2] < second[:, 2])[:, None], first, second)
    cloud = PointCloud(points=both, viewpoints=one.cloud.viewpoints)
    assert len(find_seams_profile(cloud, CONFIG).seams) == 2
