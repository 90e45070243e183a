"""The readers under fire: valid files read back exactly; damaged ones are a cloud or one line, soon and in little memory."""

import json
import os
import tempfile
import time
import tracemalloc
import warnings
from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from hypothesis import assume, given, settings
from hypothesis import strategies as st
from hypothesis.extra.numpy import arrays

from tests.cloud_files import compress_lzf, npy_bytes, npz_bytes, pcd_bytes, ply_bytes, png_bytes, text_bytes, xyz_columns
from weldsim.cloud.files import read_cloud, read_depth_frame, write_cloud
from weldsim.cloud.pcd import decompress_lzf
from weldsim.errors import CloudFileError, WeldsimError
from weldsim.records import DepthFrame, PointCloud

RNG = np.random.default_rng(1)
POINTS = RNG.uniform([-0.1, 0.4, 0.0], [0.2, 0.7, 0.05], (30, 3))
EXTRA = [(name, "f4", RNG.normal(size=30)) for name in ("nx", "ny", "nz")]
COLOUR = [(name, "u1", RNG.integers(0, 256, 30)) for name in ("red", "green", "blue")]
RGB = [("rgb", "u4", RNG.integers(0, 1 << 24, 30))]

VALID: dict[str, bytes] = {
    "ply little": ply_bytes([*xyz_columns(POINTS, "f4"), *EXTRA, *COLOUR], "<", faces=2, before=b"\x02\0\0\0\0\1\0\0\0"),
    "ply big": ply_bytes([*xyz_columns(POINTS), *COLOUR], ">"),
    "ply ascii": ply_bytes([*xyz_columns(POINTS), *EXTRA], "ascii", faces=2, before=b"2 0 1\n"),
    "pcd ascii": pcd_bytes([*xyz_columns(POINTS, "f4"), *RGB], "ascii"),
    "pcd binary": pcd_bytes([*xyz_columns(POINTS, "f4"), *RGB], "binary", viewpoint="0 0 0.6 1 0 0 0"),
    "pcd compressed": pcd_bytes([*xyz_columns(POINTS.round(2)), *EXTRA], "binary_compressed"),
    "xyz": text_bytes(POINTS, " ", "# x y z\n"),
    "csv": text_bytes(np.hstack([POINTS, RNG.integers(0, 256, (30, 3))]), ",", "x,y,z,r,g,b\n"),
    "npy": npy_bytes(POINTS),
    "npz": npz_bytes(points=POINTS, normals=POINTS, colours=POINTS, viewpoints=np.zeros((2, 3)), view=np.zeros(30, int)),
    "npz packed": npz_bytes(compressed=True, xyz=POINTS.astype(np.float32)),
}
NUMBERS = [b"0", b"-1", b"1", b"31", b"4294967295", b"99999999999", b"1e9", b"nan", b"18446744073709551616", b"9" * 400, b""]


@st.composite
def mutations(draw: st.DrawFn, valid: bytes) -> bytes:
    """Bytes that differ from `valid` by flips, cuts, insertions, swapped pieces and other numbers in the header."""
    data = bytearray(valid)
    for _ in range(draw(st.integers(1, 4))):
        kind = draw(st.sampled_from(["flip", "flip", "head", "cut", "insert", "number", "number", "repeat", "delete"]))
        at = draw(st.integers(0, max(0, len(data) - 1)))
        if kind == "flip" and data:
            data[at] ^= 1 << draw(st.integers(0, 7))
        elif kind == "head" and data:
            data[min(at, len(data) - 1) % 300 % len(data)] = draw(st.integers(0, 255))
        elif kind == "cut":
            del data[at:]
        elif kind == "insert":
            data[at:at] = draw(st.binary(min_size=1, max_size=20))
        elif kind == "delete":
            del data[at : at + draw(st.integers(1, 40))]
        elif kind == "repeat":
            data[at:at] = data[at : at + draw(st.integers(1, 200))]
        else:
            digits = [i for i, byte in enumerate(data[:600]) if 48 <= byte <= 57]
            if digits:
                start = draw(st.sampled_from(digits))
                stop = start
                while stop < len(data) and 48 <= data[stop] <= 57:
                    stop += 1
                data[start:stop] = draw(st.sampled_from(NUMBERS))
    return bytes(data)


