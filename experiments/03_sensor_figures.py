"""What the simulated cameras do to simple surfaces, beside the figures they should reproduce (V1 to V10).

Targets of V2 and V3 were measured on public frames of a D415 (demo data of NVlabs/UnseenObjectClustering: flat parts, tilt
removed); those of V1 and V4 to V7 are a prototype's of the same kind; V8's the ten mean distances of thesis table 6.2; V9's a
published fit; V10's the prototype's. Noise is alike over several slices and strips, so V5 and V6 of the fast model are those of
four times as many seeds. Prints a table, and writes it as Markdown and JSON to experiments/results/.

    python experiments/03_sensor_figures.py [--seeds 3]
"""

import argparse
import json
import math
import os
import sys
from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from functools import lru_cache
from pathlib import Path
from typing import Any

os.environ.setdefault("MUJOCO_GL", "egl")
sys.path.insert(0, str(Path(__file__).parents[1]))

import mujoco
import numpy as np
from numpy import ndarray

from tests.depth_scenes import FLAT, fillet, points_in_part, profile_depth, profile_scene, v_groove
from weldsim.frames import Transform
from weldsim.mounts import D415_640X480 as VGA
from weldsim.opengl import rendering_backend
from weldsim.records import CameraIntrinsics
from weldsim.scene.config import SceneConfig
from weldsim.scene.world import build_world
from weldsim.sensor.active_stereo import D415Stereo
from weldsim.sensor.base import Label, View
from weldsim.sensor.d415 import D415_1280X720 as HD
from weldsim.sensor.d415 import D415Config, d415
from weldsim.sensor.exact import TwinScene
from weldsim.sensor.kinect import KinectConfig
from weldsim.sensor.renderer import make_renderer
from weldsim.sensor.stereo_config import D415StereoConfig
from weldsim.sensor.time_of_flight import KinectV2

RESULTS = Path(__file__).parent / "results"
B = 0.055  # [m]
THESIS_DISTANCES = (0.360, 0.391, 0.408, 0.428, 0.457, 0.501, 0.519, 0.530, 0.560, 0.605)  # [m] thesis table 6.2
SMALL = CameraIntrinsics(width=160, height=120, fx=365.456, fy=365.456, cx=80.0, cy=60.0)  # the middle of a Kinect v2
V = v_groove(0.006, 0.005)
PART, LAGS = (120, 160), 30  # [px] parts on which V3 is measured, and lags
Shape = tuple[tuple[float, float], ...]
Look = Callable[..., tuple[ndarray, ndarray]]
"""profile, intrinsics, z, seed, rotation, tilt, unit, offset -> depth and exact depth [m]."""


@dataclass(frozen=True)
class Figure:
    """One line of the table: name, what, unit shown, the least and the most wanted [SI], values by camera [SI]."""

    name: str
    what: str
    unit: str
    low: float
    high: float
    values: dict[str, float]

    def kept(self) -> dict[str, bool]:
        return {camera: self.low <= value <= self.high for camera, value in self.values.items()}


def fast(profile: Shape, i: CameraIntrinsics, z: float, seed: int, **how: float) -> tuple[ndarray, ndarray]:
    """The parametric D415 on exact depth in closed form."""
    exact = profile_depth(i, list(profile), z, rotation=how.get("rotation", 0.0), tilt=how.get("tilt", 0.0))
    config = D415Config(depth_unit=how.get("unit", 1e-4), offset_sigma=how.get("offset", 0.0))
    config = config if config.depth_unit else replace(config, disparity_step=0.0)
    return d415(exact, i, config, seed=[seed, round(1e6 * z)]), exact


@lru_cache(maxsize=64)
def _pair(profile: Shape, i: CameraIntrinsics, z: float, seed: int, rotation: float, tilt: float, config: Any) -> tuple:
    scene, view = profile_scene(list(profile), z, rotation=rotation, tilt=tilt)
    capture = D415Stereo(scene, i, config, seed=seed).capture(view)
    return np.asarray(capture.frame.depth), np.asarray(capture.truth.depth)


