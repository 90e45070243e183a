"""Depth images with their intrinsics and pose: what is read, and the one line that refuses the rest."""

import json
import zlib
from pathlib import Path

import cv2
import numpy as np
import pytest

from tests.cloud_files import npy_bytes, npz_bytes, png_bytes
from weldsim.cloud.files import read_depth_frame, write_depth_png
from weldsim.errors import CloudFileError, RecordError
from weldsim.frames import Transform, matrix_from_rotation_vector

H, W = 24, 32
COUNTS = np.random.default_rng(2).integers(300, 900, (H, W)).astype(np.uint16)
COUNTS[3, 4], COUNTS[5, 6] = 0, 65_535
FIGURES = {"width": W, "height": H, "fx": 40.0, "fy": 41.0, "cx": 15.25, "cy": 11.75}
K = [[40.0, 0, 15.25], [0, 41.0, 11.75], [0, 0, 1]]


@pytest.fixture
def put(tmp_path: Path):
    def write(content: bytes | str | dict | list, name: str) -> Path:
        if isinstance(content, dict | list):
            content = json.dumps(content)
        (tmp_path / name).write_bytes(content.encode() if isinstance(content, str) else content)
        return tmp_path / name

    return write


def lines(mark: str) -> str:
    return "\n".join(["# of the camera", *(f"{key}{mark} {value}" for key, value in FIGURES.items()), "model: brown"])


@pytest.mark.parametrize(
    "text",
    [
        FIGURES,
        "\n".join(f"{key} = {value}" for key, value in FIGURES.items()),
        lines(":"),
        {"width": W, "height": H, "K": K, "D": [0.0] * 5},
        {"width": W, "height": H, "K": np.ravel(K).tolist()},
        {"width": W, "height": H, "fx": 40.0, "fy": 41.0, "ppx": 15.25, "ppy": 11.75, "coeffs": [0, 0, 0, 0, 0]},
    ],
)
def test_intrinsics_of_every_kind_are_opencv_and_become_half_pixel(put, text: str | dict) -> None:
    camera = read_depth_frame(put(png_bytes(COUNTS), "d.png"), put(text, "k")).intrinsics
    assert (camera.width, camera.height) == (W, H)
    assert (camera.fx, camera.fy, camera.cx, camera.cy) == (40.0, 41.0, 15.75, 12.25)


@pytest.mark.parametrize("kind", ["png", "npy", "npz", "float npy", "column"])
def test_images_of_every_kind(put, kind: str) -> None:
    metres = np.where((COUNTS == 0) | (COUNTS == 65_535), np.nan, COUNTS * 1e-3).astype(np.float32)
    content = {
        "png": png_bytes(COUNTS),
        "npy": npy_bytes(COUNTS),
        "npz": npz_bytes(depth=COUNTS, other=COUNTS[:3]),
        "float npy": npy_bytes(np.where(np.isnan(metres), -1.0, metres)),
        "column": npy_bytes(COUNTS[..., None]),
    }[kind]
    frame = read_depth_frame(put(content, "d"), put(FIGURES, "k"))
    np.testing.assert_array_equal(frame.depth, metres)
    assert frame.source == "d"


def test_the_scale_in_the_file_outranks_the_argument(put) -> None:
    frame = read_depth_frame(put(png_bytes(COUNTS), "d"), put(FIGURES | {"depth_scale": 1e-4}, "k"), depth_unit=0.5)
    assert frame.depth[0, 0] == np.float32(COUNTS[0, 0] * 1e-4)
    frame = read_depth_frame(put(png_bytes(COUNTS), "d"), put(FIGURES, "k"), depth_unit=2e-4)
    assert frame.depth[0, 0] == np.float32(COUNTS[0, 0] * 2e-4)


def test_poses(put) -> None:
    X_BC = Transform("BC", matrix_from_rotation_vector(np.array([2.0, 0.5, -0.3])), np.array([0.1, 0.2, 0.6]))
    depth, k = put(png_bytes(COUNTS), "d"), put(FIGURES, "k")
    rounded = [[round(value, 5) for value in row] for row in X_BC.matrix.tolist()]
    for pose in (
        X_BC,
        put({"position": X_BC.p.tolist(), "quaternion_wxyz": X_BC.quaternion.tolist()}, "a"),
        put({"matrix": X_BC.matrix.tolist()}, "b"),
        put(rounded, "c"),
    ):
        np.testing.assert_allclose(read_depth_frame(depth, k, pose=pose).X_BC.matrix, X_BC.matrix, atol=1e-5)
    np.testing.assert_array_equal(read_depth_frame(depth, k).X_BC.matrix, np.eye(4))


PNG = png_bytes(COUNTS)


