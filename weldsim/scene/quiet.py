"""MuJoCo's own log, switched off: it writes MUJOCO_LOG.TXT into whatever folder one works in, and to the console."""

from typing import Any

import mujoco


def keep_quiet() -> None:
    """Nothing; from now on MuJoCo counts its warnings in `MjData.warning` and writes them nowhere."""
    log: Any = mujoco.MjLogConfig.get()
    log.logto_file = log.logto_console = False
    log.set()