def is_cloud_or_one_line(read: Callable[[], object], kind: type) -> None:
    """`read` returns a `kind` or raises a WeldsimError of one line, within two seconds of processor time and 60 MB."""
    tracemalloc.start()
    before = time.process_time()
    try:
        with warnings.catch_warnings():
            warnings.simplefilter("error")
            result = read()
    except WeldsimError as error:
        result = error
    elapsed, (_, peak) = time.process_time() - before, tracemalloc.get_traced_memory()
    tracemalloc.stop()
    assert isinstance(result, kind | WeldsimError)
    assert elapsed < 2
    assert peak < 60e6
    if isinstance(result, WeldsimError):
        assert len(str(result).splitlines()) == 1
        assert len(str(result)) < 400


EXAMPLES = int(os.environ.get("WELDSIM_FUZZ", "25"))  # a night's worth: WELDSIM_FUZZ=10000
FUZZ = settings(max_examples=EXAMPLES)


@pytest.mark.parametrize("name", VALID)
def test_the_valid_file_is_read(tmp_path: Path, name: str) -> None:
    """Without this the fuzzing would prove nothing."""
    path = tmp_path / "f"
    path.write_bytes(VALID[name])
    assert len(read_cloud(path)) == 30


@pytest.mark.parametrize("name", VALID)
@FUZZ
@given(data=st.data(), unit=st.sampled_from(["m", "mm"]))
def test_a_damaged_file_is_a_cloud_or_one_line(tmp_path: Path, capfd, name: str, data: st.DataObject, unit) -> None:
    path = tmp_path / "f"
    path.write_bytes(data.draw(mutations(VALID[name])))
    is_cloud_or_one_line(lambda: read_cloud(path, unit=unit), PointCloud)
    assert capfd.readouterr() == ("", "")


@FUZZ
@given(
    data=st.one_of(
        st.binary(max_size=300),
        st.text(max_size=200).map(str.encode),
        st.text("0123456789.,;-+eE \n#xyznaif", max_size=200).map(str.encode),
    ),
    magic=st.sampled_from([b"", b"ply\n", b"ply\nformat ascii 1.0\n", b"# .PCD\n", b"\x93NUMPY\1\0", b"PK\3\4", b"\xef\xbb\xbf"]),
)
def test_any_bytes_are_a_cloud_or_one_line(tmp_path: Path, data: bytes, magic: bytes) -> None:
    path = tmp_path / "f"
    path.write_bytes(magic + data)
    is_cloud_or_one_line(lambda: read_cloud(path), PointCloud)


COUNTS = RNG.integers(300, 900, (6, 8)).astype(np.uint16)
FIGURES = {"width": 8, "height": 6, "fx": 10.0, "fy": 10.0, "cx": 3.5, "cy": 2.5, "depth_scale": 0.001}
IMAGES = {"png": png_bytes(COUNTS), "npy": npy_bytes(COUNTS), "npz": npz_bytes(depth=COUNTS * 1e-3)}
TABLES = {
    "json": json.dumps(FIGURES).encode(),
    "lines": "\n".join(f"{key}: {value}" for key, value in FIGURES.items()).encode(),
    "toml": b"width = 8\nheight = 6\nK = [[10.0, 0, 3.5], [0, 10.0, 2.5], [0, 0, 1]]\nD = [0, 0]\n",
}
POSES = {
    "quaternion": b'{"position": [0.1, 0.2, 0.6], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]}',
    "matrix": b"[[1, 0, 0, 0.1], [0, 1, 0, 0.2], [0, 0, 1, 0.6], [0, 0, 0, 1]]",
}


@pytest.mark.parametrize("damaged", [*IMAGES, *TABLES, *POSES])
@FUZZ
@given(data=st.data())
def test_a_damaged_depth_frame_is_a_frame_or_one_line(tmp_path: Path, capfd, damaged: str, data: st.DataObject) -> None:
    files = {"image": IMAGES["png"], "table": TABLES["json"], "pose": POSES["quaternion"]}
    role = "image" if damaged in IMAGES else "table" if damaged in TABLES else "pose"
    files[role] = data.draw(mutations((IMAGES | TABLES | POSES)[damaged]))
    for name, content in files.items():
        (tmp_path / name).write_bytes(content)
    is_cloud_or_one_line(lambda: read_depth_frame(tmp_path / "image", tmp_path / "table", pose=tmp_path / "pose"), DepthFrame)
    assert capfd.readouterr() == ("", "")


