"""The report of an executed path: what was left to be welded is what it is judged by; a dark arc and a slow pace are told."""

from dataclasses import replace

import numpy as np
import pytest

from tests.seams import findings, found_seam, sine_seam, torch_path, weld_log
from weldsim.config import CellConfig
from weldsim.dryrun.program import Program
from weldsim.records import ExecutionLog, TorchPath, WeldReport
from weldsim.welding.job import JobConfig, job_report
from weldsim.welding.rest import rest_of

KNOWN = sine_seam(np.random.default_rng(4))
SEAM = found_seam(KNOWN, np.full(len(KNOWN.s), 1e-4), every=1)
PATH = torch_path(SEAM)
PROGRAM = Program(source="path.json", kind="path", paths=(PATH,), names=("seam-1",))


def report(path: TorchPath, log: ExecutionLog, job: JobConfig) -> WeldReport:
    found = findings((SEAM,), np.zeros(5, bool))
    return job_report(PROGRAM, found, path, log, CellConfig(), job, scene=None, known=(KNOWN,), stopped=None)


@pytest.mark.parametrize("s", [0.03, 0.069, 0.15])
def test_the_rest_of_a_seam_is_judged_as_all_that_was_to_be_welded(s: float) -> None:
    rest = rest_of(PATH, s, 0.005, "seam-1")
    log = weld_log(replace(rest, s=rest.s - rest.s[0]), np.random.default_rng(0))
    log = replace(log, s_cmd=log.s_cmd + rest.s[0])
    judged = report(rest, log, JobConfig(arc=True, start=s))
    assert judged.passed, judged.reasons
    assert judged.executed is not None
    assert judged.executed.coverage > 0.99
    assert abs(judged.executed.start) < 5e-4
    assert abs(judged.executed.end) < 5e-4
    whole = report(PATH, log, JobConfig(arc=True))  # the same, had all of the seam been wanted
    assert not whole.passed
    assert whole.executed is not None
    assert whole.executed.start == pytest.approx(-(s - 0.005), abs=5e-4)


def test_an_arc_that_was_asked_for_and_never_burned_is_a_failure_and_one_that_was_not_is_none() -> None:
    log = weld_log(PATH, np.random.default_rng(0))
    dark = replace(log, arc_on=np.zeros(len(log.t), bool))
    assert report(PATH, dark, JobConfig(arc=True)).reasons == ("the arc never burned",)
    assert report(PATH, dark, JobConfig(arc=False)).passed


def test_a_weld_at_less_than_its_pace_is_told_with_the_metal_that_it_gets() -> None:
    slow = replace(PATH, speed=0.5 * PATH.speed)
    log = weld_log(slow, np.random.default_rng(0))
    judged = report(slow, log, JobConfig(arc=True, speed_scale=0.5))
    assert judged.passed
    assert judged.warnings == ("welded at 50 % of the path's pace: 2 times the metal for each millimetre",)
    assert report(slow, log, JobConfig(arc=False, speed_scale=0.5)).warnings == ()
