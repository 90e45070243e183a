"""A weld by the unmodified ur_rtde client, in a process of its own, `python -m tests.ur_weld ADDRESS PERIOD`.

Digital output 0 is the arc. Prints WELDING once the arm moves, and ENDED when the controller's program has ended.
"""

import math
import sys
import time

import rtde_control
import rtde_io
import rtde_receive


def weld(host: str, period: float) -> None:
    control = rtde_control.RTDEControlInterface(host)
    receive, io = rtde_receive.RTDEReceiveInterface(host), rtde_io.RTDEIOInterface(host)
    q = receive.getActualQ()
    start = q[0]
    control.setWatchdog(6.0)  # as weldsim's own client
    io.setStandardDigitalOut(0, True)
    began = time.perf_counter()
    told = False
    while control.isProgramRunning() and time.perf_counter() - began < 20:
        tick = control.initPeriod()
        elapsed = time.perf_counter() - began
        q[0] = start + 0.3 * math.sin(elapsed)
        control.servoJ(q, 0, 0, period, 0.05, 300)
        if elapsed > 0.4 and not told:
            told = True
            print("WELDING", flush=True)
        control.waitPeriod(tick)
    print("ENDED", flush=True)


if __name__ == "__main__":
    weld(sys.argv[1], float(sys.argv[2]))
