"""Text clouds whose columns have names: believed, with their units, or refused with the list of them."""

from pathlib import Path

import numpy as np
import pytest

from weldsim.cloud.files import read_cloud
from weldsim.errors import CloudError, CloudFileError

RNG = np.random.default_rng(9)
POINTS = RNG.uniform([-0.1, 0.4, 0.0], [0.2, 0.7, 0.05], (150, 3)).round(6)
X, Y, Z = POINTS.T
ONES = np.arange(150.0)


def written(path: Path, header: str, columns: list[np.ndarray], separator: str = ",", decimal: str = ".") -> Path:
    rows = [
        separator.join(f"{value:.6f}".rstrip("0").rstrip(".").replace(".", decimal) for value in row)
        for row in zip(*columns, strict=True)
    ]
    path.write_text("\n".join([header, *rows, ""]), encoding="utf-8")
    return path


@pytest.mark.parametrize(
    ("header", "columns", "separator"),
    [
        ("Y[m];X[m];Z[m]", [Y, X, Z], ";"),
        ("Z (m),Y (m),X (m)", [Z, Y, X], ","),
        ("pos_y,pos_x,pos_z", [Y, X, Z], ","),
        ('"RGB:0","RGB:1","RGB:2","Points:0","Points:1","Points:2"', [ONES, ONES, ONES, X, Y, Z], ","),
        ("nx ny nz x y z", [ONES, ONES, ONES, X, Y, Z], " "),
        ("ID\tX\tY\tZ", [ONES, X, Y, Z], "\t"),
        ("Intensity X Y Z", [ONES, X, Y, Z], " "),
        ("//X Y Z R G B Scalar_field Nx Ny Nz", [X, Y, Z, ONES, ONES, ONES, ONES, ONES, ONES, ONES], " "),
        ("# z, y, x", [Z, Y, X], ", "),
        ("Z [mm];Y [cm];X [m]", [Z * 1e3, Y * 1e2, X], ";"),
        ("y_mm,x_mm,z_mm", [Y * 1e3, X * 1e3, Z * 1e3], ","),
        ("z,y,x\nmm,mm,mm", [Z * 1e3, Y * 1e3, X * 1e3], ","),
        ("%time,field.y,field.x,field.z", [ONES, Y, X, Z], ","),
        (",y,x,z", [ONES, Y, X, Z], ","),
        ("0,1,2", [X, Y, Z], ","),
        ("Northing,Easting,Elevation", [Y, X, Z], ","),
        ("gps time;z in mm;y in mm;x in mm", [ONES, Z * 1e3, Y * 1e3, X * 1e3], ";"),
        ("Z/mm\tY/mm\tX/mm", [Z * 1e3, Y * 1e3, X * 1e3], "\t"),
    ],
)
def test_names_say_where_the_coordinates_are(tmp_path: Path, header: str, columns: list[np.ndarray], separator: str) -> None:
    np.testing.assert_allclose(read_cloud(written(tmp_path / "a.csv", header, columns, separator)).points, POINTS, atol=2e-6)


@pytest.mark.parametrize("separator", [";", " ", "\t"])
@pytest.mark.parametrize("header", ["# none", "z{0}y{0}x"])
def test_decimal_commas_with_and_without_a_header(tmp_path: Path, separator: str, header: str) -> None:
    columns = [X, Y, Z] if header.startswith("#") else [Z, Y, X]
    path = written(tmp_path / "a.csv", header.format(separator), columns, separator, ",")
    np.testing.assert_allclose(read_cloud(path).points, POINTS, atol=1e-6)


def test_decimal_commas_between_commas_are_refused_and_semicolons_help(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "# none", [X, Y, Z / 10], ",", ",")
    with pytest.raises(CloudFileError, match=r"decimal commas.*put ; between"):
        read_cloud(path)
    assert len(read_cloud(written(path, "# none", [X, Y, Z / 10], ";", ","))) == 150
    with pytest.raises(CloudFileError, match=r"twice as many columns as there are names.*put ; between"):
        read_cloud(written(path, "x,y,z", [X, Y, Z], ",", ","))