def stereo(profile: Shape, i: CameraIntrinsics, z: float, seed: int, **how: float) -> tuple[ndarray, ndarray]:
    """The reference D415 on the same surface rendered."""
    config = D415StereoConfig(depth_unit=how.get("unit", 1e-4), offset_sigma=how.get("offset", 0.0))
    config = config if config.depth_unit else replace(config, disparity_step=0.0)
    return _pair(profile, i, z, seed, how.get("rotation", 0.0), how.get("tilt", 0.0), config)


CAMERAS: dict[str, Look] = {"D415Fast": fast, "D415Stereo": stereo}


def inside(image: ndarray) -> ndarray:
    """Away from the blind band and from the rows that the projector does not light."""
    return image[30:-60, 160:-20]


def v1() -> Iterator[Figure]:
    """Exact depth against MuJoCo's double-precision rays on the grooved plate."""
    world = build_world(SceneConfig())
    data, X_WC = world.new_data(world.view_joints(0)), world.X_WB @ world.views[0]
    rays = world.intrinsics.rays().reshape(-1, 3) @ X_WC.R.T
    length = np.linalg.norm(rays, axis=1)
    geom, distance = np.zeros(len(rays), np.int32), np.zeros(len(rays))
    groups = np.array([1, 1, 1, 0, 0, 0], np.uint8)
    directions = (rays / length[:, None]).ravel()
    mujoco.mj_multiRay(world.model, data, X_WC.p, directions, groups, 1, -1, geom, distance, None, len(rays), mujoco.mjMAXVAL)
    worst = {}
    for backend in dict.fromkeys((rendering_backend(), "embree")):
        renderer = make_renderer(world.model, backend)
        image = renderer.render(data, X_WC, world.intrinsics, colour=False)
        same = (image.geom.ravel() == geom) & np.isin(geom, np.concatenate([world.geoms("part"), world.geoms("groove")]))
        worst[backend] = float(np.abs(image.depth.ravel() - distance / length)[same].max())
        renderer.close()
    for backend, value in worst.items():
        yield Figure(
            "V1", f"exact depth ({backend}) against rays, max", "um", 0.0, 5e-6 if backend == "embree" else 1e-6, {"exact": value}
        )


def v2_v3(look: Look, seeds: int) -> dict[str, float]:
    out = {}
    for z in (0.36, 0.42, 0.48, 0.54, 0.60):
        looks = [look(tuple(FLAT), VGA, z, seed, tilt=0.1, unit=0.0) for seed in range(seeds)]
        out[f"V2 {z:.2f}"] = float(np.mean([np.nanstd(inside(depth - exact)) for depth, exact in looks]))
    correlation = np.zeros((2, LAGS))
    for seed in range(seeds):
        depth, exact = look(tuple(FLAT), VGA, 0.67, seed, tilt=0.1, unit=0.0)
        correlation += correlations(VGA.fx * B * (1 / depth - 1 / exact))
    for each, name in zip(correlation, ("V3 rows", "V3 columns"), strict=True):
        out[name] = float(np.interp(-math.exp(-1), -each / each[0], np.arange(LAGS)))
    return out


def correlations(error: ndarray) -> ndarray:
    """Products (2, LAGS) of pixels 0, 1, 2, ... px apart along rows and along columns, on parts with their tilt removed."""
    total = np.zeros((2, LAGS))
    rows, columns = np.indices(PART)
    A = np.stack([np.ones(rows.size), rows.ravel(), columns.ravel()], axis=1)
    for top in range(70, 430 - PART[0], PART[0]):
        for left in range(130, 620 - PART[1], PART[1]):
            part = np.nan_to_num(error[top : top + PART[0], left : left + PART[1]].astype(float))
            part -= (A @ np.linalg.lstsq(A, part.ravel(), rcond=None)[0]).reshape(PART)
            for axis in (0, 1):
                lines = np.moveaxis(part, 1 - axis, 0)
                total[axis] += [np.mean(lines[: len(lines) - lag] * lines[lag:]) for lag in range(LAGS)]
    return total


