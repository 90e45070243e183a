"""Golden figures: what counts as worse, what an update keeps, and which files are refused."""

import json
from dataclasses import replace

import numpy as np
import pytest

from weldsim.errors import InputError
from weldsim.regression import FIGURES, Figures, Golden, compare, default_golden, read_golden, updated, write_golden
from weldsim.regression.figures import Figure
from weldsim.regression.text import sentence

GOOD = Figures(
    scene="made",
    method="profile",
    seed=0,
    known=1,
    found=1,
    mean=0.2e-3,
    p95=0.4e-3,
    max=0.6e-3,
    coverage=0.98,
    axis_median=0.001,
    axis_p95=0.004,
    iou=0.9,
    seconds=0.4,
)
GOLDEN = updated(Golden(), [GOOD], "made up")
MEASURED = [figure for figure in FIGURES.values() if figure.name in GOOD.judged() and figure.tolerance is not None]
JUDGED = [figure for figure in MEASURED if figure.kind != "count"]


def shifted(figure: Figure, by: float) -> Figures:
    """GOOD with one figure worse by that much (better where negative)."""
    value = getattr(GOOD, figure.name)
    return replace(GOOD, **{figure.name: value + (-by if figure.larger_is_better else by)})


@pytest.mark.parametrize("figure", JUDGED, ids=lambda figure: figure.name)
def test_worse_by_more_than_the_tolerance_fails_and_nothing_else_does(figure):
    entries = GOLDEN.entries("made", "profile")
    tolerance = figure.tolerance
    rng = np.random.default_rng(7)
    for share in rng.uniform(0.0, 0.98, 20):
        assert compare(shifted(figure, share * tolerance), entries) == ()
        assert compare(shifted(figure, -100 * share * max(tolerance, 1e-3)), entries) == ()
    for excess in rng.uniform(0.02, 5.0, 20):
        by = tolerance + excess * max(tolerance, 1e-4)
        (deviation,) = compare(shifted(figure, by), entries)
        assert (deviation.scene, deviation.method, deviation.seed, deviation.figure) == ("made", "profile", 0, figure.name)
        assert deviation.excess == pytest.approx(by - tolerance, abs=1e-7)
        assert figure.label in sentence(deviation)
        assert "worse by" in sentence(deviation)


def test_a_seam_more_or_less_is_never_tolerated():
    entries = GOLDEN.entries("made", "profile")
    for name in ("missed", "phantoms"):
        (deviation,) = compare(replace(GOOD, **{name: 1}), entries)
        assert (deviation.figure, deviation.value, deviation.golden, deviation.excess) == (name, 1, 0, 1)


def test_a_figure_that_can_no_longer_be_measured_fails_and_one_that_never_could_does_not():
    lost = Figures(scene="made", method="profile", seed=0, known=1, missed=1, coverage=0.0, seconds=0.1)
    figures = {deviation.figure for deviation in compare(lost, GOLDEN.entries("made", "profile"))}
    assert {"missed", "mean", "p95", "max", "coverage"} <= figures
    nothing = updated(Golden(), [lost], "it never worked").entries("made", "profile")
    assert compare(GOOD, nothing) == ()
    assert compare(lost, nothing) == ()


def test_times_and_seeds_that_were_not_recorded_are_not_judged():
    entries = GOLDEN.entries("made", "profile")
    assert compare(replace(GOOD, seconds=400.0), entries) == ()
    assert compare(replace(GOOD, seed=1, mean=1.0), entries) == ()
    assert compare(replace(GOOD, mean=1.0), {}) == ()


def test_an_update_keeps_tolerances_and_the_reasons_of_what_did_not_change():
    entries = GOLDEN.entries("made", "profile")
    tight = replace(GOLDEN, scenes={"made": {"profile": entries | {"mean": replace(entries["mean"], tolerance=1e-6)}}})
    again = updated(tight, [replace(GOOD, mean=0.3e-3, seconds=0.5)], " the finder changed ").entries("made", "profile")
    assert again["mean"].values == (0.3e-3,)
    assert again["mean"].tolerance == 1e-6
    assert again["mean"].reason == "the finder changed"
    assert again["p95"] == entries["p95"]
    assert again["seconds"] == entries["seconds"]
    other = updated(tight, [replace(GOOD, scene="other")], "new")
    assert set(other.scenes) == {"made", "other"}


