"""Milliseconds a view of each sensor on the grooved plate, 640 x 480: python experiments/bench/sensor.py [--json]."""

import argparse
import json
import time
from collections.abc import Callable
from statistics import median

import numpy as np

from weldsim.scene.config import SceneConfig
from weldsim.scene.world import build_world
from weldsim.sensor.backend import rendering_backend
from weldsim.sensor.base import View
from weldsim.sensor.d415 import D415Config, d415
from weldsim.sensor.exact import ExactSensor, twin_scene


def milliseconds(action: Callable[[], object], repeats: int) -> float:
    """Median of `repeats` runs, after two to warm up."""
    times = []
    for _ in range(repeats + 2):
        start = time.perf_counter()
        action()
        times.append(1e3 * (time.perf_counter() - start))
    return median(times[2:])


def measure(repeats: int) -> dict[str, float]:
    """{what: ms a view}."""
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
    out["D415 model"] = milliseconds(lambda: d415(depth, world.intrinsics, D415Config(), seed=[0]), repeats)
    return out


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--repeats", type=int, default=21)
    parser.add_argument("--json", action="store_true")
    options = parser.parse_args()
    figures = measure(options.repeats)
    if options.json:
        print(json.dumps({name: round(value, 2) for name, value in figures.items()}, indent=2))
        return
    for name, value in figures.items():
        print(f"{name:42s} {value:7.1f} ms")


if __name__ == "__main__":
    main()
