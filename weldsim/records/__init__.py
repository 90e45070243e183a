"""The frozen records that flow between stages.

Arrays are float64 unless said otherwise, copied and read-only. Each record checks its own invariants when built and
raises `RecordError` naming the field. Lengths are metres, angles radians, times seconds; a suffix _B says that the
array is expressed in the robot base.
"""

from weldsim.records.checks import MILLIMETRE_SPAN
from weldsim.records.execution import Event, ExecutionLog, RobotFacts, RobotState
from weldsim.records.motion import JointTrajectory, Segment, TorchPath
from weldsim.records.report import LineError, Pace, WeldProgress, WeldReport
from weldsim.records.seam import Joint, KnownSeam, Reference, Rejection, Seam, SeamFindings, Threshold
from weldsim.records.sensing import CameraIntrinsics, DepthFrame, PointCloud

__all__ = [
    "MILLIMETRE_SPAN",
    "CameraIntrinsics",
    "DepthFrame",
    "Event",
    "ExecutionLog",
    "Joint",
    "JointTrajectory",
    "KnownSeam",
    "LineError",
    "Pace",
    "PointCloud",
    "Reference",
    "Rejection",
    "RobotFacts",
    "RobotState",
    "Seam",
    "SeamFindings",
    "Segment",
    "Threshold",
    "TorchPath",
    "WeldProgress",
    "WeldReport",
]