def test_a_scene_that_could_not_be_scanned_is_not_recorded():
    unseen = Figures(
        scene="made", method="profile", seed=0, known=1, missed=1, coverage=0.0, refused="scan view 0: no joint solution"
    )
    assert updated(GOLDEN, [unseen], "why").scenes == GOLDEN.scenes


def test_an_update_needs_a_reason_and_seeds_from_0():
    for reason in ("", "  "):
        with pytest.raises(InputError, match="reason"):
            updated(GOLDEN, [GOOD], reason)
    with pytest.raises(InputError, match="seeds 0"):
        updated(GOLDEN, [replace(GOOD, seed=1)], "why")


def test_what_is_written_is_read_back(tmp_path):
    path = write_golden(tmp_path / "golden.json", GOLDEN)
    assert read_golden(path) == GOLDEN
    assert [place.name for place in tmp_path.iterdir()] == ["golden.json"]


def test_the_published_method_is_recorded_as_a_distribution_and_ours_by_seed(tmp_path):
    theirs = updated(GOLDEN, [replace(GOOD, method="thesis", seed=seed) for seed in range(3)], "why")
    assert {entry.judge for entry in theirs.entries("made", "thesis").values()} == {"distribution"}
    assert {entry.judge for entry in theirs.entries("made", "profile").values()} == {"seed"}
    assert read_golden(write_golden(tmp_path / "golden.json", theirs)) == theirs
    assert compare(replace(GOOD, method="thesis", mean=1.0), theirs.entries("made", "thesis")) == ()


def test_a_figure_judged_in_another_way_than_before_is_recorded_anew():
    rows = [replace(GOOD, method="thesis")]
    once = updated(Golden(), rows, "why").entries("made", "thesis")["mean"]
    before = Golden(scenes={"made": {"thesis": {"mean": replace(once, judge="seed", tolerance=2e-3, reason="old")}}})
    again = updated(before, rows, "judged over seeds").entries("made", "thesis")["mean"]
    assert (again.judge, again.tolerance, again.reason) == ("distribution", FIGURES["mean"].tolerance, "judged over seeds")


def test_files_of_the_first_schema_are_judged_by_seed(tmp_path):
    text = broken("schema", value="weldsim.golden/1")
    (tmp_path / "golden.json").write_text(text)
    assert read_golden(tmp_path / "golden.json").entries("made", "profile")["mean"].judge == "seed"


def test_the_golden_file_of_weldsim_is_whole():
    golden = read_golden(default_golden())
    assert golden.scenes
    for methods in golden.scenes.values():
        for entries in methods.values():
            assert {"missed", "phantoms", "phantom_length"} <= set(entries)
            assert not [name for name, entry in entries.items() if "not looked into" in entry.reason]


def broken(*path: str, value: object) -> str:
    """The text of GOLDEN with one place replaced."""
    entry = {"values": [1.0], "tolerance": 0.1, "reason": "why"}
    data = {"schema": "weldsim.golden/2", "scenes": {"made": {"profile": {"mean": entry}}}}
    place = data
    for key in path[:-1]:
        place = place[key]
    place[path[-1]] = value
    return json.dumps(data)


MEAN = ("scenes", "made", "profile", "mean")


@pytest.mark.parametrize(
    "text",
    [
        "",
        "{",
        "[]",
        "null",
        '{"schema": "weldsim.golden/1"}',
        broken("schema", value="weldsim.golden/3"),
        broken("scenes", value=[]),
        broken("scenes", "made", value=3),
        broken("scenes", "made", "profile", value="x"),
        broken("scenes", "made", "profile", "men", value={}),
        broken(*MEAN, value=1.0),
        broken(*MEAN, "values", value=[]),
        broken(*MEAN, "values", value=["1"]),
        broken(*MEAN, "values", value=[True]),
        broken(*MEAN, "values", value=1.0),
        broken(*MEAN, "tolerance", value=-1),
        broken(*MEAN, "tolerance", value="much"),
        broken(*MEAN, "reason", value=" "),
        broken(*MEAN, "reason", value=None),
        broken(*MEAN, "judge", value="mean"),
        broken(*MEAN, "judge", value=["seed"]),
        "[" * 100_000,
    ],
)
def test_a_malformed_golden_file_is_refused_in_one_line(text, tmp_path):
    path = tmp_path / "golden.json"
    path.write_text(text)
    with pytest.raises(InputError) as refused:
        read_golden(path)
    assert str(path) in str(refused.value)
    assert "\n" not in str(refused.value)
