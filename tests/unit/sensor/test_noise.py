"""Fields of noise: variance, lengths, what changes between exposures, and the same bits on every processor."""

import os
import subprocess
import sys

import numpy as np
import pytest

from weldsim.errors import ConfigError
from weldsim.sensor.d415 import D415_NOISE
from weldsim.sensor.noise import NoiseField, _spread, _weights, disparity_noise, total_sigma

SHAPE = (96, 130)


def fields(noise: tuple[NoiseField, ...], count: int) -> np.ndarray:
    """Images of as many seeds."""
    return np.stack([disparity_noise(noise, SHAPE, 0.4, *(np.random.default_rng([s, k]) for k in (0, 1))) for s in range(count)])


def correlation(images: np.ndarray, lag: int, axis: int) -> float:
    """Mean product of pixels `lag` apart along an axis of the images."""
    images = np.moveaxis(images, axis + 1, 0)
    return float(np.mean(images[lag:] * images[: len(images) - lag]))


@pytest.mark.parametrize("length", [0.2, 2.0, 3.9, 8.6, 13.0, 40.0, 150.0])
def test_a_line_of_pixels_has_the_law_s_correlation_wherever_its_nodes_lie(length: float) -> None:
    """Exactly: pixels are linear in independent nodes, so their covariance is the product of the weights."""
    weights = _weights(100, length)
    each = _spread(np.eye(weights.nodes, dtype=np.float32), weights)
    apart = np.subtract.outer(np.arange(100), np.arange(100))
    assert each.shape == (100, weights.nodes)
    assert np.abs(each @ each.T - np.exp(-((apart / length) ** 2))).max() < 3e-3
    assert np.abs((each**2).sum(axis=1) - 1).max() < 1e-6


def test_fields_add_up() -> None:
    assert total_sigma(D415_NOISE) == pytest.approx(np.hypot(0.09, 0.045))
    images = fields(D415_NOISE, 80)
    assert images.std() == pytest.approx(total_sigma(D415_NOISE), rel=0.04)
    for axis, name in ((0, "along_columns"), (1, "along_rows")):
        for lag in (5, 12, 25):
            law = sum(each.sigma**2 * np.exp(-((lag / getattr(each, name)) ** 2)) for each in D415_NOISE)
            assert correlation(images, lag, axis) == pytest.approx(law, abs=0.08 * total_sigma(D415_NOISE) ** 2)
    assert not disparity_noise((), SHAPE, 0.4, np.random.default_rng(0), np.random.default_rng(1)).any()


@pytest.mark.parametrize("changing", [0.0, 0.42, 1.0])
def test_a_share_of_the_deviation_follows_the_second_generator(changing: float) -> None:
    noise = (NoiseField(sigma=1.0, along_rows=3.0, along_columns=3.0),)
    frames = np.stack(
        [disparity_noise(noise, (200, 200), changing, np.random.default_rng(0), np.random.default_rng(k)) for k in (1, 2)]
    )
    assert frames.std() == pytest.approx(1.0, abs=0.03)
    assert (frames[0] - frames[1]).std() / np.sqrt(2) == pytest.approx(changing, abs=0.03)


def test_frames_are_the_same_bits_without_the_processor_s_newer_instructions() -> None:
    code = (
        "import zlib, numpy as np\n"
        "from weldsim.mounts import D415_640X480 as camera\n"
        "from weldsim.sensor.d415 import D415Config, d415\n"
        "rows, columns = np.indices((480, 640))\n"
        "exact = np.where(columns > 400, 0.40 + 1e-4 * rows, 0.46 + 2e-5 * columns).astype(np.float32)\n"
        "print(zlib.crc32(d415(exact, camera, D415Config(), seed=[3]).tobytes()))\n"
    )
    old = {"NPY_DISABLE_CPU_FEATURES": features(), "OPENCV_CPU_DISABLE": "AVX512-SKX,AVX2,FMA3,AVX"}
    told = []
    for changes in ({}, old):
        changed = os.environ | changes
        done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=False, env=changed, timeout=120)
        assert done.returncode == 0, done.stderr
        told.append(done.stdout)
    assert told[0] == told[1]


def features() -> str:
    """Those of numpy's optional instruction sets that this processor has."""
    found = np.lib.introspect.opt_func_info() if hasattr(np.lib, "introspect") else {}
    targets = {word for table in found.values() for kinds in table.values() for word in kinds["available"].split()}
    return " ".join(sorted(target for target in targets if "baseline" not in target))


@pytest.mark.parametrize(("key", "value"), [("sigma", -0.1), ("along_rows", 0.0), ("along_columns", 1e4), ("sigma", float("nan"))])
def test_impossible_figures_are_refused(key: str, value: float) -> None:
    with pytest.raises(ConfigError, match=key):
        NoiseField(**{"sigma": 0.1, "along_rows": 5.0, "along_columns": 5.0, key: value})