coordinates = st.floats(-2.0, 2.0, width=64)


@st.composite
def clouds(draw: st.DrawFn) -> dict[str, np.ndarray | None]:
    n = draw(st.integers(1, 12))
    optional = draw(st.tuples(st.booleans(), st.booleans()))
    rng = np.random.default_rng(draw(st.integers(0, 2**32 - 1)))
    normals = rng.normal(size=(n, 3))
    return {
        "points": draw(arrays(float, (n, 3), elements=coordinates)),
        "normals": normals / np.linalg.norm(normals, axis=1, keepdims=True) if optional[0] else None,
        "colours": rng.integers(0, 256, (n, 3)) / 255 if optional[1] else None,
        "viewpoints": draw(arrays(float, (1, 3), elements=coordinates)),
    }


def partly_blind(points: np.ndarray) -> bool:
    """Whether several points, but not all, are 0 0 0: they count as pixels that saw nothing."""
    zeros = np.count_nonzero((points == 0).all(axis=1))
    return 1 < zeros < len(points)


@pytest.mark.parametrize(("suffix", "tolerance"), [(".ply", 0.0), (".npz", 0.0), (".xyz", 5.01e-10)])
@settings(max_examples=40)
@given(parts=clouds())
def test_what_is_written_reads_back(tmp_path: Path, suffix: str, tolerance: float, parts: dict) -> None:
    cloud = PointCloud(**parts)
    assume(not partly_blind(cloud.points if tolerance == 0 else cloud.points.round(9)))
    back = read_cloud(write_cloud(tmp_path / f"cloud{suffix}", cloud))
    np.testing.assert_allclose(back.points, cloud.points, rtol=0, atol=tolerance)
    assert (back.normals is None) == (cloud.normals is None)
    if back.normals is not None:
        np.testing.assert_allclose(back.normals, cloud.normals, atol=2e-9)
    if suffix != ".xyz":
        np.testing.assert_array_equal(back.viewpoints, cloud.viewpoints)
        assert (back.colours is None) == (cloud.colours is None)
        if back.colours is not None:
            np.testing.assert_allclose(back.colours, cloud.colours, atol=1e-12)


@pytest.mark.parametrize("kind", ["<", ">", "ascii", "pcd ascii", "pcd binary", "pcd binary_compressed", "npy", "npz", "csv"])
@settings(max_examples=40)
@given(points=arrays(float, st.tuples(st.integers(1, 20), st.just(3)), elements=coordinates))
def test_doubles_come_back_bit_for_bit_from_every_format(kind: str, points: np.ndarray) -> None:
    assume(not partly_blind(points))
    if kind.startswith("pcd"):
        data = pcd_bytes(xyz_columns(points), kind[4:])
    elif kind in ("npy", "npz"):
        data = npy_bytes(points) if kind == "npy" else npz_bytes(points=points)
    else:
        data = text_bytes(points, ",") if kind == "csv" else ply_bytes(xyz_columns(points), kind)
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "f"
        path.write_bytes(data)
        np.testing.assert_array_equal(read_cloud(path).points, points)


@settings(max_examples=50)
@given(st.one_of(st.binary(max_size=600), st.lists(st.sampled_from([b"abcabc", b"\0" * 300, b"xyz"]), max_size=80).map(b"".join)))
def test_lzf_unpacks_what_it_packed(data: bytes) -> None:
    assert decompress_lzf(compress_lzf(data), len(data)) == data


@pytest.mark.parametrize("broken", [b"\xe0", b"\x20", b"\xff\xff\xff", b"\x05ab", b"\x00a\x20\x05"])
def test_lzf_that_leads_nowhere_is_refused(tmp_path: Path, broken: bytes) -> None:
    path = tmp_path / "f"
    head = pcd_bytes(xyz_columns(POINTS), "binary_compressed").split(b"binary_compressed\n")[0]
    path.write_bytes(head + b"binary_compressed\n" + len(broken).to_bytes(4, "little") + (720).to_bytes(4, "little") + broken)
    with pytest.raises(CloudFileError):
        read_cloud(path)
