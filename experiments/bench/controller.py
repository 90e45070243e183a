"""How well the virtual controller keeps time: the servoJ loop of the unmodified ur_rtde client, and the RTDE stream itself.

Prints median, p95 and p99 of the period of both, for each profile. Run it on a machine that does nothing else.
"""

import argparse
import json
import math
import os
import socket
import struct
import subprocess
import sys
import time
from itertools import pairwise

import numpy as np

from weldsim.controller.profile import PROFILES
from weldsim.execution.rtde_packet import Packet, PacketReader, PacketType
from weldsim.execution.ur_ports import RTDE

HOSTS = {"cb3": "127.11.0.1", "e": "127.11.0.2"}


def servo_gaps(host: str, period: float, seconds: float) -> np.ndarray:
    """Times [s] between two calls of servoJ, in the loop that ur_rtde's own examples have."""
    import rtde_control
    import rtde_receive

    control, receive = rtde_control.RTDEControlInterface(host), rtde_receive.RTDEReceiveInterface(host)
    q = receive.getActualQ()
    start, count, times = q[1], round(seconds / period), []
    for k in range(count):
        began = control.initPeriod()
        times.append(time.perf_counter())
        q[1] = start + 0.05 * (1 - math.cos(2 * math.pi * k / count))
        control.servoJ(q, 0, 0, period, 0.03, 300)
        control.waitPeriod(began)
    control.servoStop()
    control.stopScript()
    return np.diff(times)


def stream_gaps(host: str, frequency: float, seconds: float) -> np.ndarray:
    """Times [s] between the arrivals of two RTDE data packets."""
    reader, times = PacketReader(), []
    with socket.create_connection((host, RTDE)) as sock:
        for packet in (
            Packet(PacketType.PROTOCOL_VERSION, b"\x00\x02"),
            Packet(PacketType.SETUP_OUTPUTS, struct.pack(">d", frequency) + b"timestamp,actual_q"),
            Packet(PacketType.START, b""),
        ):
            sock.sendall(packet.encode())
        end = time.perf_counter() + seconds
        while (now := time.perf_counter()) < end:
            times += [now for packet in reader.feed(sock.recv(4096)) if packet.type == PacketType.DATA]
    return np.array([b - a for a, b in pairwise(times)])


def summary(gaps: np.ndarray) -> dict[str, float]:
    """Median, 95th and 99th percentile [ms]."""
    return {name: round(float(np.percentile(gaps, q)) * 1e3, 3) for name, q in (("median", 50), ("p95", 95), ("p99", 99))}


def measure(series: str, seconds: float) -> dict[str, dict[str, float]]:
    """Both figures of one profile, the controller in its own process."""
    host, profile = HOSTS[series], PROFILES[series]  # type: ignore[index]
    command = [sys.executable, "-m", "weldsim", "controller", "--profile", series, "--host", host]
    with subprocess.Popen(command, stdout=subprocess.PIPE, text=True) as server:
        assert server.stdout is not None
        server.stdout.readline()
        try:
            return {
                "servoJ loop": summary(servo_gaps(host, profile.period, seconds)),
                "RTDE stream": summary(stream_gaps(host, profile.frequency, seconds)),
            }
        finally:
            server.terminate()
            server.wait()


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seconds", type=float, default=10.0, help="length of each measurement")
    parser.add_argument("--json", action="store_true")
    asked = parser.parse_args()
    figures = {series: measure(series, asked.seconds) for series in HOSTS}
    if asked.json:
        print(json.dumps({"figures": figures, "load": os.getloadavg()}))
        return
    print(f"period [ms] over {asked.seconds:g} s; load average {os.getloadavg()[0]:.1f}")
    for series, rows in figures.items():
        for name, row in rows.items():
            print(f"  {series:4} {name:12} " + "   ".join(f"{key} {value:7.3f}" for key, value in row.items()))


if __name__ == "__main__":
    main()
