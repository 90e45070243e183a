"""The black box: the last seconds of commands, reports, arc and events, kept in memory and written out when the arm is stopped."""

import io
import zipfile
from collections import deque
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import numpy as np
from jaxtyping import Bool, Float
from numpy import ndarray

from weldsim.errors import InputError, OutputError
from weldsim.output import write_whole
from weldsim.quantity import Second
from weldsim.records import Event, RobotState, Segment

SCHEMA = "weldsim.black-box/1"
MOST_FILES = 10_000


@dataclass(frozen=True, eq=False, kw_only=True)
class BlackBoxRow:
    """One period. Attributes: q, qd, as sent; state, as reported then; arc_asked, arc; s, of the path [m]; segment."""

    q: Float[ndarray, "6"]
    qd: Float[ndarray, "6"]
    state: RobotState
    arc_asked: bool
    arc: bool
    s: float
    segment: Segment


@dataclass(frozen=True, eq=False, kw_only=True)
class BlackBoxRecord:
    """A black box as it was written.

    Attributes:
        reason: why the arm was stopped.  robot, period: which robot, and its period [s].
        t: (k,) time stamps of the reports [s].
        q_cmd, qd_cmd: (k, 6) what was sent [rad], [rad/s].  q_act, qd_act: (k, 6) what was reported.
        position_B, quaternion_wxyz: (k, 3), (k, 4) reported torch tip.
        arc_asked, arc: (k,) arc output as told and as reported.  s: (k,) arc length [m].  segments, modes: k words.
        events: in order, of the same time.
    """

    reason: str
    robot: str
    period: float
    t: Float[ndarray, "k"]
    q_cmd: Float[ndarray, "k 6"]
    qd_cmd: Float[ndarray, "k 6"]
    q_act: Float[ndarray, "k 6"]
    qd_act: Float[ndarray, "k 6"]
    position_B: Float[ndarray, "k 3"]
    quaternion_wxyz: Float[ndarray, "k 4"]
    arc_asked: Bool[ndarray, "k"]
    arc: Bool[ndarray, "k"]
    s: Float[ndarray, "k"]
    segments: tuple[str, ...]
    modes: tuple[str, ...]
    events: tuple[Event, ...]


@dataclass(eq=False)
class BlackBox:
    """A ring of rows. Attributes: memory, how much it keeps [s]; period, time between rows [s]; robot, its name."""

    memory: Second
    period: Second
    robot: str
    rows: deque[BlackBoxRow] = field(init=False)
    events: deque[Event] = field(default_factory=lambda: deque(maxlen=1000))

    def __post_init__(self) -> None:
        self.rows = deque(maxlen=max(1, round(self.memory / self.period)))

    def record(self, reason: str) -> BlackBoxRecord:
        """What the ring holds now."""
        rows = list(self.rows)
        states = [row.state for row in rows]
        first = states[0].t if rows else -np.inf
        return BlackBoxRecord(
            reason=reason,
            robot=self.robot,
            period=self.period,
            t=np.array([state.t for state in states]),
            q_cmd=np.array([row.q for row in rows]).reshape(-1, 6),
            qd_cmd=np.array([row.qd for row in rows]).reshape(-1, 6),
            q_act=np.array([state.q for state in states]).reshape(-1, 6),
            qd_act=np.array([state.qd for state in states]).reshape(-1, 6),
            position_B=np.array([state.X_BT.p for state in states]).reshape(-1, 3),
            quaternion_wxyz=np.array([state.X_BT.quaternion for state in states]).reshape(-1, 4),
            arc_asked=np.array([row.arc_asked for row in rows], bool),
            arc=np.array([row.arc for row in rows], bool),
            s=np.array([row.s for row in rows], float),
            segments=tuple(row.segment.value for row in rows),
            modes=tuple(state.mode for state in states),
            events=tuple(event for event in self.events if event.t >= first),
        )

    def write(self, folder: Path, reason: str) -> Path:
        """A new file in `folder`, which is made where it is missing: black_box-001.npz, or the first number that is free.

        Raises:
            OutputError: it cannot be written.
        """
        try:
            folder.mkdir(parents=True, exist_ok=True)
            names = (folder / f"black_box-{number:03d}.npz" for number in range(1, MOST_FILES))
            path = next(path for path in names if not path.exists())
        except (OSError, StopIteration) as error:
            raise OutputError(f"{folder}: no black box can be written there ({error})", path=str(folder)) from error
        return write_whole(path, _bytes(self.record(reason)))


def _bytes(record: BlackBoxRecord) -> bytes:
    """As an NPZ; words and events are arrays of text."""
    arrays: dict[str, Any] = {name: value for name, value in vars(record).items() if isinstance(value, ndarray)}
    words: dict[str, Any] = {name: np.array(getattr(record, name), str) for name in ("segments", "modes")}
    buffer = io.BytesIO()
    np.savez_compressed(
        buffer,
        schema=SCHEMA,
        reason=record.reason,
        robot=record.robot,
        period=record.period,
        event_t=np.array([event.t for event in record.events], float),
        event_kind=np.array([event.kind for event in record.events], str),
        event_text=np.array([event.text for event in record.events], str),
        **arrays,
        **words,
    )
    return buffer.getvalue()


def read_black_box(path: Path | str) -> BlackBoxRecord:
    """The record in a file that a stop left behind. Raises InputError where it is none."""
    try:
        with np.load(path, allow_pickle=False) as file:
            data = {name: file[name] for name in file.files}
        if str(data.pop("schema")) != SCHEMA:
            raise ValueError("another schema")
        t, kinds, texts = (data.pop(f"event_{name}") for name in ("t", "kind", "text"))
        words = {name: tuple(map(str, data.pop(name))) for name in ("segments", "modes")}
        events = tuple(Event(t=float(a), kind=str(b), text=str(c)) for a, b, c in zip(t, kinds, texts, strict=True))
        alone = {"reason": str(data.pop("reason")), "robot": str(data.pop("robot")), "period": float(data.pop("period"))}
        return BlackBoxRecord(**alone, **words, events=events, **data)
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror or error})", path=str(path)) from error
    except (ValueError, KeyError, TypeError, EOFError, zipfile.BadZipFile) as error:
        raise InputError(f"{path}: is no black box ({error})", path=str(path)) from error