def profile_of(look: Look, i: CameraIntrinsics, z: float, rotation: float, seed: int) -> tuple[ndarray, ndarray]:
    """Mean and deviation of height [m] in 1 mm strips along the V, from 30 mm left of it to 30 mm right."""
    depth, exact = look(tuple(V), i, z, seed, rotation=rotation)
    across = points_in_part(i, exact, z, rotation=rotation)[..., 0]
    height = points_in_part(i, depth, z, rotation=rotation)[..., 2]
    seen = np.isfinite(depth)
    strips = [height[seen & (np.abs(across - x) < 0.5e-3)] for x in np.arange(-30, 31) * 1e-3]
    return np.array([s.mean() for s in strips]), np.array([s.std() for s in strips])


def v4(look: Look, seeds: int) -> dict[str, float]:
    out = {}
    for name, i, z in (("640x480 at 0.40 m", VGA, 0.40), ("1280x720 at 0.45 m", HD, 0.45)):
        for degrees in (0, 45, 90):
            found = [profile_of(look, i, z, math.radians(degrees), seed) for seed in range(seeds)]
            mean, sigma = np.mean([m for m, _ in found], axis=0), np.mean([s for _, s in found], axis=0)
            out[f"V4 depth, {name}, {degrees} deg"] = float(-mean.min())
            out[f"V4 noise, {name}, {degrees} deg"] = float(sigma[28:33].mean() / sigma[:15].mean())
    return out


def v5(look: Look, seeds: int) -> dict[str, float]:
    out = {}
    for name, i, z in (("640x480 at 0.35 m", VGA, 0.35), ("640x480 at 0.40 m", VGA, 0.40), ("1280x720 at 0.45 m", HD, 0.45)):
        centroids = []
        for seed in range(4 * seeds if look is fast else seeds):
            depth, _ = look(tuple(V), i, z, seed, unit=1e-3)
            points = points_in_part(i, depth, z)
            near = np.isfinite(depth) & (np.abs(points[..., 0]) < 8e-3)
            x, y, below = points[near][:, 0], points[near][:, 1], np.clip(-points[near][:, 2], 0, None)
            for start in np.arange(-0.06, 0.06, 0.002):
                strip = (y >= start) & (y < start + 0.002)
                centroids.append(np.average(x[strip], weights=below[strip]))
        out[f"V5 {name}"] = float(np.std(centroids))
    return out


def v6(look: Look, seeds: int) -> dict[str, float]:
    z, corner, crossing = 0.45, [], []
    for seed in range(4 * seeds if look is fast else seeds):
        depth, exact = look(tuple(fillet()), HD, z, seed)
        across = np.abs(points_in_part(HD, exact, z)[..., 0])
        points = points_in_part(HD, depth, z)
        corner.append(np.nanmean(points[..., 2][across < 0.4e-3]))
        x, y, height = points[np.isfinite(depth)].T
        for start in np.arange(-0.05, 0.05, 0.01):
            strip = (y >= start) & (y < start + 0.01)
            sides = (strip & (x < -8e-3) & (x > -4e-2), strip & (x > 8e-3) & (x < 4e-2))
            left, right = (np.polyfit(x[side], height[side], 1) for side in sides)
            meet = (right[1] - left[1]) / (left[0] - right[0])
            crossing.append((meet, left[0] * meet + left[1]))
    bias, scatter = np.abs(np.mean(crossing, axis=0)).max(), np.std(crossing, axis=0).max()
    return {"V6 corner": float(np.mean(corner)), "V6 bias": float(bias), "V6 scatter": float(scatter)}


def v7(look: Look, seeds: int) -> dict[str, float]:
    off = []
    for z in (0.35, 0.45, 0.55):
        depth, _ = look(tuple(FLAT), VGA, z, 0, unit=1e-3)
        off.append(np.median(np.isfinite(depth[30:-60]).argmax(axis=1)) - VGA.fx * B / z)
    depth, _ = look(tuple(FLAT), VGA, 0.27, 0, tilt=0.5)
    return {"V7 band": float(max(off, key=abs)), "V7 nearest": float(np.nanmin(depth) - VGA.fx * B / 126)}


def v8(look: Look, seeds: int) -> dict[str, float]:
    errors = {offset: [] for offset in (0.0, 3.5e-3)}
    for offset, found in errors.items():
        for z in THESIS_DISTANCES:
            depth, exact = look(tuple(FLAT), VGA, z, 1, offset=offset, unit=1e-3, tilt=0.05)
            found.append(np.nanmean(inside(depth - exact)))
    rms = math.sqrt(np.mean(np.square(errors[3.5e-3])))
    return {"V8 rms": rms, "V8 mean": float(np.abs(errors[0.0]).max())}


