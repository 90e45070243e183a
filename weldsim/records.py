"""The frozen records that flow between stages.

Arrays are float64 unless said otherwise, copied and read-only. Each record checks its own invariants when built and
raises `RecordError` naming the field. Lengths are metres, angles radians, times seconds; a suffix _B says that the
array is expressed in the robot base.
"""

from dataclasses import dataclass, field
from enum import StrEnum
from typing import Any, Literal

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8
from numpy import ndarray

from weldsim.errors import RecordError
from weldsim.frames import Transform, read_only

MILLIMETRE_SPAN = 5.0  # [m] a cloud or path wider than this was surely written in millimetres

Reference = Literal["opening", "root", "gap_mid"]
Joint = Literal["groove", "butt", "lap", "fillet", "saddle"]


class Segment(StrEnum):
    """What the torch is doing at a path point. The arc may burn in WELD alone."""

    AIR = "air"
    APPROACH = "approach"
    WELD = "weld"
    RETRACT = "retract"


def _store(record: object, name: str, value: Any, *, shape: tuple[int | str, ...], dtype: Any = float, nan: bool = False) -> None:
    """Freeze `value` into field `name` after checking shape (str = any size) and finiteness."""
    array = read_only(np.asarray(value, dtype))
    where = f"{type(record).__name__}.{name}"
    if array.ndim != len(shape) or any(isinstance(want, int) and got != want for got, want in zip(array.shape, shape, strict=True)):
        raise RecordError(f"{where}: shape {array.shape}, expected ({', '.join(map(str, shape))})", field=name)
    if not nan and array.dtype.kind == "f" and not np.isfinite(array).all():
        raise RecordError(f"{where}: {int((~np.isfinite(array)).sum())} values are not finite", field=name)
    object.__setattr__(record, name, array)


def _require(condition: bool, record: object, name: str, message: str) -> None:
    if not condition:
        raise RecordError(f"{type(record).__name__}.{name}: {message}", field=name)


def _check_metres(record: object, name: str, points: ndarray) -> None:
    if len(points):
        with np.errstate(over="ignore"):
            span = max(float(column.max() - column.min()) for column in points.T)  # by column: reducing along axis 0 is slow
        _require(span <= MILLIMETRE_SPAN, record, name, f"spans {span:.4g} m (limit {MILLIMETRE_SPAN:g} m): looks like millimetres")


def _check_unit(record: object, name: str, vectors: ndarray) -> None:
    _require(bool(np.allclose(np.linalg.norm(vectors, axis=-1), 1.0, atol=1e-6)), record, name, "not unit vectors")


def _check_increasing(record: object, name: str, values: ndarray) -> None:
    _require(bool((np.diff(values) > 0).all()), record, name, "not strictly increasing")


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraIntrinsics:
    """A pinhole camera. Pixel (u, v) has its centre at (u + 1/2, v + 1/2), so a drivers' OpenCV-style principal point
    (pixel centres at whole numbers) is half a pixel smaller: use `from_opencv`.

    Attributes:
        width, height: image size [px].
        fx, fy: focal lengths [px].  cx, cy: principal point [px], half-pixel convention.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float

    def __post_init__(self) -> None:
        _require(self.width > 0 and self.height > 0, self, "width", f"{self.width} x {self.height} is no image size")
        _require(bool(np.isfinite([self.fx, self.fy, self.cx, self.cy]).all()), self, "fx", "not finite")
        _require(self.fx > 0 and self.fy > 0, self, "fx", f"focal length ({self.fx}, {self.fy}) px must be positive")

    @classmethod
    def from_opencv(cls, *, width: int, height: int, fx: float, fy: float, cx: float, cy: float) -> "CameraIntrinsics":
        """From figures as OpenCV, ROS and librealsense print them (pixel centres at whole numbers; thesis eq 5.1)."""
        return cls(width=width, height=height, fx=fx, fy=fy, cx=cx + 0.5, cy=cy + 0.5)

    def rays(self) -> Float[ndarray, "h w 3"]:
        """Direction of each pixel's ray in C, z = 1 (so depth times ray is the point)."""
        u = (np.arange(self.width) + 0.5 - self.cx) / self.fx
        v = (np.arange(self.height) + 0.5 - self.cy) / self.fy
        rays = np.ones((self.height, self.width, 3))
        rays[..., 0], rays[..., 1] = u[None, :], v[:, None]
        return rays


