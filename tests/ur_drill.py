"""A controller that keeps a record of its own and strikes: how long arc and arm went on is read there, in its own time."""

import tempfile
from collections.abc import Iterator
from contextlib import contextmanager
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from experiments import drill_cell
from tests.controllers import free_address, wait_for
from weldsim.execution.ur_config import Series
from weldsim.execution.ur_modes import RuntimeState

AT_REST = 0.02  # [rad/s]
STAYS = 0.25  # [s] for which arc and arm must have been at rest to be believed
DRILL = Path(drill_cell.__file__).with_name("drill_controller.py")


class HeldUpError(Exception):
    """The machine stopped the weld before the fault could: nothing can be said of the fault."""


@dataclass(frozen=True, eq=False)
class Record:
    """Every control period since `watch`.

    Attributes:
        t (k,) [s].  arc, moving, playing (k,): output 0, a joint over AT_REST, a program that runs.
        struck: when [s], or None.  log: the controller's own messages.
    """

    t: np.ndarray
    arc: np.ndarray
    moving: np.ndarray
    playing: np.ndarray
    struck: float | None
    log: list[tuple[float, str]]

    @property
    def welding(self) -> bool:
        """Whether it does by now."""
        return bool(len(self.t) and self.arc[-1] and self.moving[-1] and self.playing[-1])

    def over(self, calm: bool) -> bool:
        """Whether some time has gone by since the strike; with `calm`, with arc and arm at rest."""
        last = self.t > self.t[-1] - STAYS
        gone = self.struck is not None and self.t[-1] - self.struck > STAYS
        return gone and not (calm and (self.arc | self.moving)[last].any())

    def after(self, what: np.ndarray) -> float:
        """How long [s] after the strike it was last so."""
        assert self.struck is not None
        late = self.t[what & (self.t >= self.struck)]
        return float(late[-1] - self.struck) if len(late) else 0.0


class Drill:
    """That controller. Attributes: series, host."""

    def __init__(self, series: Series, host: str, speaker: drill_cell.Speaker, folder: Path) -> None:
        self.series: Series = series
        self.host, self._speaker, self._file = host, speaker, folder / "rows.npz"

    def watch(self) -> None:
        """A new record; what was broken works again."""
        self._speaker.ask(mend=True)
        self._speaker.ask(watch=True)

    def record(self) -> Record:
        """What has been recorded so far."""
        answer = self._speaker.ask(rows=str(self._file))
        with np.load(self._file) as rows:
            t, arc, speed, runtime = (rows[name] for name in ("t", "arc", "speed", "runtime"))
        struck = answer["struck"][0][0] if answer["struck"] else None
        log = [(float(at), str(text)) for at, text in answer["log"]]
        return Record(t, arc > 0, speed > AT_REST, runtime == RuntimeState.PLAYING, struck, log)

    def strike(self, *acts: str, seconds: float = 1.0, calm: bool = True, **pids: int) -> Record:
        """The record, once arc and arm have come to rest after these faults at once; without `calm`, after some time.

        Raises:
            HeldUpError: there was no weld any longer.
        """
        self._speaker.ask(strike={"after": "now", "delay": 0.0, "acts": [(0.0, act, seconds) for act in acts]}, pids=pids)
        assert wait_for(lambda: self.record().over(calm), step=0.05), self.record().log
        record = self.record()
        if not record.playing[record.t == record.struck].all():  # which is how it was before
            raise HeldUpError(record.log)
        return record


@contextmanager
def drilled(series: Series) -> Iterator[Drill]:
    """A controller of a series that drops output 0 when no program runs, until the block ends."""
    host = free_address()
    with tempfile.TemporaryDirectory() as folder:
        speaker = drill_cell.Speaker(str(DRILL), "--profile", series, "--host", host)
        try:
            assert speaker.hear() == {"serving": host}, speaker.heard
            yield Drill(series, host, speaker, Path(folder))
        finally:
            speaker.end()


def calm(now: dict[str, Any]) -> bool:
    """Whether a controller's status says that arc and arm are at rest."""
    return not now["digital_out"] & 1 and max(map(abs, now["qd"])) < AT_REST
