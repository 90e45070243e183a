"""Every cloud format as other programs write it, and the one line that refuses what is none."""

import gzip
import struct
import subprocess
import sys
from pathlib import Path

import numpy as np
import pytest

from tests.cloud_files import npy_bytes, npz_bytes, pcd_bytes, ply_bytes, png_bytes, text_bytes, xyz_columns
from weldsim.cloud.files import check_plannable, read_cloud, write_cloud
from weldsim.errors import CloudError, CloudFileError, OutputError, WeldsimError
from weldsim.records import PointCloud

RNG = np.random.default_rng(5)
POINTS = RNG.uniform([-0.1, 0.4, 0.0], [0.2, 0.7, 0.05], (200, 3))
NORMALS = RNG.normal(size=(200, 3))
BYTES = RNG.integers(0, 256, (200, 3))
BYTES[0] = 255
PACKED = (BYTES[:, 0] << 16) | (BYTES[:, 1] << 8) | BYTES[:, 2]


@pytest.fixture
def put(tmp_path: Path):
    def write(data: bytes, name: str = "cloud.ply") -> Path:
        path = tmp_path / name
        path.write_bytes(data)
        return path

    return write


def columns(values: np.ndarray, names: str, code: str) -> list[tuple[str, str, np.ndarray]]:
    return [(name, code, values[:, i]) for i, name in enumerate(names.split())]


FULL = [
    *xyz_columns(POINTS),
    ("intensity", "f4", POINTS[:, 0]),
    *columns(NORMALS, "nx ny nz", "f8"),
    *columns(BYTES, "red green blue", "u1"),
]


@pytest.mark.parametrize("order", ["<", ">", "ascii"])
@pytest.mark.parametrize("newline", ["\n", "\r\n"])
@pytest.mark.parametrize("before", [b"", None])
def test_ply_of_every_order_with_everything_around_the_points(put, order: str, newline: str, before: bytes | None) -> None:
    lead = before if before is not None else b"2 0 1\n" if order == "ascii" else struct.pack(order + "B2i", 2, 0, 1)
    cloud = read_cloud(put(ply_bytes(FULL, order, faces=3, before=lead, newline=newline)))
    np.testing.assert_array_equal(cloud.points, POINTS)
    assert cloud.normals is not None
    assert cloud.colours is not None
    np.testing.assert_allclose(cloud.normals, NORMALS / np.linalg.norm(NORMALS, axis=1, keepdims=True), atol=1e-14)
    np.testing.assert_allclose(cloud.colours, BYTES / 255, atol=1e-14)


@pytest.mark.parametrize("data", ["ascii", "binary", "binary_compressed"])
@pytest.mark.parametrize("code", ["f4", "f8"])
@pytest.mark.parametrize("packed", ["u4", "f4"])
def test_pcd_of_every_kind_with_packed_colours(put, data: str, code: str, packed: str) -> None:
    rgb = PACKED.astype(np.uint32) if packed == "u4" else PACKED.astype(np.uint32).view(np.float32)
    fields = [*xyz_columns(POINTS, code), *columns(NORMALS, "normal_x normal_y normal_z", "f4"), ("rgb", packed, rgb)]
    cloud = read_cloud(put(pcd_bytes(fields, data, viewpoint="0.1 0.2 0.6 1 0 0 0")))
    np.testing.assert_array_equal(cloud.points, POINTS.astype(code).astype(float))
    assert cloud.colours is not None
    assert cloud.normals is not None
    np.testing.assert_allclose(cloud.colours, BYTES / 255, atol=1e-12)
    np.testing.assert_allclose(cloud.normals, NORMALS / np.linalg.norm(NORMALS, axis=1, keepdims=True), atol=1e-6)
    np.testing.assert_array_equal(cloud.viewpoints, [[0.1, 0.2, 0.6]])


def test_the_default_viewpoint_of_a_pcd_says_nothing(put) -> None:
    path = put(pcd_bytes(xyz_columns(POINTS)))
    assert len(read_cloud(path).viewpoints) == 0
    np.testing.assert_array_equal(read_cloud(path, viewpoint=[1, 2, 3]).viewpoints, [[1, 2, 3]])