@dataclass(frozen=True, eq=False, kw_only=True)
class DepthFrame:
    """One depth image.

    Attributes:
        depth: z-depth along the optical axis [m], float32 (h, w); NaN = no return.
        colour: RGB (h, w, 3) uint8 registered to depth, or None.
        intrinsics: of the depth image.
        X_BC: pose of the camera in the robot base at exposure.
        t: time of exposure [s].
        source: which sensor or file it came from.
    """

    depth: Float32[ndarray, "h w"]
    intrinsics: CameraIntrinsics
    X_BC: Transform
    colour: UInt8[ndarray, "h w 3"] | None = None
    t: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        shape = (self.intrinsics.height, self.intrinsics.width)
        _store(self, "depth", self.depth, shape=shape, dtype=np.float32, nan=True)
        _require(not np.isinf(self.depth).any(), self, "depth", "holds infinite values; use NaN for no return")
        _require(not bool((self.depth <= 0).any()), self, "depth", "holds values <= 0; use NaN for no return")
        if self.colour is not None:
            _store(self, "colour", self.colour, shape=(*shape, 3), dtype=np.uint8)
        _require(self.X_BC.names == "BC", self, "X_BC", f"is X_{self.X_BC.names}")


@dataclass(frozen=True, eq=False, kw_only=True)
class PointCloud:
    """Points on surfaces, in one frame.

    Attributes:
        points: (n, 3) [m], all finite.
        frame: the letter of the frame they are expressed in.
        normals: (n, 3) unit, towards the sensor, or None.
        colours: (n, 3) in [0, 1], or None.
        viewpoints: (k, 3) [m] where the cameras stood, in the same frame; k = 0 when unknown.
        view: (n,) which viewpoint saw each point; None when k <= 1.
        pixel: (n,) row * width + column of each point in its depth image (single organised view), or None.
        intrinsics, X_BC: of that depth image, or None.
    """

    points: Float[ndarray, "n 3"]
    frame: str = "B"
    normals: Float[ndarray, "n 3"] | None = None
    colours: Float[ndarray, "n 3"] | None = None
    viewpoints: Float[ndarray, "k 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    view: Int[ndarray, "n"] | None = None
    pixel: Int[ndarray, "n"] | None = None
    intrinsics: CameraIntrinsics | None = None
    X_BC: Transform | None = None

    def __post_init__(self) -> None:
        _store(self, "points", self.points, shape=("n", 3))
        n = len(self.points)
        _check_metres(self, "points", self.points)
        if self.normals is not None:
            _store(self, "normals", self.normals, shape=(n, 3))
            _check_unit(self, "normals", self.normals)
        if self.colours is not None:
            _store(self, "colours", self.colours, shape=(n, 3))
        _store(self, "viewpoints", self.viewpoints, shape=("k", 3))
        if self.view is not None:
            _store(self, "view", self.view, shape=(n,), dtype=np.int64)
            named = n == 0 or bool(self.view.min() >= 0 and self.view.max() < len(self.viewpoints))
            _require(named, self, "view", "names no viewpoint")
        if self.pixel is not None:
            _store(self, "pixel", self.pixel, shape=(n,), dtype=np.int64)
            _require(self.intrinsics is not None and self.X_BC is not None, self, "pixel", "needs intrinsics and X_BC")

    def __len__(self) -> int:
        return len(self.points)

    def select(self, keep: Bool[ndarray, "n"] | Int[ndarray, "m"]) -> "PointCloud":
        """The points picked by a mask or by indices, with everything that belongs to them."""

        def pick(array: ndarray | None) -> ndarray | None:
            return None if array is None else array[keep]

        return PointCloud(
            points=self.points[keep],
            frame=self.frame,
            normals=pick(self.normals),
            colours=pick(self.colours),
            viewpoints=self.viewpoints,
            view=pick(self.view),
            pixel=pick(self.pixel),
            intrinsics=self.intrinsics,
            X_BC=self.X_BC,
        )

    def sight_origins(self) -> Float[ndarray, "n 3"] | None:
        """Where the camera that saw each point stood (n, 3), or None when unknown."""
        if len(self.viewpoints) == 0:
            return None
        if self.view is None:
            return np.broadcast_to(self.viewpoints[0], self.points.shape)
        return self.viewpoints[self.view]


@dataclass(frozen=True, eq=False, kw_only=True)
class Seam:
    """A weld seam found in a cloud, ordered along travel, expressed in the robot base.

    Attributes:
        points_B: (n, 3) the centre line at `reference` [m].
        s: (n,) arc length [m], from 0.
        tangents_B: (n, 3) unit, along travel.
        normals_B: (n, 3) unit, outward normal of the parent surface (for a groove, minus the inward bisector).
        left_B, right_B: (n, 3) the two lips or toes [m], left as seen looking along travel with the normal up; or None.
        sigma: (n,) standard deviation of the centre line across the seam [m], or None where the method gives none.
        width: mean distance between the lips [m].
        depth: mean depth of the root below the opening, as the sensor showed it [m]; None where not measured.
        residual: rms distance of the data from the fitted cross-sections [m].
        confidence: 0 to 1.
        joint, reference: which kind of joint, and which line of it `points_B` follows.
        closed: whether the last point joins the first.
    """

    points_B: Float[ndarray, "n 3"]
    s: Float[ndarray, "n"]
    tangents_B: Float[ndarray, "n 3"]
    normals_B: Float[ndarray, "n 3"]
    left_B: Float[ndarray, "n 3"] | None = None
    right_B: Float[ndarray, "n 3"] | None = None
    sigma: Float[ndarray, "n"] | None = None
    width: float = 0.0
    depth: float | None = None
    residual: float = 0.0
    confidence: float = 0.0
    joint: Joint = "groove"
    reference: Reference = "opening"
    closed: bool = False

    def __post_init__(self) -> None:
        _store(self, "points_B", self.points_B, shape=("n", 3))
        n = len(self.points_B)
        _require(n >= 2, self, "points_B", f"{n} points; a seam needs two")
        _check_metres(self, "points_B", self.points_B)
        _store(self, "s", self.s, shape=(n,))
        _check_increasing(self, "s", self.s)
        for name in ("tangents_B", "normals_B"):
            _store(self, name, getattr(self, name), shape=(n, 3))
            _check_unit(self, name, getattr(self, name))
        for name in ("left_B", "right_B"):
            if getattr(self, name) is not None:
                _store(self, name, getattr(self, name), shape=(n, 3))
        if self.sigma is not None:
            _store(self, "sigma", self.sigma, shape=(n,))
            _require(bool((self.sigma >= 0).all()), self, "sigma", "negative standard deviation")
        _require(0.0 <= self.confidence <= 1.0, self, "confidence", f"{self.confidence} is outside 0 to 1")

    @property
    def length(self) -> float:
        """Arc length [m]."""
        return float(self.s[-1] - self.s[0])


@dataclass(frozen=True, kw_only=True)
class Rejection:
    """A candidate that looked like a seam and was refused, and why.

    Attributes:
        position_B: its middle [m].  length: its extent [m].  reason: one clause, with the figure and the limit.
    """

    position_B: tuple[float, float, float]
    length: float
    reason: str


@dataclass(frozen=True, kw_only=True)
class Threshold:
    """The detection threshold that was chosen from the cloud itself, and how much it matters.

    Attributes:
        name: what is compared with it.  value, unit: the threshold.  noise: the cloud's own noise in the same unit.
        stability: {factor: greatest movement of the centre line [m] when the threshold is multiplied by factor};
            infinity where the seam is then lost.
    """

    name: str
    value: float
    unit: str
    noise: float
    stability: dict[str, float] = field(default_factory=dict)


@dataclass(frozen=True, eq=False, kw_only=True)
class SeamFindings:
    """What a seam finder returns: seams best first, and why the others were refused.

    Attributes:
        seams: best first; empty when there is none.
        region: (n,) for each point of the cloud, 1 + index of the seam whose groove holds it, 0 for none.
        rejected: candidates refused.
        threshold: the threshold used.
        method: "profile" or "thesis".
    """

    seams: tuple[Seam, ...]
    region: Int[ndarray, "n"]
    rejected: tuple[Rejection, ...] = ()
    threshold: Threshold | None = None
    method: str = "profile"

    def __post_init__(self) -> None:
        _store(self, "region", self.region, shape=("n",), dtype=np.int32)


@dataclass(frozen=True, eq=False, kw_only=True)
class KnownSeam:
    """The true seam of a workpiece, in closed form and sampled; for `report` and tests alone.

    Attributes:
        opening_B: (n, 3) midpoint of the lips [m], at most 0.5 mm apart.
        root_B: (n, 3) the bottom of the groove [m].
        left_B, right_B: (n, 3) the lips [m], left as in `Seam`.
        tangents_B: (n, 3) unit.  bisectors_B: (n, 3) unit, inward: the ideal wire axis.
        s: (n,) arc length of the opening [m].
        name: workpiece and branch.
    """

    opening_B: Float[ndarray, "n 3"]
    root_B: Float[ndarray, "n 3"]
    left_B: Float[ndarray, "n 3"]
    right_B: Float[ndarray, "n 3"]
    tangents_B: Float[ndarray, "n 3"]
    bisectors_B: Float[ndarray, "n 3"]
    s: Float[ndarray, "n"]
    name: str = ""

    def __post_init__(self) -> None:
        _store(self, "opening_B", self.opening_B, shape=("n", 3))
        n = len(self.opening_B)
        for name in ("root_B", "left_B", "right_B", "tangents_B", "bisectors_B"):
            _store(self, name, getattr(self, name), shape=(n, 3))
        _check_unit(self, "tangents_B", self.tangents_B)
        _check_unit(self, "bisectors_B", self.bisectors_B)
        _store(self, "s", self.s, shape=(n,))
        _check_increasing(self, "s", self.s)

    @property
    def length(self) -> float:
        """Arc length of the opening [m]."""
        return float(self.s[-1] - self.s[0])


@dataclass(frozen=True, eq=False, kw_only=True)
class TorchPath:
    """Where the torch tip shall be, ordered.

    Attributes:
        X_BT: n poses of the torch tip: z along the wire towards the work, x along travel.
        s: (n,) arc length of the tip from the path's first point [m], non-decreasing.
        speed: (n,) tip speed [m/s], positive.
        arc_on: (n,) whether the arc burns; true inside WELD only.
        segments: n segment names.
        roll_free: whether rotation about the wire may differ from X_BT.
        sigma: (n,) standard deviation of the tip position across the seam [m], or None.
    """

    X_BT: Transform
    s: Float[ndarray, "n"]
    speed: Float[ndarray, "n"]
    arc_on: Bool[ndarray, "n"]
    segments: tuple[Segment, ...]
    roll_free: bool = True
    sigma: Float[ndarray, "n"] | None = None

    def __post_init__(self) -> None:
        _require(self.X_BT.names == "BT" and len(self.X_BT.batch) == 1, self, "X_BT", "must be a batch of X_BT")
        n = len(self.X_BT)
        _require(n >= 2, self, "X_BT", f"{n} poses; a path needs two")
        _check_metres(self, "X_BT", self.X_BT.p)
        _store(self, "s", self.s, shape=(n,))
        _require(bool((np.diff(self.s) >= 0).all()), self, "s", "decreases")
        _store(self, "speed", self.speed, shape=(n,))
        _require(bool((self.speed > 0).all()), self, "speed", "must be positive")
        _store(self, "arc_on", self.arc_on, shape=(n,), dtype=bool)
        _require(len(self.segments) == n, self, "segments", f"{len(self.segments)} names for {n} poses")
        weld = np.array([segment == Segment.WELD for segment in self.segments])
        _require(not bool((self.arc_on & ~weld).any()), self, "arc_on", "the arc burns outside WELD")
        if self.sigma is not None:
            _store(self, "sigma", self.sigma, shape=(n,))

    @property
    def weld(self) -> slice:
        """The poses of the WELD segment, which is contiguous."""
        index = [i for i, segment in enumerate(self.segments) if segment == Segment.WELD]
        _require(bool(index), self, "segments", "no WELD segment")
        return slice(index[0], index[-1] + 1)


@dataclass(frozen=True, eq=False, kw_only=True)
class JointTrajectory:
    """Joint motion over time.

    Attributes:
        t: (k,) [s], from 0, strictly increasing.
        q, qd, qdd: (k, 6) joint angles [rad], speeds [rad/s], accelerations [rad/s2].
        s: (k,) arc length of the torch path at each instant [m].
        arc_on: (k,).  segments: k names.  joint_names: six.
    """

    t: Float[ndarray, "k"]
    q: Float[ndarray, "k 6"]
    qd: Float[ndarray, "k 6"]
    qdd: Float[ndarray, "k 6"]
    s: Float[ndarray, "k"]
    arc_on: Bool[ndarray, "k"]
    segments: tuple[Segment, ...]
    joint_names: tuple[str, ...]

    def __post_init__(self) -> None:
        _store(self, "t", self.t, shape=("k",))
        k = len(self.t)
        _check_increasing(self, "t", self.t)
        for name in ("q", "qd", "qdd"):
            _store(self, name, getattr(self, name), shape=(k, 6))
        _store(self, "s", self.s, shape=(k,))
        _store(self, "arc_on", self.arc_on, shape=(k,), dtype=bool)
        _require(len(self.segments) == k, self, "segments", f"{len(self.segments)} names for {k} instants")
        _require(len(self.joint_names) == 6, self, "joint_names", "six are needed")


@dataclass(frozen=True, eq=False, kw_only=True)
class RobotState:
    """What the robot reports at one instant, never what was asked of it.

    Attributes:
        t: [s].  q, qd: (6,) [rad], [rad/s].  X_BT: torch tip.  mode: the robot's own word for its state.
    """

    t: float
    q: Float[ndarray, "6"]
    qd: Float[ndarray, "6"]
    X_BT: Transform
    mode: str = "idle"

    def __post_init__(self) -> None:
        for name in ("q", "qd"):
            _store(self, name, getattr(self, name), shape=(6,))


@dataclass(frozen=True, kw_only=True)
class Event:
    """Something that happened while executing. Attributes: t [s], kind, text."""

    t: float
    kind: str
    text: str


@dataclass(frozen=True, eq=False, kw_only=True)
class ExecutionLog:
    """What the arm did, sampled every `period`.

    Attributes:
        t: (k,) [s].  q_cmd: (k, 6) what was sent [rad].  q_act, qd_act: (k, 6) what the robot reported.
        X_BT_act: k poses of the torch tip, measured.
        s_cmd: (k,) arc length of the commanded path [m].  arc_on: (k,).  segments: k names.
        torque: (k, 6) joint torques [Nm], or None.
        events: in order.  robot: which robot.  period: [s].
    """

    t: Float[ndarray, "k"]
    q_cmd: Float[ndarray, "k 6"]
    q_act: Float[ndarray, "k 6"]
    qd_act: Float[ndarray, "k 6"]
    X_BT_act: Transform
    s_cmd: Float[ndarray, "k"]
    arc_on: Bool[ndarray, "k"]
    segments: tuple[Segment, ...]
    period: float
    robot: str
    torque: Float[ndarray, "k 6"] | None = None
    events: tuple[Event, ...] = ()

    def __post_init__(self) -> None:
        _store(self, "t", self.t, shape=("k",))
        k = len(self.t)
        for name in ("q_cmd", "q_act", "qd_act"):
            _store(self, name, getattr(self, name), shape=(k, 6))
        _require(self.X_BT_act.names == "BT" and self.X_BT_act.batch == (k,), self, "X_BT_act", "one measured pose an instant")
        _store(self, "s_cmd", self.s_cmd, shape=(k,))
        _store(self, "arc_on", self.arc_on, shape=(k,), dtype=bool)
        if self.torque is not None:
            _store(self, "torque", self.torque, shape=(k, 6))


@dataclass(frozen=True, kw_only=True)
class LineError:
    """How far a line is from the known seam.

    Attributes:
        mean, rms, p95, max: cross-track distance [m].
        coverage: fraction of the known seam's length that the line covers.
        start, end: distance of each end from the known end, along the seam [m]; positive = overshoot.
        axis_median, axis_p95: angle between wire axis and the known bisector [rad].
        reference: which line of the groove it was measured against.
    """

    mean: float
    rms: float
    p95: float
    max: float
    coverage: float
    start: float
    end: float
    axis_median: float
    axis_p95: float
    reference: Reference = "opening"


@dataclass(frozen=True, eq=False, kw_only=True)
class WeldReport:
    """Figures of one job against the known seam (None where there is none), and the verdict.

    Attributes:
        passed: the verdict.  reasons: what decided it, a clause each.
        plan: planned torch tip against the known seam.  executed: measured torch tip against the known seam.
        tracking_p95, tracking_max: executed tip from the planned line [m].
        speed_error_max, speed_error_p95: relative, on the weld.
        iou: overlap of the groove region found with the true one.
        phantom_seams: seams found that are no seam.
        timing: seconds a stage.  seed, config_digest, versions: what it ran with.
    """

    passed: bool
    reasons: tuple[str, ...]
    scene: str
    method: str
    plan: LineError | None = None
    executed: LineError | None = None
    tracking_p95: float | None = None
    tracking_max: float | None = None
    speed_error_p95: float | None = None
    speed_error_max: float | None = None
    iou: float | None = None
    phantom_seams: int | None = None
    sigma_coverage: tuple[float, float] | None = None
    timing: dict[str, float] = field(default_factory=dict)
    seed: int = 0
    config_digest: str = ""
    versions: dict[str, str] = field(default_factory=dict)
