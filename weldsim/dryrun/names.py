"""Names of frames that poses in files are of; a file of its own, because the command line needs them before anything else."""

from typing import Literal

Tool = Literal["torch", "tool0"]
Base = Literal["controller", "base_link"]