def test_open3d_and_we_read_the_same(put, tmp_path: Path) -> None:
    import open3d as o3d

    cloud = o3d.geometry.PointCloud(o3d.utility.Vector3dVector(POINTS))
    cloud.colors = o3d.utility.Vector3dVector(BYTES / 255)
    for name, kind in [
        ("a.pcd", {"compressed": True}),
        ("b.pcd", {}),
        ("c.pcd", {"write_ascii": True}),
        ("d.ply", {}),
        ("e.xyz", {}),
    ]:
        o3d.io.write_point_cloud(str(tmp_path / name), cloud, **kind)
        ours, theirs = read_cloud(tmp_path / name), o3d.io.read_point_cloud(str(tmp_path / name))
        np.testing.assert_allclose(ours.points, np.asarray(theirs.points), atol=1e-9)
        if theirs.has_colors():
            assert ours.colours is not None
            np.testing.assert_allclose(ours.colours, np.asarray(theirs.colors), atol=1e-6)
    written = write_cloud(tmp_path / "f.ply", PointCloud(points=POINTS, colours=BYTES / 255))
    np.testing.assert_array_equal(np.asarray(o3d.io.read_point_cloud(str(written)).points), POINTS)


@pytest.mark.parametrize("separator", [" ", "\t", ",", ", ", ";", " ; "])
@pytest.mark.parametrize(
    "head", ["", "# a comment\n\n", "x,y,z\n", "X Y Z\n", "// shown by a scanner\n% and more\n", "200\n", "\ufeff"]
)
def test_text_with_any_separator_and_head(put, separator: str, head: str) -> None:
    cloud = read_cloud(put(text_bytes(POINTS, separator, head), "cloud.csv"))
    np.testing.assert_array_equal(cloud.points, POINTS)


def test_text_columns_by_name_by_value_or_passed_over(put) -> None:
    unit = NORMALS / np.linalg.norm(NORMALS, axis=1, keepdims=True)
    by_name = read_cloud(put(text_bytes(np.hstack([BYTES, POINTS]), ",", "r,g,b,x,y,z\n"), "a.csv"))
    np.testing.assert_array_equal(by_name.points, POINTS)
    assert by_name.colours is not None
    coloured = read_cloud(put(text_bytes(np.hstack([POINTS, BYTES])), "b.xyz"))
    assert coloured.colours is not None
    np.testing.assert_allclose(coloured.colours, BYTES / 255)
    directed = read_cloud(put(text_bytes(np.hstack([POINTS, unit])), "c.xyz"))
    assert directed.normals is not None
    np.testing.assert_allclose(directed.normals, unit)
    wide = read_cloud(put(text_bytes(np.hstack([POINTS, NORMALS, BYTES])), "d.txt"))
    assert wide.colours is None
    np.testing.assert_array_equal(wide.points, POINTS)
    labelled = read_cloud(put(b"".join(b"0.%d 0.2 0.3 plate\n" % i for i in range(9)), "e.txt"))
    assert len(labelled) == 9
    decimal = read_cloud(put(text_bytes(POINTS, ";").replace(b".", b","), "f.csv"))
    np.testing.assert_array_equal(decimal.points, POINTS)


@pytest.mark.parametrize("key", ["points", "xyz", "pcd", "arr_0", "anything"])
@pytest.mark.parametrize("compressed", [True, False])
def test_npz_by_key_and_npy(put, key: str, compressed: bool) -> None:
    np.testing.assert_array_equal(read_cloud(put(npz_bytes(compressed=compressed, **{key: POINTS}))).points, POINTS)
    np.testing.assert_array_equal(
        read_cloud(put(npy_bytes(POINTS.reshape(20, 10, 3).astype(np.float32)))).points, POINTS.astype("f4")
    )
    table = np.zeros(200, [("x", "f8"), ("y", "f8"), ("z", "f8"), ("label", "U3")])
    table["x"], table["y"], table["z"] = POINTS.T
    np.testing.assert_array_equal(read_cloud(put(npy_bytes(table))).points, POINTS)


def test_points_that_are_not_finite_are_dropped_with_what_belongs_to_them(put) -> None:
    points = POINTS.copy()
    points[::7, 1], points[3, 0] = np.nan, np.inf
    keep = np.isfinite(points).all(axis=1)
    cloud = read_cloud(put(ply_bytes([*xyz_columns(points), *columns(BYTES, "red green blue", "u1")])))
    np.testing.assert_array_equal(cloud.points, points[keep])
    assert cloud.colours is not None
    np.testing.assert_allclose(cloud.colours, BYTES[keep] / 255)


