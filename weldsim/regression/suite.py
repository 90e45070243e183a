"""regress: every scene, method and seed, in this process or in several, in an order and with figures that do not depend on how."""

import multiprocessing
import os
import signal
import time
from collections.abc import Callable, Iterator, Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor, as_completed
from concurrent.futures.process import BrokenProcessPool
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from numbers import Integral
from pathlib import Path
from typing import TYPE_CHECKING

from weldsim.config import CellConfig
from weldsim.errors import ExecutionError, InputError
from weldsim.inputs import ConfigLike, SceneLike, config_from, scene_from
from weldsim.pipeline import Finder, SensorName
from weldsim.regression.distribution import Judgement, Shift, judge
from weldsim.regression.finders import METHODS, Method, told_apart
from weldsim.regression.golden import Deviation, Golden, read_golden
from weldsim.regression.job import Row, Task, carry_out
from weldsim.scene.files import scene_names

if TYPE_CHECKING:
    from weldsim.scene.config import SceneConfig

Tell = Callable[[str, float | None], None]
"""Told what was finished and the fraction of all tasks done, 0 to 1."""

# A job a core: threads of libraries inside a worker would only take turns with the other workers.
ONE_THREAD = ("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "MKL_NUM_THREADS", "NUMBA_NUM_THREADS", "LP_NUM_THREADS")


@dataclass(frozen=True, kw_only=True)
class Regression:
    """The outcome.

    Attributes:
        rows: by scene, then method, then seed, in the order they were asked for.
        scenes, methods: in that order.  seeds, jobs: as asked.  seconds: from start to end [s].
        judgement: of the figures that are recorded as distributions, over all seeds.
    """

    rows: tuple[Row, ...]
    scenes: tuple[str, ...]
    methods: tuple[str, ...]
    seeds: int
    jobs: int
    seconds: float
    judgement: Judgement = field(default_factory=Judgement)

    @property
    def deviations(self) -> tuple[Deviation, ...]:
        """Every figure of one seed that is worse than it may be."""
        return tuple(deviation for row in self.rows for deviation in row.deviations)

    @property
    def shifts(self) -> tuple[Shift, ...]:
        """Every figure that is worse than it may be over all seeds."""
        return self.judgement.shifts

    @property
    def passed(self) -> bool:
        """Whether nothing is worse than it may be, and no finder failed."""
        return not self.deviations and not self.shifts and not any(row.fault for row in self.rows)

    def of(self, scene: str, method: str) -> tuple[Row, ...]:
        """The rows of one scene and method, a seed each."""
        return tuple(row for row in self.rows if (row.figures.scene, row.figures.method) == (scene, method))


def regress(
    scenes: Sequence[SceneLike] | str | Path | None = None,
    *,
    methods: Sequence[str] = METHODS,
    finders: Mapping[str, Finder] | None = None,
    seeds: int = 3,
    seeds_of: Mapping[str, int] | None = None,
    jobs: int = 1,
    config: ConfigLike | None = None,
    sensor: SensorName = "d415",
    execute: bool = False,
    golden: Golden | Path | str | None = None,
    keep: Path | str | None = None,
    pictures: bool = False,
    tell: Tell | None = None,
) -> Regression:
    """Figures of every scene, method and seed against its known seams, beside golden ones.

    Args:
        scenes: names, TOML files or configs; None = all that come with weldsim.
        methods: seam finders of weldsim's, or the user's as "package.module:function".
        finders: {name: the caller's own}, judged besides.
        seeds: of the camera's noise, 0 to seeds - 1; each scene and seed is scanned once for all methods.
        seeds_of: {method: its own number of seeds}.
        jobs: processes, each with one core (threads of native libraries are held to one); 1 = this process.
        config: settings; its method is replaced by each of `methods`.
        sensor: what looks.  execute: whether the simulated arm welds what was planned.
        golden: figures to judge by, or their file; what it lacks is not judged.
        keep: folder in which what fails leaves its run directory.
        pictures: whether rows of seed 0 carry a picture.
        tell: told of progress.
    Raises:
        InputError: no scene, an unknown or repeated one, no method, seeds or jobs below 1.
        ExecutionError: a worker process died.
    """
    started, tell = time.perf_counter(), tell or (lambda what, done: None)
    chosen = _scenes([scenes] if isinstance(scenes, str | Path) else scenes)
    own, finders = told_apart(methods, finders)
    settings = _settings(config_from(config), own, finders)
    count_of = {method: (seeds_of or {}).get(method, seeds) for method in settings}
    for name, value in (("seeds", seeds), ("jobs", jobs), *count_of.items()):
        if isinstance(value, bool) or not isinstance(value, Integral) or value < 1:
            raise InputError(f"{name} {value!r}: a whole number, 1 or more, is needed", key=name, value=value)
    golden = read_golden(golden) if isinstance(golden, str | Path) else golden
    tasks = [
        Task(
            scene=scene,
            seed=seed,
            methods={method: each for method, each in settings.items() if seed < count_of[method]},
            finders=finders,
            execute=execute,
            golden={} if golden is None else {method: golden.entries(scene.name, method) for method in settings},
            keep=None if keep is None else Path(keep),
            sensor=sensor,
            pictures=pictures and seed == 0,
        )
        for scene in chosen
        for seed in range(max(count_of.values()))
    ]
    with _one_thread():
        done = _in_this_process(tasks, tell) if jobs == 1 else _in_processes(tasks, min(jobs, len(tasks)), tell)
    rows = [row for rows in done for row in rows]
    order = {(scene.name, method): k for k, (scene, method) in enumerate((s, m) for s in chosen for m in settings)}
    rows.sort(key=lambda row: (order[row.figures.scene, row.figures.method], row.figures.seed))
    judgement = judge([row.figures for row in rows], golden or Golden())
    rows = [replace(row, judged=row.judged or (row.figures.scene, row.figures.method) in judgement.judged) for row in rows]
    return Regression(
        rows=tuple(rows),
        judgement=judgement,
        scenes=tuple(scene.name for scene in chosen),
        methods=tuple(settings),
        seeds=seeds,
        jobs=jobs,
        seconds=time.perf_counter() - started,
    )


def _scenes(scenes: Sequence[SceneLike] | None) -> "list[SceneConfig]":
    chosen = []
    for scene in scene_names() if scenes is None else scenes:
        scene = scene_from(scene)
        if scene.name in [other.name for other in chosen]:
            raise InputError(f"scene {scene.name!r} is given twice", scene=scene.name)
        if not scene.name or any(mark in scene.name for mark in ("/", "\\", "\0")) or scene.name.startswith("."):
            raise InputError(f"scene name {scene.name!r} cannot name a folder", scene=scene.name)
        chosen.append(scene)
    if not chosen:
        raise InputError("no scene is given")
    return chosen


def _settings(config: CellConfig, methods: Sequence[Method], finders: Mapping[str, Finder]) -> dict[str, CellConfig]:
    """{method: config}."""
    names = [*methods, *finders]
    if not names or len(set(names)) < len(names):
        raise InputError(f"methods {', '.join(names) or '(none)'}: each once, one at least", methods=names)
    known = {method: replace(config, seam=replace(config.seam, method=method)) for method in methods}
    return known | dict.fromkeys(finders, config)


def _in_this_process(tasks: list[Task], tell: Tell) -> list[tuple[Row, ...]]:
    out = []
    for k, task in enumerate(tasks):
        tell(f"{task.scene.name}, seed {task.seed}", k / len(tasks))
        out.append(carry_out(task))
    return out


def _in_processes(tasks: list[Task], jobs: int, tell: Tell) -> list[tuple[Row, ...]]:
    """Spawned, not forked: OpenGL contexts and thread pools do not survive a fork. Long tasks go first."""
    out: list[tuple[Row, ...]] = [()] * len(tasks)
    longest = sorted(range(len(tasks)), key=lambda k: -len(tasks[k].scene.views))
    try:
        with ProcessPoolExecutor(jobs, mp_context=multiprocessing.get_context("spawn"), initializer=_end_quietly) as pool:
            with _held_back(signal.SIGINT):  # workers start with it held back too
                waiting = {pool.submit(_in_worker, tasks[k]): k for k in longest}
            try:
                for count, future in enumerate(as_completed(waiting), start=1):
                    k = waiting[future]
                    out[k] = future.result()
                    tell(f"{tasks[k].scene.name}, seed {tasks[k].seed}", count / len(tasks))
            except BaseException:
                with _held_back(signal.SIGINT):  # who presses twice does not cut the tidying short
                    pool.shutdown(cancel_futures=True)
                raise
    except BrokenProcessPool:
        raise ExecutionError("a worker process died (out of memory?); use fewer jobs", rule="jobs", value=jobs) from None
    return out


@contextmanager
def _held_back(number: int) -> Iterator[None]:
    """Within the block the signal waits; it takes effect after it."""
    before = signal.pthread_sigmask(signal.SIG_BLOCK, {number})
    try:
        yield
    finally:
        signal.pthread_sigmask(signal.SIG_SETMASK, before)


def _end_quietly() -> None:
    """A worker that starts, or waits for a task, just ends on Ctrl-C; Python would print a traceback.

    Started in the background by a shell (`&`), the command and its workers ignore the key, and go on.
    """
    if signal.getsignal(signal.SIGINT) != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.SIG_DFL)
    signal.pthread_sigmask(signal.SIG_UNBLOCK, {signal.SIGINT})


def _in_worker(task: Task) -> tuple[Row, ...]:
    """`carry_out` in a process of its own; within it Ctrl-C raises, so that what is half-written is removed."""
    before = signal.getsignal(signal.SIGINT)
    if before != signal.SIG_IGN:
        signal.signal(signal.SIGINT, signal.default_int_handler)
    try:
        return carry_out(task)
    finally:
        signal.signal(signal.SIGINT, before)


@contextmanager
def _one_thread() -> Iterator[None]:
    """Native libraries that are loaded, or processes that are started, within the block take one thread."""
    before = {name: os.environ.get(name) for name in ONE_THREAD}
    os.environ.update(dict.fromkeys(ONE_THREAD, "1"))
    try:
        yield
    finally:
        for name, value in before.items():
            os.environ.pop(name) if value is None else os.environ.update({name: value})
