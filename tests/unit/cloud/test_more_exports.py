"""Clouds, poses and cameras as more programs export them: understood, or refused for what they are."""

import json
import struct
from pathlib import Path

import numpy as np
import pytest

from tests.cloud_files import ply_bytes, xyz_columns
from weldsim.cloud.camera_files import read_camera
from weldsim.cloud.files import read_cloud
from weldsim.cloud.pose_files import read_pose
from weldsim.columns import decode, plain_numbers, unit_of_comments, utf_16
from weldsim.errors import CloudError, CloudFileError

POINTS = np.round(np.random.default_rng(0).uniform(-1.4, 1.4, (150, 3)), 6)


@pytest.fixture
def read(tmp_path: Path):
    def reader(data: bytes | str, **options) -> np.ndarray:
        (tmp_path / "cloud").write_bytes(data if isinstance(data, bytes) else data.encode())
        return read_cloud(tmp_path / "cloud", **options).points

    return reader


def text(head: str, rows, sep: str = ",") -> str:
    return "\n".join([*([head] if head else []), *(sep.join(map(str, row)) for row in rows), ""])


def test_columns_of_names_between_numbers_do_not_matter_where_x_y_and_z_are_named(read) -> None:
    rows = [[i, 12.5, "base_link", *point, "ok"] for i, point in enumerate(POINTS)]
    np.testing.assert_array_equal(read(text("seq,stamp.secs,header.frame_id,x,y,z,state", rows)), POINTS)
    with pytest.raises(CloudFileError, match="none of its first 64 lines"):
        read(text("seq,secs,frame,a,b,c,state", rows))


@pytest.mark.parametrize(
    ("thousands", "decimal"), [(".", ","), (",", "."), (" ", ","), ("'", "."), ("\u00a0", ","), ("\u202f", ","), ("\u2019", ".")]
)
@pytest.mark.parametrize("between", [";", "\t", '","'])
def test_marks_between_thousands(read, thousands: str, decimal: str, between: str) -> None:
    def cell(value: float) -> str:
        return f"{1e3 * value:,.3f}".translate({ord(","): thousands, ord("."): decimal})

    quote = '"' if between == '","' else ""
    sep = "," if quote else between
    rows = "\n".join(quote + between.join(map(cell, point)) + quote for point in POINTS)
    np.testing.assert_allclose(read(f"x [mm]{sep}y [mm]{sep}z [mm]\n{rows}\n"), POINTS, atol=1e-9)


@pytest.mark.parametrize("line", ["1.234,5.678,9.012", "12 345 678.5", "1,234,567", "1.234;2.345;3.456", "1 234.5 2 345.6"])
def test_marks_that_may_part_columns_are_left(line: str) -> None:
    assert plain_numbers(line) == line