@pytest.mark.parametrize("header", ["Depth,Y,X", "u,v,w", "left,right,up", "x,y,height_above", "a_x,b_x,z"])
def test_names_that_are_not_understood_are_refused_with_all_of_them_and_renaming_helps(tmp_path: Path, header: str) -> None:
    path = written(tmp_path / "a.csv", header, [Z, Y, X])
    with pytest.raises(CloudFileError, match=f"{header.replace(',', ', ')}; name") as caught:
        read_cloud(path)
    assert len(str(caught.value).splitlines()) == 1
    np.testing.assert_allclose(read_cloud(written(path, "z,y,x", [Z, Y, X])).points, POINTS, atol=1e-6)


def test_a_unit_in_the_names_is_believed_and_contradicted_in_one_line(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "x [mm],y [mm],z [mm]", [X * 1e3, Y * 1e3, Z * 1e3])
    np.testing.assert_allclose(read_cloud(path, unit="mm").points, POINTS, atol=1e-6)
    with pytest.raises(CloudError, match="--units cm, but its header says mm; leave --units out"):
        read_cloud(path, unit="cm")
    np.testing.assert_allclose(read_cloud(path).points, POINTS, atol=1e-6)
    with pytest.raises(CloudFileError, match=r"its column 'x \[deg\]' is in deg; lengths are in m, cm, mm or in"):
        read_cloud(written(path, "x [deg],y [deg],z [deg]", [X, Y, Z]))


def test_rows_that_are_numbered_without_a_name_say_so_and_a_name_helps(tmp_path: Path) -> None:
    path = written(tmp_path / "a.xyz", "# none", [ONES, X, Y, Z], " ")
    with pytest.raises(CloudError, match=r"counts the rows: name the columns in a first line \(id x y z"):
        read_cloud(path)
    np.testing.assert_allclose(read_cloud(written(path, "id x y z", [ONES, X, Y, Z], " ")).points, POINTS, atol=1e-6)


def test_a_later_line_that_is_no_row_is_named(tmp_path: Path) -> None:
    path = written(tmp_path / "a.csv", "# none", [X, Y, Z])
    path.write_text(path.read_text() + "0.1,zwei,0.3\n")
    with pytest.raises(CloudFileError, match=r"line 152: '0.1,zwei,0.3'"):
        read_cloud(path)


@pytest.mark.parametrize("mark", ["#", "//", "%", "!", ";", "--", "REM"])
def test_comments_never_matter_whatever_they_begin_with_and_are_written_in(tmp_path: Path, mark: str) -> None:
    path = written(tmp_path / "a.xyz", "# none", [X, Y, Z], " ")
    rows = path.read_text().splitlines()
    comment = f"{mark} Gr\u00f6\u00dfe in m, 1 2 3"
    path.write_bytes("\n".join([comment, *rows[1:80], comment, *rows[80:], comment]).encode("cp1252"))
    np.testing.assert_allclose(read_cloud(path).points, POINTS, atol=1e-6)


def test_vertices_of_an_obj_are_a_cloud(tmp_path: Path) -> None:
    lines = [f"v {x} {y} {z} 0.5 0.5 0.5" for x, y, z in POINTS]
    (tmp_path / "a.obj").write_text("\n".join(["# MeshLab", "vn 0 0 1", *lines, "f 1 2 3"]))
    np.testing.assert_allclose(read_cloud(tmp_path / "a.obj").points, POINTS, atol=1e-9)


@pytest.mark.parametrize("kind", ["ply", "pcd", "ptx"])
def test_decimal_commas_in_the_text_of_other_formats(tmp_path: Path, kind: str) -> None:
    table = "".join(f"{x:.6f} {y:.6f} {z:.6f}\n" for x, y, z in POINTS)
    heads = {
        "ply": "ply\nformat ascii 1.0\nelement vertex 150\nproperty float x\nproperty float y\nproperty float z\nend_header\n",
        "pcd": "VERSION 0.7\nFIELDS x y z\nSIZE 4 4 4\nTYPE F F F\nWIDTH 150\nHEIGHT 1\nPOINTS 150\nDATA ascii\n",
        "ptx": "10\n15\n0 0 0,5\n1 0 0\n0 1 0\n0 0 1\n1 0 0 0\n0 1 0 0\n0 0 1 0\n0 0 0 1\n",
    }
    (tmp_path / "a").write_text(heads[kind] + table.replace(".", ","))
    np.testing.assert_allclose(read_cloud(tmp_path / "a").points, POINTS, atol=1e-6)
