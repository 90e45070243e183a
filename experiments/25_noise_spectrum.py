"""Roughness of flat parts by wavelength: public depth frames beside the twin's cameras, mm rms normal to the part.

The figures of the frames are constants here, measured once with their tilt removed: `demo` frames of
NVlabs/UnseenObjectClustering (D415 frames 0 to 3, D435 frame 5), a D435 of Shreeyak/cleargrasp (`sample_dataset/real-val/d435`)
and nine flat parts in the single scans of thillRobot/seam_detection (D435i, smoothed by its driver). The twin sees a plane at
the same distance, tilted by 43 degrees (45 in the last), in the same mode. Prints a table.

    python experiments/25_noise_spectrum.py [--seeds 3]
"""

import argparse
import math
import sys
from dataclasses import dataclass
from itertools import pairwise
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

import numpy as np
from numpy import ndarray
from scipy.interpolate import griddata

from tests.depth_scenes import FLAT, points_in_part, profile_depth
from weldsim.mounts import D415_640X480
from weldsim.records import CameraIntrinsics
from weldsim.sensor.d415 import D435_848X480, FILTERED_NOISE, D415Config, D435Config, d415

BANDS = (2, 5, 10, 20, 50, 100, 200, 400)  # [mm] of wavelength
HALF = 0.2  # [m] the part reaches this far either way
GRID = 0.001  # [m]
LAGS = 30  # [px]
D435_640X480 = CameraIntrinsics(width=640, height=480, fx=385.1, fy=385.1, cx=320.0, cy=240.0)
D435_1280X720 = CameraIntrinsics(width=1280, height=720, fx=640.0, fy=640.0, cx=640.0, cy=360.0)


@dataclass(frozen=True)
class Part:
    """Flat parts of one source. Attributes: name; z [m] of the middle; camera and config in the twin; sigma [px] and mm rms in
    each of BANDS, and lengths [px] along rows and columns over which the correlation falls to 1/e, as measured on the frames;
    tilt [rad] of the part."""

    name: str
    z: float
    camera: CameraIntrinsics
    config: D415Config
    sigma: float
    real: tuple[float, ...]
    lengths: tuple[float, float]
    tilt: float = 0.75


PARTS = (
    Part("D415, frames 2 and 3", 0.67, D415_640X480, D415Config(), 0.095, (0.24, 0.17, 0.24, 0.67, 0.45, 0.40, 0.37), (16, 9)),
    Part("D415, frames 0 and 1", 1.11, D415_640X480, D415Config(), 0.095, (0.13, 0.22, 0.19, 0.70, 1.2, 0.90, 0.57), (11, 8)),
    Part("D435, frame 5", 1.20, D435_640X480, D435Config(), 0.071, (0.19, 0.83, 0.45, 0.57, 2.7, 2.9, 1.3), (10, 6)),
    Part("D435, 1280 x 720", 0.62, D435_1280X720, D435Config(), 0.10, (0.25, 0.13, 0.31, 0.65, 0.49, 0.39, 0.21), (11, 7)),
    Part(
        "D435i, nine parts, driver's filter",
        0.93,
        D435_848X480,
        D435Config(spatial_filter=True),
        0.056,
        (0.06, 0.15, 0.19, 0.41, 0.65, 0.70, 0.45),
        (11, 9),
        tilt=math.pi / 4,
    ),
    Part(
        "the same, by the fit to it",
        0.93,
        D435_848X480,
        D435Config(noise=FILTERED_NOISE),
        0.056,
        (0.06, 0.15, 0.19, 0.41, 0.65, 0.70, 0.45),
        (11, 9),
        tilt=math.pi / 4,
    ),
)


def spectrum(part: Part, seed: int) -> tuple[float, ndarray, ndarray]:
    """Of the twin's view, tilt removed: standard deviation of disparity [px], rms [m] in each of BANDS, and the correlation of
    disparity along rows and columns at 0, 1, 2, ... px."""
    exact = profile_depth(part.camera, FLAT, part.z, tilt=part.tilt)
    depth = d415(exact, part.camera, part.config, seed=[seed])
    points = points_in_part(part.camera, depth, part.z, tilt=part.tilt)
    near = np.isfinite(depth) & (np.abs(points[..., :2]) < HALF + 0.01).all(axis=-1)
    x, y, height = points[near].T
    grid = np.arange(-HALF, HALF, GRID)
    image = griddata((x, y), height, tuple(np.meshgrid(grid, grid, indexing="ij")), method="linear")
    disparity = np.where(near, part.camera.fx * part.config.baseline * (1 / depth - 1 / exact), np.nan)
    disparity = without_tilt(disparity)
    along = [
        [np.sum(disparity[:, lag:] * disparity[:, : disparity.shape[1] - lag]) for lag in range(LAGS)],
        [np.sum(disparity[lag:] * disparity[: len(disparity) - lag]) for lag in range(LAGS)],
    ]
    return float(disparity[near].std()), bands(without_tilt(image)), np.array(along) / np.sum(disparity**2)


def without_tilt(image: ndarray) -> ndarray:
    """The image less the plane fitted to its pixels; 0 where it has none."""
    seen = np.isfinite(image)
    A = np.stack([np.ones(int(seen.sum())), *np.nonzero(seen)], axis=1)
    out = np.zeros(image.shape)
    out[seen] = image[seen] - A @ np.linalg.lstsq(A, image[seen], rcond=None)[0]
    return out


def bands(image: ndarray) -> ndarray:
    """rms of the image in each of BANDS, by the power of its Fourier transform under a Hann window."""
    window = np.hanning(len(image))[:, None] * np.hanning(image.shape[1])[None, :]
    power = np.abs(np.fft.fft2(image * window)) ** 2 / (image.size * (window**2).sum())
    frequency = np.hypot(np.fft.fftfreq(len(image), GRID)[:, None], np.fft.fftfreq(image.shape[1], GRID)[None, :])
    edges = 1e3 / np.array(BANDS)  # [1/m], falling
    return np.sqrt([power[(frequency <= high) & (frequency > low)].sum() for high, low in pairwise(edges)])


def main() -> int:
    parser = argparse.ArgumentParser(description=(__doc__ or "").splitlines()[0])
    parser.add_argument("--seeds", type=int, default=3)
    options = parser.parse_args()
    names = " | ".join(f"{low} to {high}" for low, high in pairwise(BANDS))
    print(
        f"mm rms by wavelength [mm], frames / twin; lengths along rows x columns\n\n| part | z m | sigma px | length px | {names} |"
    )
    print("|---" * (len(BANDS) + 3) + "|")
    for part in PARTS:
        found = [spectrum(part, seed) for seed in range(options.seeds)]
        sigma = float(np.mean([each for each, _, _ in found]))
        twin = 1e3 * np.sqrt(np.mean([rms**2 for _, rms, _ in found], axis=0))
        along = np.mean([each for _, _, each in found], axis=0)
        u, v = (float(np.interp(-math.exp(-1), -row, np.arange(LAGS))) for row in along)
        lengths = f"{part.lengths[0]} x {part.lengths[1]} / {u:.0f} x {v:.0f}"
        cells = " | ".join(f"{real:.2f} / {value:.2f}" for real, value in zip(part.real, twin, strict=True))
        print(f"| {part.name} | {part.z:.2f} | {part.sigma:.3f} / {sigma:.3f} | {lengths} | {cells} |", flush=True)
    return 0


if __name__ == "__main__":
    sys.exit(main())
