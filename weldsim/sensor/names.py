"""Names of the simulated cameras; a file of its own, because the command line needs them before anything else."""

from typing import Literal

SensorName = Literal["d415", "d435", "d415-stereo", "kinect", "exact"]
