"""The verdict: a good weld passes, each fault alone fails it and is named with its figure and limit."""

import json
import math
import platform
from dataclasses import replace

import numpy as np
import pytest

from tests.seams import findings, found_seam, sine_seam, torch_path, weld_log
from weldsim.curves import arc_length
from weldsim.records import WeldProgress, WeldReport
from weldsim.report.limits import ReportConfig, checks
from weldsim.report.verdict import AMBER, FAILED, PASSED, UNJUDGED, verdict
from weldsim.report.weld import joined, report_json, weld_report


def job(offset: float = 2e-4, seed: int = 0, *, factor: float = 1.0, side: float = 0.0, executed: bool = True) -> WeldReport:
    """A weld `offset` [m] beside the seam, executed `side` [m] beside its plan at `factor` times its speed."""
    rng = np.random.default_rng(seed)
    known = sine_seam(rng)
    seam = found_seam(known, offset + 1e-4 * np.sin(known.s / 0.01))
    path = torch_path(seam)
    driven = torch_path(found_seam(known, offset + side + 1e-4 * np.sin(known.s / 0.01)))
    log = weld_log(driven, rng, factor=factor, jitter=2e-6) if executed else None
    region = rng.random(1000) < 0.3
    return weld_report(
        findings((seam,), region),
        (path,),
        scene="sine",
        log=log,
        known=(known,),
        true_region=region,
        timing={"seam": 0.1},
        seed=seed,
    )


@pytest.mark.parametrize("seed", range(4))
def test_a_good_weld_passes_and_says_by_how_much(seed: int) -> None:
    report = job(seed=seed)
    assert report.passed
    assert any("plan, cross-track mean" in reason and "limit" in reason for reason in report.reasons)
    assert report.plan is not None
    assert report.executed is not None
    assert abs(report.plan.mean - 2e-4) < 2e-5
    assert abs(report.executed.mean - report.plan.mean) < 5e-6
    assert report.tracking_p95 is not None
    assert report.tracking_p95 < 2e-5
    assert report.iou == 1.0


def test_the_opening_found_is_told_beside_the_known_one() -> None:
    known = sine_seam(np.random.default_rng(0))
    report = job()
    assert report.widths is not None
    assert report.widths[1] == pytest.approx(float(np.linalg.norm(known.left_B[0] - known.right_B[0])), rel=1e-6)
    (check,) = [check for check in checks(report, ReportConfig()) if check.figure == "width of the opening"]
    assert check.value == f"{1e3 * report.widths[0]:.1f} mm, known {1e3 * report.widths[1]:.1f} mm"
    assert check.passed is None


FAULTS = {
    "plan, cross-track mean": {"offset": 6e-4},
    "executed tip from plan, p95": {"offset": -3e-4, "side": 6e-4},
    "torch speed error, p95": {"factor": 1.04},
}


@pytest.mark.parametrize("figure", FAULTS)
def test_each_fault_is_named_with_value_and_limit(figure: str) -> None:
    report = job(**FAULTS[figure])
    assert not report.passed
    (reason,) = [reason for reason in report.reasons if reason.startswith(figure)]
    assert "(limit <= " in reason
    assert all("limit" in reason for reason in report.reasons)


def test_every_limit_decides_alone() -> None:
    report = job()
    unlike = {"coverage": 1.1, "phantoms": -1, "least_speed": 1.1, "most_speed": 0.5}
    tight = {
        field: unlike.get(field, -1.0)
        for field in ReportConfig.__dataclass_fields__
        if field not in ("stretch", "pace", "reason")  # which say how, and why
    }
    names = set()
    for field, limit in tight.items():
        failed = [c.figure for c in checks(report, replace(ReportConfig(), **{field: limit})) if c.passed is False]
        assert failed, field
        names |= set(failed)
    assert names == {c.figure for c in checks(report, ReportConfig()) if c.passed is not None}


def test_missed_and_phantom_seams_fail() -> None:
    rng = np.random.default_rng(3)
    known = sine_seam(rng)
    far = found_seam(known, np.full(len(known.s), 0.03))
    region = np.zeros(10, bool)
    report = weld_report(findings((far,), region), (torch_path(far),), scene="x", known=(known,))
    assert report.phantom_seams == 1
    assert report.plan is None
    assert any("sine was not found" in reason for reason in report.reasons)
    assert "seam 1, the one judged, lies on no known seam" in report.reasons
    assert any(reason.startswith("phantom seams 1") for reason in report.reasons)
    plain = weld_report(findings((), region), (), scene="plate", known=())
    assert plain.passed
    assert weld_report(findings((), region), (), scene="plate").reasons == ("no seam was found",)
    assert weld_report(findings((far,), region), (torch_path(far),), scene="scan").passed