def test_normals_without_direction_are_left_for_the_stages(put) -> None:
    normals = NORMALS.copy()
    normals[5] = 0
    assert read_cloud(put(ply_bytes([*xyz_columns(POINTS), *columns(normals, "nx ny nz", "f4")]))).normals is None


@pytest.mark.parametrize("name", ["cloud.pcd", "cloud", "cloud.txt", "CLOUD.PLY"])
def test_the_content_decides_not_the_name(put, name: str) -> None:
    np.testing.assert_array_equal(read_cloud(put(ply_bytes(xyz_columns(POINTS)), name)).points, POINTS)


def test_ten_points_are_a_cloud_and_duplicates_are_kept(put) -> None:
    assert len(read_cloud(put(ply_bytes(xyz_columns(POINTS[:10]))))) == 10
    assert len(read_cloud(put(ply_bytes(xyz_columns(np.repeat(POINTS, 3, axis=0)))))) == 600


def test_units(put) -> None:
    millimetres, metres = put(text_bytes(POINTS * 1e3), "mm.xyz"), put(text_bytes(POINTS), "m.xyz")
    with pytest.raises(CloudError, match=r"spans 29\d\.?\d* m read in m .*--units mm"):
        read_cloud(millimetres)
    np.testing.assert_allclose(read_cloud(millimetres, unit="mm").points, POINTS, atol=1e-15)
    np.testing.assert_allclose(read_cloud(put(text_bytes(POINTS * 100)), unit="cm").points, POINTS, atol=1e-15)
    with pytest.raises(CloudError, match=r"--units m$"):
        read_cloud(metres, unit="mm")
    stray = POINTS.copy()
    stray[0] = 40
    with pytest.raises(CloudError, match=r"96 % of the points lie within 0\.29\d m: remove the stray ones"):
        read_cloud(put(text_bytes(stray)))
    pcd = put(pcd_bytes(xyz_columns(POINTS * 1e3), viewpoint="100 200 600 1 0 0 0"))
    np.testing.assert_allclose(read_cloud(pcd, unit="mm").viewpoints, [[0.1, 0.2, 0.6]])


PLY, PCD = ply_bytes(xyz_columns(POINTS)), pcd_bytes(xyz_columns(POINTS), "binary_compressed")
HUGE = "99999999999999999"
UNUSABLE = {
    "empty": (b"", "is empty"),
    "prose": (b"This is no cloud.\nIt has words.\n" * 50, "no cloud"),
    "prose with numbers": (b"1 2 3\nfour five six\n", "cannot be read"),
    "short rows": (b"1 2 3\n1 2\n", "cannot be read"),
    "two columns": (b"1 2\n3 4\n", "no cloud"),
    "json": (b'{"points": [[1, 2, 3]]}', "no cloud"),
    "binary": (bytes(range(256)) * 10, "binary"),
    "png": (png_bytes(np.zeros((4, 4), np.uint16)), "--intrinsics"),
    "ply header only": (PLY[: PLY.index(b"end_header") + 11], "promises"),
    "ply without end": (PLY[:80], "does not end"),
    "ply cut off": (PLY[:-1], "cut off"),
    "ply absurd count": (PLY.replace(b"vertex 200", f"vertex {HUGE}".encode()), "promises"),
    "ply no points": (PLY.replace(b"vertex 200", b"vertex 0"), "0 points"),
    "ply no z": (PLY.replace(b" z\n", b" q\n"), "no x, y and z"),
    "ply twice x": (PLY.replace(b" z\n", b" x\n"), "same name"),
    "ply no format": (PLY.replace(b"format", b"comment"), "no format"),
    "ply odd type": (PLY.replace(b"double x", b"quad x"), "'property quad x'"),
    "ply ascii cut off": (ply_bytes(xyz_columns(POINTS), "ascii")[:-70], "promises 200 points"),
    "ply ascii absurd": (ply_bytes(xyz_columns(POINTS), "ascii").replace(b"vertex 200", b"vertex 4000000000"), "promises"),
    "pcd cut off": (pcd_bytes(xyz_columns(POINTS))[:-1], "cut off"),
    "pcd compressed cut off": (PCD[:-1], "cut off"),
    "pcd absurd count": (pcd_bytes(xyz_columns(POINTS)).replace(b"POINTS 200", f"POINTS {HUGE}".encode()), "limit"),
    "pcd many": (pcd_bytes(xyz_columns(POINTS)).replace(b"POINTS 200", b"POINTS 40000000"), "cut off"),
    "pcd odd size": (pcd_bytes(xyz_columns(POINTS)).replace(b"SIZE 8", b"SIZE 7"), "SIZE 7"),
    "pcd uneven": (pcd_bytes(xyz_columns(POINTS)).replace(b"SIZE 8 8 8", b"SIZE 8 8"), "different lengths"),
    "pcd odd data": (pcd_bytes(xyz_columns(POINTS)).replace(b"DATA binary", b"DATA magic"), "'magic'"),
    "npy objects": (npy_bytes(np.array([[None, 1, 2]])), "never loaded"),
    "npy text": (npy_bytes(np.array([["a", "b", "c"]])), "not numbers"),
    "npy shape": (npy_bytes(np.zeros((5, 2))), "shape"),
    "npy cut off": (npy_bytes(POINTS)[:-1], "cut off"),
    "npy absurd": (npy_bytes(POINTS).replace(b"(200, 3), }      ", b"(2000000000, 3),}"), "promises"),
    "npz other keys": (npz_bytes(a=POINTS, b=POINTS), "no array called"),
    "npz cut off": (npz_bytes(points=POINTS)[:-30], "damaged"),
    "all nan": (ply_bytes(xyz_columns(POINTS * np.nan)), "none of its 200 points is finite"),
}