def wanted() -> dict[str, tuple[str, str, float, float]]:
    """{name: (what, unit, least, most)} of everything that v2 to v8 return."""
    out = {}
    for z in (0.36, 0.42, 0.48, 0.54, 0.60):
        law = z**2 * 0.095 / (VGA.fx * B)
        out[f"V2 {z:.2f}"] = (f"noise of a plane at {z:.2f} m", "mm", 0.75 * law, 1.25 * law)
    for axis, low, high in (("rows", 11.0, 16.0), ("columns", 8.0, 9.5)):
        out[f"V3 {axis}"] = (f"correlation of the noise down to 1/e, along {axis}, 160 x 120 px", "px", low, high)
    for name, low, high in (("640x480 at 0.40 m", 1.9e-3, 2.9e-3), ("1280x720 at 0.45 m", 2.5e-3, 3.3e-3)):
        for degrees in (0, 45, 90):
            text = f"6 x 5 mm V, {name}, turned {degrees} deg"
            out[f"V4 depth, {name}, {degrees} deg"] = (f"depth of a {text}", "mm", low, high)
            out[f"V4 noise, {name}, {degrees} deg"] = (f"noise in a {text}, over that of the plate", "", 1.7, 2.3)
    for name, low, high in (
        ("640x480 at 0.35 m", 0.5e-3, 0.8e-3),
        ("640x480 at 0.40 m", 0.7e-3, 1.1e-3),
        ("1280x720 at 0.45 m", 0.45e-3, 0.7e-3),
    ):
        out[f"V5 {name}"] = (f"scatter of centroids of 2 mm slices of the V, {name}", "mm", low, high)
    out["V6 corner"] = ("90 deg fillet: the corner seems nearer by", "mm", 0.9e-3, 1.4e-3)
    out["V6 bias"] = ("90 deg fillet: fitted planes meet off the corner by", "mm", 0.0, 0.1e-3)
    out["V6 scatter"] = ("90 deg fillet: scatter of that, 10 mm slices", "mm", 0.1e-3, 0.35e-3)
    out["V7 band"] = ("blind band on the left, beyond f B / z", "px", -3.0, 3.0)
    out["V7 nearest"] = ("nearest depth reported, beyond f B / 126", "mm", -0.5e-3, math.inf)
    out["V8 rms"] = (
        "planes at the ten distances of thesis table 6.2 (3.48 mm there), turned 3 deg, offset on: rms of the means",
        "mm",
        2e-3,
        5e-3,
    )
    out["V8 mean"] = ("the same with the offset off: largest error of a mean", "mm", 0.0, 0.2e-3)
    return out


def v9(seeds: int) -> Iterator[Figure]:
    for z, sigma in ((1.0, 1.30e-3), (1.5, 1.42e-3), (2.0, 1.70e-3)):
        found = _kinect_sigma(z, 0.0, KinectConfig(), seeds)
        rounded = math.hypot(sigma, 0.29e-3)
        yield Figure("V9", f"noise of a plane at {z:.1f} m, 1 mm steps", "mm", 0.9 * rounded, 1.1 * rounded, {"KinectV2": found})
    for degrees, sigma in ((40, 1.42e-3), (60, 1.86e-3)):
        found = _kinect_sigma(1.2, math.radians(degrees), replace(KinectConfig(), depth_unit=0.0), seeds)
        yield Figure("V9", f"noise of a plane turned {degrees} deg at 1.2 m", "mm", 0.9 * sigma, 1.1 * sigma, {"KinectV2": found})


def _kinect_sigma(z: float, tilt: float, config: KinectConfig, seeds: int) -> float:
    errors = []
    scene, view = profile_scene(FLAT, z, tilt=tilt, reach=3.0)
    for seed in range(seeds):
        capture = KinectV2(scene, SMALL, config, seed=seed).capture(view)
        near = np.abs(capture.truth.depth - z) < 0.03
        errors.append((capture.frame.depth - capture.truth.depth)[near & np.isfinite(capture.frame.depth)])
    return float(np.concatenate(errors).std())