def test_a_piece_of_a_seam_is_judged_against_the_whole_of_it() -> None:
    known = sine_seam(np.random.default_rng(3))
    whole = found_seam(known, np.full(len(known.s), 2e-4))
    half = slice(0, len(whole.s) // 2)
    piece = replace(
        whole,
        points_B=whole.points_B[half],
        s=whole.s[half],
        tangents_B=whole.tangents_B[half],
        normals_B=whole.normals_B[half],
        left_B=None,
        right_B=None,
        sigma=None,
    )
    report = weld_report(
        findings((piece, whole), np.zeros(5, bool)), (torch_path(piece), torch_path(whole)), scene="x", known=(known,)
    )
    assert not report.passed
    assert report.plan is not None
    assert 0.4 < report.plan.coverage < 0.6
    assert "seam 1, the one judged, is a piece of known seam sine" in report.reasons
    assert report.phantom_seams == 0


def test_an_arc_that_never_burned_is_a_failure() -> None:
    rng = np.random.default_rng(4)
    known = sine_seam(rng)
    seam = found_seam(known, np.zeros(len(known.s)))
    path = torch_path(seam)
    log = weld_log(path, rng)
    dark = replace(log, arc_on=np.zeros(len(log.t), bool))
    report = weld_report(findings((seam,), np.zeros(5, bool)), (path,), scene="x", log=dark, known=(known,))
    assert "the arc never burned" in report.reasons
    assert report.executed is None


def test_json_is_strict_and_complete() -> None:
    report = replace(job(), iou=math.nan)
    data = json.loads(json.dumps(report_json(report), allow_nan=False))
    assert data["schema"] == "weldsim.report/1"
    assert data["iou"] is None
    assert data["plan"]["mean"] == report.plan.mean  # type: ignore[union-attr]
    assert len(data["checks"]) == len(checks(report, ReportConfig()))
    assert set(WeldReport.__dataclass_fields__) <= set(data)
    assert "weldsim" in data["versions"]


def ended(start: float, end: float, **limits: float) -> WeldReport:
    """A weld that begins and ends so far beyond the known seam [m]; short of it where negative."""
    known = sine_seam(np.random.default_rng(6))
    keep = (known.s >= -start) & (known.s <= known.s[-1] + end)
    seam = found_seam(known, np.zeros(len(known.s)), every=1)
    s = known.s[keep] - known.s[keep][0]
    points, more = seam.points_B[keep], {name: getattr(seam, name)[keep] for name in ("tangents_B", "normals_B")}
    for beyond, place, where in ((start, 0, 0), (end, -1, len(s))):
        if beyond > 0:
            t = known.tangents_B[place] * (1 if place else -1)
            points = np.insert(points, where, known.opening_B[place] + beyond * t, axis=0)
            more = {name: np.insert(values, where, values[place], axis=0) for name, values in more.items()}
    seam = replace(seam, points_B=points, s=arc_length(points), **more, left_B=None, right_B=None, sigma=None)
    path, config = torch_path(seam), ReportConfig(**limits)
    log = weld_log(path, np.random.default_rng(0))
    return weld_report(findings((seam,), np.zeros(5, bool)), (path,), scene="x", log=log, known=(known,), config=config)


@pytest.mark.parametrize(("start", "end"), [(-4e-3, 0.0), (0.0, -4e-3), (4e-3, 0.0), (0.0, 4e-3), (-4e-3, -4e-3)])
def test_each_end_is_held_to_3_mm_short_and_beyond(start: float, end: float) -> None:
    report = ended(start, end)
    assert not report.passed
    told = [f"{who}, {name} of the seam" for who in ("plan", "executed") for name, off in (("start", start), ("end", end)) if off]
    assert [reason.partition("the seam")[0] + "the seam" for reason in report.reasons] == told
    word = "short" if min(start, end) < 0 else "beyond"
    assert all(f" mm {word} (limit <= 3 mm)" in reason for reason in report.reasons)
    assert ended(start / 2, end / 2).passed
    loose = ended(start, end, ends=6e-3)
    assert loose.passed
    assert len(loose.warnings) == len(told)  # a limit that is looser than the general one is told


def test_the_headline_says_how_many_of_how_many_were_welded() -> None:
    rng = np.random.default_rng(8)
    known = tuple(replace(sine_seam(rng), name=f"branch {i + 1}") for i in range(3))
    seams = tuple(found_seam(each, np.zeros(len(each.s))) for each in known)
    paths = tuple(torch_path(seam) for seam in seams)
    found = findings(seams, np.zeros(5, bool))

    def report(i: int, factor: float = 1.0) -> WeldReport:
        log = weld_log(paths[i], np.random.default_rng(0), factor=factor)
        return weld_report(found, paths, scene="y", log=log, known=known, welded=i)

    one = report(1)
    assert one.warnings == ("1 of 3 seams welded",)
    assert verdict(one, 3, ReportConfig()) == (AMBER, "1 of 3 seams welded; all 21 limits kept")
    whole = joined((report(0), report(1), report(2)))
    assert whole.warnings == ()
    assert verdict(whole, 3, ReportConfig()) == (PASSED, "3 of 3 seams welded; all 61 limits kept")
    assert sum(check.figure.startswith("seam 3: ") for check in checks(whole, ReportConfig())) > 10
    two = joined((report(0), report(2)))
    assert verdict(two, 3, ReportConfig())[1].startswith("2 of 3 seams welded")
    bad = joined((report(0), report(1, factor=1.04), report(2)))
    assert not bad.passed
    assert [reason.partition(", p95")[0] for reason in bad.reasons] == ["seam 2: torch speed error"]
    assert verdict(bad, 3, ReportConfig())[0] == FAILED


def test_what_nothing_is_known_of_is_a_dash_and_not_judged() -> None:
    known = sine_seam(np.random.default_rng(3))
    seam = found_seam(known, np.zeros(len(known.s)))
    why = (("phantom seams", "no seam is known"),)
    report = weld_report(findings((seam,), np.zeros(5, bool)), (torch_path(seam),), scene="mine", unjudged=why)
    assert report.passed
    (row,) = checks(report, ReportConfig())
    assert (row.figure, row.value, row.limit, row.passed) == ("phantom seams", "-", "no seam is known", None)
    assert verdict(report, 1, ReportConfig()) == (UNJUDGED, "no known seam to compare with; 1 found")


def test_a_looser_limit_that_is_needed_is_amber_in_a_plan_too() -> None:
    own = ReportConfig(mean=1e-3)
    report = job(offset=6e-4, executed=False)
    assert not report.passed
    rng = np.random.default_rng(0)
    known = sine_seam(rng)
    seam = found_seam(known, np.full(len(known.s), 6e-4))
    loose = weld_report(findings((seam,), np.zeros(5, bool)), (torch_path(seam),), scene="x", known=(known,), config=own)
    assert loose.passed
    assert loose.warnings == ("plan, cross-track mean 0.600 mm (limit <= 1 mm): the general limit is 0.4 mm",)
    assert verdict(loose, 1, own) == (AMBER, "all 9 limits kept, 1 warning")
    tight = weld_report(
        findings((seam,), np.zeros(5, bool)), (torch_path(seam),), scene="x", known=(known,), config=replace(own, mean=5e-4)
    )
    assert not tight.passed
    assert tight.warnings == ()


def test_what_was_not_planned_and_how_far_a_stopped_weld_came_are_kept() -> None:
    known = sine_seam(np.random.default_rng(3))
    seam = found_seam(known, np.zeros(len(known.s)))
    came = WeldProgress(length=0.2, s_from=0.0, s_to=0.05, welded=0.05, arc=True, position_B=(0.0, -0.5, 0.1))
    whole = weld_report(findings((seam,), np.zeros(5, bool)), (torch_path(seam),), scene="x", known=(known,), unplanned=("seam 2",))
    assert (whole.progress, whole.unplanned) == (None, ("seam 2",))
    stopped = weld_report(
        findings((seam,), np.zeros(5, bool)), (torch_path(seam),), scene="x", known=(known,), stopped="the operator", progress=came
    )
    assert (stopped.progress, stopped.stopped) == (came, "the operator")
    both = joined((whole, replace(stopped, seam=2)))
    assert (both.progress, both.stopped, both.unplanned) == (came, "the operator", ("seam 2",))


def test_json_says_its_units_and_each_check_in_the_same_words() -> None:
    report, config = job(), ReportConfig()
    data = report_json(report)
    assert data["units"] == {"length": "m", "angle": "rad", "time": "s"}
    listed = [(c["figure"], c["value"], c["limit"], c["passed"], c["amber"]) for c in data["checks"]]
    assert listed == [(c.figure, c.value, c.limit, c.passed, c.amber or None) for c in checks(report, config)]
    assert data["versions"]["python"] == platform.python_version()
    assert set(data["versions"]) >= {"python", "weldsim", "numpy", "scipy"}