@pytest.mark.parametrize("name", UNUSABLE)
def test_what_is_no_cloud_is_refused_in_one_line(put, name: str) -> None:
    data, words = UNUSABLE[name]
    path = put(data, "thing.bin")
    with pytest.raises((CloudFileError, CloudError)) as caught:
        read_cloud(path)
    assert str(caught.value).startswith(str(path))
    assert words in str(caught.value)
    assert len(str(caught.value).splitlines()) == 1
    assert caught.value.data["path"] == str(path)


def test_what_is_no_file_is_refused(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    with pytest.raises(CloudFileError, match="no such file"):
        read_cloud(tmp_path / "missing.ply")
    with pytest.raises(CloudFileError, match="is a folder, a file is needed"):
        read_cloud(tmp_path)
    (tmp_path / "cloud.ply").touch()  # as in a run directory
    with pytest.raises(CloudFileError, match=r"is a folder; did you mean .*cloud\.ply\?"):
        read_cloud(tmp_path)
    with pytest.raises(CloudFileError, match="no regular file"):
        read_cloud("/dev/null")
    with pytest.raises(CloudFileError):
        read_cloud("a\0b")
    path = tmp_path / "secret.ply"
    path.write_bytes(PLY)

    def denied(self: Path) -> bytes:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr(Path, "read_bytes", denied)  # the tests may run as root, whom no mode stops
    with pytest.raises(CloudFileError, match="Permission denied"):
        read_cloud(path)


@pytest.mark.parametrize("viewpoint", [[1, 2], [1, 2, np.nan], [1, 2, 3, 4]])
def test_a_viewpoint_is_three_numbers(put, viewpoint: list) -> None:
    with pytest.raises(CloudError, match="three finite numbers"):
        read_cloud(put(PLY), viewpoint=viewpoint)


@pytest.mark.parametrize(
    ("points", "words"),
    [
        (POINTS[:3], "has 3 points, planning needs 100"),
        (np.outer(np.linspace(0, 1, 200), [0.1, 0.2, 0.3]), "is a line"),
        (np.repeat(POINTS[:1], 200, axis=0), "spans 0 mm"),
        (POINTS / 1e3, "check its unit"),
        (np.zeros((0, 3)), "has 0 points"),
    ],
)
def test_what_cannot_be_planned_on(points: np.ndarray, words: str) -> None:
    with pytest.raises(CloudError, match=words):
        check_plannable(PointCloud(points=points))


def test_a_plate_can_be_planned_on() -> None:
    check_plannable(PointCloud(points=POINTS))
    check_plannable(PointCloud(points=POINTS * [1, 1, 0]))


def test_writing_refuses_other_formats_and_leaves_nothing_behind(tmp_path: Path) -> None:
    cloud = PointCloud(points=POINTS)
    with pytest.raises(OutputError, match=r"\.ply, \.npz, \.xyz"):
        write_cloud(tmp_path / "a.las", cloud)
    with pytest.raises(OutputError):
        write_cloud(tmp_path / "missing" / "a.ply", cloud)
    assert list(tmp_path.iterdir()) == []


def test_the_real_scan(real_data: Path) -> None:
    cloud = read_cloud(real_data / "curved_groove_scan.ply")
    assert len(cloud) == 58_454
    assert np.ptp(cloud.points, axis=0)[:2] == pytest.approx([0.245, 0.230], abs=0.001)
    check_plannable(cloud)


def test_reading_a_cloud_loads_no_heavy_library() -> None:
    heavy = {"open3d", "mujoco", "numba", "trimesh", "mink", "cv2", "matplotlib", "plotly", "scipy"}
    code = f"import sys, weldsim.cloud.files; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_errors_share_a_root() -> None:
    assert issubclass(CloudFileError, WeldsimError)
    assert CloudFileError.exit_code == CloudError.exit_code == 2


def test_gzip_is_unpacked_and_damage_in_it_named(tmp_path):
    points = np.random.default_rng(0).uniform(0, 0.3, (500, 3))
    write_cloud(tmp_path / "a.ply", PointCloud(points=points))
    packed = gzip.compress((tmp_path / "a.ply").read_bytes())
    (tmp_path / "a.ply.gz").write_bytes(packed)
    np.testing.assert_array_equal(read_cloud(tmp_path / "a.ply.gz").points, points)
    for damaged in (packed[:-9], packed[:40] + b"\xff" * 9 + packed[49:], packed[:1] + b"\x8b"):
        (tmp_path / "a.ply.gz").write_bytes(damaged)
        with pytest.raises(CloudFileError, match="its gzip data is damaged or cut off"):
            read_cloud(tmp_path / "a.ply.gz")


def test_wide_text_is_named(tmp_path):
    np.save(tmp_path / "depth.npy", np.full((96, 128), 0.4))
    with pytest.raises(CloudFileError, match="--intrinsics"):
        read_cloud(tmp_path / "depth.npy")


@pytest.mark.parametrize("unit", ["m", "mm"])
def test_survey_coordinates_need_doubles(tmp_path, unit):
    points = np.random.default_rng(0).uniform(0, 0.3, (500, 3)) + np.array([500_000.0, 4_500_000.0, 100.0])
    scale = {"m": 1.0, "mm": 1e3}[unit]
    np.save(tmp_path / "double.npy", points * scale)
    assert np.allclose(read_cloud(tmp_path / "double.npy", unit=unit).points, points, rtol=0, atol=1e-8)
    np.save(tmp_path / "single.npy", (points * scale).astype(np.float32))
    with pytest.raises(CloudError, match="single-precision coordinates reach"):
        read_cloud(tmp_path / "single.npy", unit=unit)
    np.save(tmp_path / "near.npy", (points - [499_900.0, 4_499_900.0, 0.0]).astype(np.float32) * np.float32(scale))
    assert len(read_cloud(tmp_path / "near.npy", unit=unit)) == 500


@pytest.mark.parametrize("suffix", [".ply", ".npz"])
def test_every_view_of_a_cloud_is_kept(suffix: str, tmp_path: Path) -> None:
    """A file without them would be planned as one view, or none."""
    eyes, view = np.array([[0.0, -0.4, 0.5], [0.1, -0.7, 0.4], [-0.2, -0.5, 0.6]]), np.arange(len(POINTS)) % 3
    cloud = PointCloud(points=POINTS, viewpoints=eyes, view=view, colours=BYTES / 255)
    back = read_cloud(write_cloud(tmp_path / f"views{suffix}", cloud))
    np.testing.assert_array_equal(back.viewpoints, eyes)
    np.testing.assert_array_equal(back.view, view)
    np.testing.assert_array_equal(back.points, POINTS)
    np.testing.assert_allclose(back.colours, BYTES / 255)
