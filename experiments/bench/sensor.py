"""Milliseconds a view of each camera on the grooved plate, median and least: python experiments/bench/sensor.py [--json].

The wrist cameras at 640 x 480, the Kinect v2 at 512 x 424 from over the table. The parametric D415 comes on top of an exact
view; the others contain their rendering. Limits: 60, 1000 and 500 ms on an idle machine with two cores.
"""

import argparse
import json
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from weldsim.mounts import KINECT_V2
from weldsim.opengl import rendering_backend
from weldsim.scene.config import SceneConfig
from weldsim.scene.world import build_world
from weldsim.sensor.active_stereo import D415Stereo
from weldsim.sensor.base import DepthSensor, Finish, View
from weldsim.sensor.choose import posture, stations
from weldsim.sensor.d415 import D415Config, d415
from weldsim.sensor.exact import ExactSensor, twin_scene
from weldsim.sensor.kinect import KinectConfig
from weldsim.sensor.time_of_flight import KinectV2


def milliseconds(action: Callable[[], object], repeats: int) -> tuple[float, float]:
    """Median and least of `repeats` runs, after two to warm up."""
    times = []
    for _ in range(repeats + 2):
        start = time.perf_counter()
        action()
        times.append(1e3 * (time.perf_counter() - start))
    return median(times[2:]), min(times[2:])


def measure(repeats: int) -> dict[str, tuple[float, float]]:
    """{what: ms a view, median and least}."""
    world = build_world(SceneConfig())
    data = world.new_data(world.view_joints(0))
    view = View(X_BC=world.views[0])
    out = {}
    for backend in dict.fromkeys((rendering_backend(), "embree")):
        for colour in (False, True):
            sensor = ExactSensor(twin_scene(world, data), world.intrinsics, backend=backend, colour=colour)
            name = f"exact {backend}, depth and labels" + (" and colour" if colour else "")
            out[name] = milliseconds(lambda sensor=sensor: sensor.capture(view), repeats)
            depth = np.asarray(sensor.capture(view).frame.depth)
            sensor.close()
    out["D415Fast, on top of depth and labels"] = milliseconds(
        lambda: d415(depth, world.intrinsics, D415Config(), seed=[0]), repeats
    )
    finishes = np.full(depth.shape, Finish.GROUND, np.uint8)
    out["D415Fast, ground steel"] = milliseconds(
        lambda: d415(depth, world.intrinsics, D415Config(), seed=[0], finishes=finishes), repeats
    )
    out["D415Stereo, whole view"] = _whole(D415Stereo(twin_scene(world, data), world.intrinsics), view, repeats)
    above, look = twin_scene(world, world.new_data(posture(world, "kinect", 0))), View(X_BC=stations(world, "kinect")[0])
    for name, config in (
        ("whole view", KinectConfig()),
        ("3 x 3 rays", KinectConfig(supersample=3)),
        ("8 bounces", KinectConfig(bounces=8)),
    ):
        out[f"KinectV2, {name}"] = _whole(KinectV2(above, KINECT_V2, config), look, repeats)
    return out


def _whole(sensor: DepthSensor, view: View, repeats: int) -> tuple[float, float]:
    """Of whole captures."""
    took = milliseconds(lambda: sensor.capture(view), repeats)
    sensor.close()
    return took


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--repeats", type=int, default=11)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    figures = measure(options.repeats)
    if options.json:
        rounded = {name: {"median": round(middle, 2), "least": round(least, 2)} for name, (middle, least) in figures.items()}
        print(json.dumps(rounded, indent=2))
        return
    for name, (middle, least) in figures.items():
        print(f"{name:44s} {middle:7.1f} ms, least {least:7.1f}")


if __name__ == "__main__":
    main()
