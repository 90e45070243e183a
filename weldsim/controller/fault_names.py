"""Names of the faults that can be ordered; a file of its own, because the command line needs them before anything else."""

from typing import Literal

FaultName = Literal[
    "protective-stop", "emergency-stop", "stall", "link-drop", "foreign-program", "local-control", "remote-control", "recover"
]
