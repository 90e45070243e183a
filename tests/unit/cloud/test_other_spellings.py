"""Clouds as other programs spell them: no return, brackets, encodings, axes apart, where the camera stood."""

from collections.abc import Callable
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from tests.cloud_files import npy_bytes, npz_bytes
from weldsim.cloud.files import read_cloud
from weldsim.columns import plain_numbers
from weldsim.errors import CloudFileError

POINTS = np.random.default_rng(3).uniform([-0.1, 0.4, 0.01], [0.2, 0.7, 0.05], (150, 3)).round(6)
ROWS = [f"{x:.6f} {y:.6f} {z:.6f}" for x, y, z in POINTS]
VERTEX = ["element vertex 150", "property float x", "property float y", "property float z"]
WORDS = ["nan", "-nan(ind)", "nan(snan)", "-1.#IND", "1.#QNAN", "1.#QNAN0", "NA", "null", "None", "#N/A", "0"]
VIEW = ("view_px", "view_py", "view_pz", "x_axisx")
PCL_CAMERA = ["element camera 1", *(f"property float {name}" for name in VIEW), "property int viewportx"]


def ply(rows: list[str], *more: str, vertex: list[str] = VERTEX, newline: str = "\n") -> bytes:
    return newline.join(["ply", "format ascii 1.0", *vertex, *more, "end_header", *rows, ""]).encode()


def pcd(rows: list[str], fields: str = "FIELDS", data: str = "ascii") -> bytes:
    head = [f"{fields} x y z", "SIZE 4 4 4", "TYPE F F F", "WIDTH 150", "HEIGHT 1", "POINTS 150", f"DATA {data}"]
    return "\n".join(["# .PCD v0.7", "VERSION 0.7", *head, *rows, ""]).encode()


def text(rows: list[str]) -> bytes:
    return "\n".join(rows).encode()


@pytest.fixture
def read(tmp_path: Path) -> Callable[[bytes], ndarray]:
    def read(data: bytes) -> ndarray:
        (tmp_path / "cloud").write_bytes(data)
        return read_cloud(tmp_path / "cloud").points

    return read


@pytest.mark.parametrize("write", [ply, pcd, text])
@pytest.mark.parametrize("word", WORDS)
def test_a_pixel_that_saw_nothing_is_left_out_however_it_is_spelt(read, write: Callable[[list[str]], bytes], word: str) -> None:
    blind = [f"{word} {word} {word}" if i % 10 == 0 else row for i, row in enumerate(ROWS)]  # the first row too
    np.testing.assert_allclose(read(write(blind)), POINTS[np.arange(150) % 10 != 0], atol=1e-7)


@pytest.mark.parametrize("empty", [",,", "NA,NA,NA", " , , ", "0.1,,0.2"])
def test_empty_cells_of_a_table_are_no_point(read, empty: str) -> None:
    rows = [empty if i % 10 == 4 else row.replace(" ", ",") for i, row in enumerate(ROWS)]
    np.testing.assert_allclose(read(text(["x,y,z", *rows])), POINTS[np.arange(150) % 10 != 4], atol=1e-7)


def test_one_point_at_the_origin_is_a_point(read) -> None:
    assert len(read(text(["0 0 0", *ROWS]))) == 151
    assert len(read(text(["0 0 0", "0 0 0", *ROWS]))) == 150


@pytest.mark.parametrize(
    "data",
    [
        text([f"[{row.replace(' ', ', ')}]," for row in ROWS]),
        b"[[" + b"], [".join(row.replace(" ", ", ").encode() for row in ROWS) + b"]]",
        text([f"({row.replace(' ', ', ')})" for row in ROWS]),
        text(["x|y|z", *(row.replace(" ", "|") for row in ROWS)]),
        "\r\n".join(["X\tY\tZ", *(row.replace(" ", "\t") for row in ROWS)]).encode("utf-16"),
        "\r\n".join(["x;y;z", *(row.replace(" ", ";").replace(".", ",") for row in ROWS)]).encode("utf-16"),
        ply(ROWS, newline="\r"),
        ply(ROWS, vertex=["element point 150", *VERTEX[1:]]),
        pcd(ROWS, "COLUMNS"),
        pcd(ROWS, data="ASCII"),
        npy_bytes(POINTS.T.copy()),
        npy_bytes(np.moveaxis(np.tile(POINTS, (1, 1)).reshape(2, 75, 3), -1, 0).copy()),
        npz_bytes(x=POINTS[:, 0], y=POINTS[:, 1], z=POINTS[:, 2]),
        npz_bytes(X=POINTS[:, 0], Y=POINTS[:, 1], Z=POINTS[:, 2]),
        npz_bytes(pointcloud=POINTS, rgb=POINTS),
    ],
)
def test_what_can_be_understood_is_understood(read, data: bytes) -> None:
    np.testing.assert_allclose(read(data), POINTS, atol=1e-7)


def test_where_the_camera_stood_is_read_as_pcl_writes_it(tmp_path: Path) -> None:
    for place, viewpoints in (("0 -0.45 0.42", [[0, -0.45, 0.42]]), ("0 0 0", np.zeros((0, 3)))):
        (tmp_path / "a.ply").write_bytes(ply([*ROWS, f"{place} 1 150"], *PCL_CAMERA))
        np.testing.assert_allclose(read_cloud(tmp_path / "a.ply").viewpoints, viewpoints, atol=1e-6)


@pytest.mark.parametrize(
    ("data", "words"),
    [
        (npy_bytes(np.c_[POINTS, np.ones(150)].T.copy()), "save its transpose"),
        (npy_bytes(POINTS.astype(np.float16)), "half precision"),
        (npz_bytes(x=POINTS[:, 0], y=POINTS[:, 1], z=POINTS[:9, 2]), "150, 150, 9 numbers"),
    ],
)
def test_the_rest_is_refused_for_what_it_is(read, data: bytes, words: str) -> None:
    with pytest.raises(CloudFileError, match=words):
        read(data)


@pytest.mark.parametrize("letter", ["D", "d", "E"])
@pytest.mark.parametrize("head", ["", "x y z\n", "# made by a Fortran program, in metres\n"])
def test_fortrans_exponents(read, letter: str, head: str) -> None:
    rows = [" ".join(f"{value:.6e}".replace("e", letter) for value in point) for point in POINTS]
    np.testing.assert_allclose(read(head.encode() + text(rows)), POINTS, atol=1e-6)
    assert plain_numbers("1.5D-03;-.2d+01;3D") == "1.5e-03;-.2e+01;3D"