def test_row_and_column_before_a_scans_points_are_not_taken_for_x_and_y_and_the_advice_works(read) -> None:
    rows = [[i // 10, i % 10, *point, 0.5] for i, point in enumerate(POINTS)]
    with pytest.raises(
        CloudFileError, match=r"row and column of a scan perhaps: name the columns in a first line \(row column x y z"
    ):
        read(text("", rows, " "))
    np.testing.assert_array_equal(read(text("row column x y z i", rows, " ")), POINTS)
    whole = [[10 * (i % 15), 10 * (i // 15), 0.25, 7, 8, 9] for i in range(150)]  # a height map in mm with colours
    assert len(read(text("", whole, " "), unit="mm")) == 150


@pytest.mark.parametrize("codec", ["utf-16-le", "utf-16-be"])
def test_utf_16_without_its_mark(read, codec: str) -> None:
    data = text("x;y;z", POINTS, ";").encode(codec)
    assert utf_16(data) == codec
    np.testing.assert_array_equal(read(data), POINTS)
    assert decode(data).startswith("x;y;z\n")
    assert utf_16(b"x;y;z\n1;2;3\n1;2;3\n1;2;3\n") is None


@pytest.mark.parametrize(
    ("line", "unit"),
    [
        ("# units: mm", "mm"), ("# Unit [cm]", "cm"), ("// unit of length is inch", "inch"), ("# units in: mm", "mm"),
        ("# intensity has no unit", None), ("# units in", None), ("# unit normals", None), ("units: mm", "mm"),
        ("Unit;mm", "mm"), ("Einheit: mm", "mm"), ("Units: in", "in"),
        ("# mm", "mm"), ("# all coordinates in mm", "mm"), ("# in", None),
        ("// dimensions in inches", "inches"), ("# obtained in mm", None), ("Scan in mm", None), ("unit,x,y,z", None),
    ],
)  # fmt: skip
def test_a_unit_in_a_comment(read, line: str, unit: str | None) -> None:
    assert unit_of_comments([line]) == unit
    if unit == "mm":
        np.testing.assert_allclose(read(text(f"{line}\nx,y,z", POINTS * 1e3)), POINTS, atol=1e-9)
        np.testing.assert_allclose(read(text(line, POINTS * 1e3)), POINTS, atol=1e-9)
        ply = ply_bytes(xyz_columns(POINTS * 1e3)).replace(b"comment made for a test", f"comment {line.lstrip('# ')}".encode())
        np.testing.assert_allclose(read(ply), POINTS, atol=1e-9)
        with pytest.raises(CloudError, match="--units cm, but its header says mm; leave --units out"):
            read(ply, unit="cm")


def test_lists_that_belong_to_the_vertices_of_a_ply(read) -> None:
    def head(kind: str, *properties: str) -> bytes:
        names = "".join(f"property {each}\n" for each in properties)
        return f"ply\nformat {kind} 1.0\nelement vertex {len(POINTS)}\n{names}end_header\n".encode()

    axes, listed = ("double x", "double y", "double z"), "list uchar float tex"
    for order, kind in (("<", "binary_little_endian"), (">", "binary_big_endian")):
        after = b"".join(struct.pack(f"{order}3dB2f", *point, 2, 0, 1) for point in POINTS)
        np.testing.assert_array_equal(read(head(kind, *axes, listed) + after), POINTS)
        before = b"".join(struct.pack(f"{order}B2f3d", 2, 0, 1, *point) for point in POINTS)
        np.testing.assert_array_equal(read(head(kind, listed, *axes) + before), POINTS)
        lists = [[0.5] * (i % 4) for i in range(len(POINTS))]
        uneven = [struct.pack(f"{order}2dB{len(t)}fd", x, y, len(t), *t, z) for (x, y, z), t in zip(POINTS, lists, strict=True)]
        np.testing.assert_array_equal(read(head(kind, *axes[:2], listed, axes[2]) + b"".join(uneven)), POINTS)
        with pytest.raises(CloudFileError, match="its header promises 150 points, the file holds 149: cut off"):
            read(head(kind, *axes[:2], listed, axes[2]) + b"".join(uneven)[:-1])
    rows = "\n".join(f"{x} {y} {z} {i % 3} {'7 ' * (i % 3)}" for i, (x, y, z) in enumerate(POINTS))
    np.testing.assert_array_equal(read(head("ascii", *axes, listed) + rows.encode()), POINTS)
    first = [f"{i % 3} {'7 ' * (i % 3)}{x} {y} {z}" for i, (x, y, z) in enumerate(POINTS)]
    np.testing.assert_array_equal(read(head("ascii", listed, *axes) + "\n".join(first).encode()), POINTS)
    for damaged, words in (([*first[:-1], "2 7"], "its vertex 150 cannot be read"), (first[:-1], "the file holds 149")):
        with pytest.raises(CloudFileError, match=words):
            read(head("ascii", listed, *axes) + ("\n".join(damaged) + "\n" * 999).encode())


@pytest.mark.parametrize(
    ("data", "says"),
    [
        (b"\x89HDF\r\n\x1a\n" + bytes(99), "an HDF5 file, as Zivid's ZDF"),
        (b"#ROSBAG V2.0\n" + bytes(99), "a ROS bag; export the cloud"),
        (b"glTF\x02" + bytes(99), "a glTF mesh"),
        (b"version https://git-lfs.github.com/spec/v1\noid sha256:0\n", "git lfs pull"),
        (b"PK\x03\x04" + bytes(26) + b"[Content_Types].xml" + bytes(99), "an Excel workbook; save the sheet as CSV"),
        (b"<!DOCTYPE html><html></html>", "a web page"),
    ],
)
def test_other_files_are_called_what_they_are(read, data: bytes, says: str) -> None:
    with pytest.raises(CloudFileError, match=says):
        read(data)


def test_a_pose_with_units_in_its_keys_and_one_whose_angles_are_open(tmp_path: Path) -> None:
    path = tmp_path / "pose.json"
    path.write_text(json.dumps({"x_mm": 100, "y_mm": -750, "z_mm": 550, "roll_deg": 180, "pitch_deg": 0, "yaw_deg": 90}))
    pose = read_pose(path)
    np.testing.assert_allclose(pose.p, [0.1, -0.75, 0.55])
    np.testing.assert_allclose(pose.R, [[0, 1, 0], [1, 0, 0], [0, 0, -1]], atol=1e-12)
    place = {"x": 0.1, "y": -0.75, "z": 0.55}
    path.write_text(json.dumps({**place, "rx": 3.1, "ry": 0.0, "rz": 0.1}))
    with pytest.raises(CloudFileError, match=r"rx, ry, rz: a rotation vector, or angles.*rotation_vector \[rx, ry, rz\]"):
        read_pose(path)
    path.write_text(json.dumps({**place, "rotation_vector": [3.1, 0.0, 0.1]}))
    np.testing.assert_allclose(read_pose(path).rotation_vector, [3.1, 0.0, 0.1])


def test_the_camera_of_nerf_tools() -> None:
    camera = read_camera({"w": 640, "h": 480, "fl_x": 620.0, "fl_y": 619.0, "cx": 311.0, "cy": 227.0, "k1": 0.1, "k2": -0.2})
    assert (camera.width, camera.fx, camera.fy, camera.distortion[:2]) == (640, 620.0, 619.0, (0.1, -0.2))


def test_columns_of_ply_and_pcd_by_other_names_are_believed_with_their_units(read) -> None:
    x, y, z = POINTS.T * 1e3
    ply = ply_bytes([("intensity", "f8", x), ("z_mm", "f8", z), ("posy_mm", "f8", y), ("px_mm", "f8", x)])
    np.testing.assert_allclose(read(ply), POINTS, atol=1e-9)
    rows = "".join(f"{x} {y} {z}\n" for x, y, z in POINTS * 1e3)
    head = f"VERSION 0.7\nFIELDS {{}}\nSIZE 8 8 8\nTYPE F F F\nWIDTH {len(POINTS)}\nHEIGHT 1\nDATA ascii\n"
    np.testing.assert_allclose(read(head.format("x_mm y_mm z_mm") + rows), POINTS, atol=1e-9)
    np.testing.assert_allclose(read("# .PCD v0.7\n# units: mm\n" + head.format("x y z") + rows), POINTS, atol=1e-9)
    for names in ("x_mm y_mm z_cm", "x_mm px_mm z_mm", "a b c"):
        with pytest.raises(CloudFileError, match=r"(are not in one unit that is known|it has no x, y and z)"):
            read(head.format(names) + rows)


@pytest.mark.parametrize("scale", [1e6, 1e4])
def test_whole_numbers_are_told_to_be_micrometres_or_counts_and_the_remedy_works(read, scale: float) -> None:
    """Not to be of single precision, which they need not be."""
    x, y = np.meshgrid(np.arange(-0.12, 0.12, 0.0011), np.arange(-0.53, -0.37, 0.0013))
    points = np.round(np.column_stack([x.ravel(), y.ravel(), 0.01 * np.sin(40 * x.ravel())]), 4)
    rows = text("x,y,z", np.round(points * scale).astype(int))
    if scale == 1e6:
        with pytest.raises(CloudError, match=r"it looks like micrometres: pass --units um$"):
            read(rows)
        np.testing.assert_allclose(read(rows, unit="um"), points, atol=1e-9)
        np.testing.assert_allclose(read("# units: um\n" + rows), points, atol=1e-9)
    else:
        with pytest.raises(CloudError, match="its coordinates are whole numbers, counts of a sensor perhaps: multiply them"):
            read(rows)


def test_a_header_in_metres_over_millimetres_is_told_and_feet_are_read(read) -> None:
    with pytest.raises(CloudError, match="its header says metres, but it looks like millimetres: correct the header"):
        read(text("x [m],y [m],z [m]", np.round(POINTS * 1e3, 3)))
    np.testing.assert_allclose(read(text("# units: feet", POINTS / 0.3048)), POINTS, atol=1e-9)
    with pytest.raises(CloudError, match=r"read in um \(least 5 mm\); it looks like millimetres: pass --units mm"):
        read(text("", POINTS * 1e3), unit="um")


def test_a_label_before_the_points_is_not_taken_for_x_and_the_advice_works(read) -> None:
    rows = [[i * 7 % 3, *point] for i, point in enumerate(POINTS)]
    with pytest.raises(CloudFileError, match=r"a label or an intensity perhaps: name the columns in a first line \(label x y z"):
        read(text("", rows, " "))
    np.testing.assert_array_equal(read(text("label x y z", rows, " ")), POINTS)
    profile = [[i % 15, i // 15 + 0.5, 0.25, 7] for i in range(150)]  # x in whole millimetres and an intensity behind
    assert len(read(text("", profile, " "), unit="mm")) == 150


def test_colours_of_16_bits(tmp_path: Path) -> None:
    colours = np.random.default_rng(0).integers(0, 256, (150, 3))
    bands = [(name, "u2", column * 257) for name, column in zip(("red", "green", "blue"), colours.T, strict=True)]
    (tmp_path / "a.ply").write_bytes(ply_bytes([*xyz_columns(POINTS), *bands]))
    found = read_cloud(tmp_path / "a.ply").colours
    assert found is not None
    np.testing.assert_allclose(found, colours / 255, atol=1e-6)