@pytest.mark.parametrize(
    ("image", "table", "words"),
    [
        (png_bytes(COUNTS.astype(np.uint8)), FIGURES, "8-bit grey PNG; depth is one channel of 16 bits"),
        (png_bytes(np.zeros((H, W, 3), np.uint8)), FIGURES, "8-bit RGB PNG"),
        (png_bytes(np.zeros((H, W, 3), np.uint16)), FIGURES, "16-bit RGB PNG"),
        (png_bytes(COUNTS[:-1]), FIGURES, "32 x 23 px, its intrinsics are for 32 x 24"),
        (npy_bytes(COUNTS.T), FIGURES, "24 x 32 px, its intrinsics are for 32 x 24"),
        (PNG[:-1], FIGURES, "cut off"),
        (PNG[:60] + bytes([PNG[60] ^ 1]) + PNG[61:], FIGURES, "damaged"),
        (PNG[:20], FIGURES, "cut off"),
        (npy_bytes(COUNTS.astype(np.uint8)), FIGURES, "its type is uint8"),
        (npy_bytes(COUNTS.astype(np.float32)), FIGURES, "divide millimetres by 1000"),
        (npy_bytes(COUNTS * 0), FIGURES, "no pixel of it has a depth"),
        (npy_bytes(np.full((H, W), np.nan)), FIGURES, "no pixel of it has a depth"),
        (npz_bytes(image=COUNTS), FIGURES, "no array called depth"),
        (b"text", FIGURES, "neither a PNG nor an NPY"),
        (PNG, {**FIGURES, "fx": -1}, "must be positive"),
        (PNG, {**FIGURES, "fx": "wide"}, "fx: 'wide' is no number"),
        (PNG, {**FIGURES, "fx": None}, "fx"),
        (PNG, {**FIGURES, "fx": [1, 2]}, "expected 1 finite"),
        (PNG, {**FIGURES, "width": 1e9}, "no image size"),
        (PNG, {**FIGURES, "width": 31.5}, "no image size"),
        (PNG, {**FIGURES, "depth_scale": 1000}, "depth_scale 1000"),
        (PNG, {"width": W, "height": H}, "key 'fx' is missing"),
        (PNG, {"width": W, "height": H, "K": [[1, 2], [3, 4]]}, "expected 9 finite numbers"),
        (PNG, {"width": W, "height": H, "K": np.ones((3, 3)).tolist()}, "K is no matrix"),
        (PNG, "no table here", "neither JSON nor TOML"),
        (PNG, b"\xff\xfe\x00", "is no text"),
    ],
)
def test_what_is_no_depth_frame_is_refused_in_one_line(put, capfd, image: bytes, table: str | bytes | dict, words: str) -> None:
    with pytest.raises(CloudFileError) as caught:
        read_depth_frame(put(image, "d"), put(table, "k"))
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert Path(str(caught.value.data["path"])).exists()
    assert capfd.readouterr() == ("", "")


@pytest.mark.parametrize(
    ("pose", "words"),
    [
        ({"position": [1, 2, 3]}, "no rotation (found: position); wanted: position and quaternion_wxyz"),
        ({"position": [1, 2], "quaternion_wxyz": [1, 0, 0, 0]}, "expected 3 finite"),
        ({"position": [1, 2, 3], "quaternion_wxyz": [2, 0, 0, 0]}, "length 2"),
        ({"matrix": (np.eye(4) * 2).tolist()}, "no rigid transform"),
        ({"matrix": np.diag([1, 1, -1, 1]).tolist()}, "left-handed"),
        ({"pose": 3}, "no position (found: pose)"),
        ([], "matrix"),
    ],
)
def test_what_is_no_pose_is_refused(put, pose: dict | list, words: str) -> None:
    with pytest.raises(CloudFileError, match="pose") as caught:
        read_depth_frame(put(PNG, "d"), put(FIGURES, "k"), pose=put(pose, "pose"))
    assert words in str(caught.value)


def test_a_small_png_cannot_claim_a_large_image(put) -> None:
    """A megapixel bomb: an honest header, a few bytes that unpack to far more than it."""
    body = zlib.compress(bytes(50_000_000))
    parts = [PNG[:33]]
    for kind, data in ((b"IDAT", body), (b"IEND", b"")):
        parts.append(len(data).to_bytes(4, "big") + kind + data + zlib.crc32(kind + data).to_bytes(4, "big"))
    with pytest.raises(CloudFileError, match="damaged"):
        read_depth_frame(put(b"".join(parts), "d"), put(FIGURES, "k"))


def test_a_depth_png_reads_back(tmp_path: Path, put) -> None:
    depth = np.where(COUNTS % 7 == 0, np.nan, COUNTS.clip(1, 60_000) * 1e-3).astype(np.float32)
    path = write_depth_png(tmp_path / "out.png", depth)
    np.testing.assert_array_equal(read_depth_frame(path, put(FIGURES, "k")).depth, depth)
    assert cv2.imread(str(path), cv2.IMREAD_UNCHANGED).dtype == np.uint16
    with pytest.raises(RecordError, match="16 bits"):
        write_depth_png(path, depth, depth_unit=1e-6)


@pytest.mark.parametrize(("scale", "meant"), [(1e3, "millimetres"), (100.0, "centimetres")])
def test_a_camera_in_another_unit_is_refused_and_the_metres_that_are_named_work(put, scale: float, meant: str) -> None:
    depth, k = put(png_bytes(COUNTS), "d"), put(FIGURES, "k")
    pose = np.diag([1.0, -1.0, -1.0, 1.0])
    pose[:3, 3] = np.array([0.0, -0.45, 0.42]) * scale
    with pytest.raises(CloudFileError, match=rf"pose.*looks like {meant}; positions are in metres: \(0, -0.45, 0.42\)"):
        read_depth_frame(depth, k, pose=put({"matrix": pose.tolist()}, "pose"))
    pose[:3, 3] = (0, -0.45, 0.42)
    np.testing.assert_allclose(read_depth_frame(depth, k, pose=put({"matrix": pose.tolist()}, "pose")).X_BC.p, [0, -0.45, 0.42])


def test_a_camera_in_another_frame_is_refused(put) -> None:
    far = {"position": [4e5, 2e6, 1e4], "quaternion_wxyz": [0, 1, 0, 0]}
    with pytest.raises(CloudFileError, match="is it in the frame of the robot's base"):
        read_depth_frame(put(png_bytes(COUNTS), "d"), put(FIGURES, "k"), pose=put(far, "pose"))