def block() -> tuple[TwinScene, View]:
    """A 50 mm block of 0.2 x 0.2 m, turned by 17 degrees, on a floor 1 m below the camera."""
    model = mujoco.MjModel.from_xml_string(
        "<mujoco><worldbody><geom type='plane' size='3 3 .1'/>"
        "<geom type='box' size='.1 .1 .025' pos='0 0 .025' euler='0 0 17'/></worldbody></mujoco>"
    )
    data = mujoco.MjData(model)
    mujoco.mj_forward(model, data)
    labels = np.array([Label.TABLE, Label.PART], np.uint8)
    scene = TwinScene(model=model, data=data, X_WB=Transform("WB", np.eye(3), np.zeros(3)), labels=labels)
    return scene, View(X_BC=Transform("BC", np.diag([1.0, -1.0, -1.0]), np.array([0.0, 0.0, 1.0])))


def v10() -> Iterator[Figure]:
    scene, view = block()
    perimeter = 4 * 0.2 * SMALL.fx / 0.95
    for supersample in (2, 3):
        config = KinectConfig(supersample=supersample, smoothing=False, edge_filter=False)
        depth = KinectV2(scene, SMALL, config).capture(view).frame.depth
        for margin, low, high in ((12.5e-3, 0.6, 0.9), (5e-3, 0.0, math.inf)):
            count = float(((depth > 0.95 + margin) & (depth < 1.0 - margin)).sum()) / perimeter
            rays = f"{supersample} x {supersample} rays"
            what = f"pixels over {margin * 1e3:g} mm off both sides of a 50 mm step, for each of perimeter, {rays}"
            yield Figure("V10", what, "", low, high, {"KinectV2": count})


def figures(seeds: int) -> list[Figure]:
    """All of them, in order."""
    found: dict[str, dict[str, float]] = {}
    for camera, look in CAMERAS.items():
        for measure in (v2_v3, v4, v5, v6, v7, v8):
            for name, value in measure(look, seeds).items():
                found.setdefault(name, {})[camera] = value
    middle = [Figure(name.split()[0].rstrip(","), *text, found[name]) for name, text in wanted().items()]
    return [*v1(), *middle, *v9(seeds), *v10()]


SCALES = {"mm": 1e3, "um": 1e6, "px": 1.0, "": 1.0}


def markdown(rows: list[Figure], seeds: int) -> str:
    """The table: target, and each camera's value, marked where it lies outside."""
    lines = [f"Simulated cameras on simple surfaces, {seeds} seeds. `!` marks a value outside its target.", ""]
    lines += ["| | figure | unit | target | D415Fast | D415Stereo | other |", "|---|---|---|---|---|---|---|"]
    for row in rows:
        scale, kept = SCALES[row.unit], row.kept()
        if row.high == math.inf:
            target = "-" if row.low <= 0 and row.unit != "mm" else f">= {row.low * scale:.2f}"
        else:
            target = f"{row.low * scale:.2f} to {row.high * scale:.2f}"
        shown = {camera: f"{value * scale:.2f}" + ("" if kept[camera] else " !") for camera, value in row.values.items()}
        other = ", ".join(text for camera, text in shown.items() if camera not in CAMERAS)
        cells = [row.name, row.what, row.unit, target, *(shown.get(camera, "") for camera in CAMERAS), other]
        lines.append(f"| {' | '.join(cells)} |")
    return "\n".join(lines) + "\n"


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    rows = figures(options.seeds)
    text = markdown(rows, options.seeds)
    print(text)
    RESULTS.mkdir(exist_ok=True)
    (RESULTS / "03_sensor_figures.md").write_text(text)
    table = [
        {
            "figure": row.name,
            "what": row.what,
            "target": [row.low, None if row.high == math.inf else row.high],
            "values": row.values,
        }
        for row in rows
    ]
    (RESULTS / "03_sensor_figures.json").write_text(json.dumps(table, indent=1) + "\n")
    missed = sum(not kept for row in rows for kept in row.kept().values())
    print(f"{missed} value(s) outside their target")
    return 0


if __name__ == "__main__":
    sys.exit(main())
