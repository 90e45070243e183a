"""Seam files as other programs write them: names, units, decimal commas, comments, encodings."""

from pathlib import Path

import numpy as np
import pytest

from weldsim.errors import SceneError
from weldsim.scene.workpieces.seam_file import SeamFile, read_seam_file

POINTS = np.array([[-115.0, 0.0, 20.5], [0.0, 0.5, 20.0], [115.0, 1.25, 19.5]])
WIDTH = np.array([14.0, 14.5, 15.0])
NORMALS = np.array([[0.0, 0.0, 1.0], [0.0, 0.6, 0.8], [0.1, 0.0, 0.9]])


def read(path: Path, text: str, encoding: str = "utf-8") -> SeamFile:
    path.write_bytes(text.encode(encoding))
    return read_seam_file(path, 1e-3)


def rows(table: np.ndarray, separator: str, decimal: str = ".") -> str:
    return "\n".join(separator.join(f"{value:g}".replace(".", decimal) for value in row) for row in table) + "\n"


@pytest.mark.parametrize("separator", [";", "; ", " ", "\t"])
@pytest.mark.parametrize("named", [True, False])
@pytest.mark.parametrize("more", [0, 1, 3, 4])
def test_decimal_commas_are_read_with_and_without_a_header(tmp_path: Path, separator: str, named: bool, more: int) -> None:
    names = ["x", "y", "z", *["nx", "ny", "nz"] * (more > 1), *["width"] * (more in (1, 4))]
    columns = [POINTS, *[NORMALS] * (more > 1), *[WIDTH[:, None]] * (more in (1, 4))]
    head = separator.join(names) + "\n" if named else ""
    seam = read(tmp_path / "s.csv", head + rows(np.hstack(columns), separator, ","))
    np.testing.assert_allclose(seam.points, POINTS * 1e-3, atol=1e-12)
    assert (seam.normals is not None) == (more > 1)
    assert (seam.width is not None) == (more in (1, 4))
    if seam.normals is not None:
        np.testing.assert_allclose(seam.normals, NORMALS)


def test_whole_numbers_with_a_decimal_comma_are_not_two_columns(tmp_path: Path) -> None:
    seam = read(tmp_path / "s.csv", "-115,0;0,0;20,0\n115,0;0,0;20,0\n")
    np.testing.assert_allclose(seam.points, [[-0.115, 0, 0.02], [0.115, 0, 0.02]])
    assert seam.normals is None


@pytest.mark.parametrize("head", ["", "x,y,z\n"])
def test_decimal_commas_between_commas_are_refused_and_semicolons_help(tmp_path: Path, head: str) -> None:
    with pytest.raises(SceneError, match="with decimal commas put ; between the columns"):
        read(tmp_path / "s.csv", head + "-115,0,0,0,20,0\n115,0,0,0,20,0\n")
    assert len(read(tmp_path / "s.csv", head.replace(",", ";") + "-115,0;0,0;20,0\n115,0;0,0;20,0\n").points) == 2
    seam = read(tmp_path / "s.csv", "-115,0,20,0,0,1\n115,0,20,0,0,1\n")  # points and unit normals stay what they are
    np.testing.assert_array_equal(seam.normals, [[0, 0, 1], [0, 0, 1]])


@pytest.mark.parametrize(
    ("head", "columns"),
    [
        ("z (mm),y (mm),x (mm)", [2, 1, 0]),
        ("ID;x;y;z", [None, 0, 1, 2]),
        ("pos_y,pos_x,pos_z", [1, 0, 2]),
        ('"Points:0","Points:1","Points:2"', [0, 1, 2]),
        ("# X Y Z", [0, 1, 2]),
        ("Width [mm]\tX [mm]\tY [mm]\tZ [mm]", ["w", 0, 1, 2]),
    ],
)
def test_names_are_believed(tmp_path: Path, head: str, columns: list) -> None:
    separator = next((mark for mark in (";", "\t", ",") if mark in head), " ")
    parts = {None: np.arange(3.0), "w": WIDTH, 0: POINTS[:, 0], 1: POINTS[:, 1], 2: POINTS[:, 2]}
    seam = read(tmp_path / "s.csv", head + "\n" + rows(np.stack([parts[at] for at in columns], axis=1), separator))
    np.testing.assert_allclose(seam.points, POINTS * 1e-3, atol=1e-12)
    assert (seam.width is not None) == ("w" in columns)


def test_a_unit_in_a_name_outranks_the_meshs(tmp_path: Path) -> None:
    seam = read(tmp_path / "s.csv", "x [m],y [cm],z,width [m]\n0,1,20,0.014\n0.1,1,20,0.014\n")
    np.testing.assert_allclose(seam.points, [[0, 0.01, 0.02], [0.1, 0.01, 0.02]])
    assert seam.width is not None
    np.testing.assert_allclose(seam.width, [0.014, 0.014])
    with pytest.raises(SceneError, match=r"column 'x \[deg\]' is in deg"):
        read(tmp_path / "s.csv", "x [deg],y,z\n0,1,20\n1,1,20\n")


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16"])
@pytest.mark.parametrize("mark", ["#", "//", "%", "!", ";", "--"])
def test_comments_never_matter(tmp_path: Path, encoding: str, mark: str) -> None:
    comment = f"{mark} Gr\u00f6\u00dfe der Fuge, 1 2 3\n"
    seam = read(tmp_path / "s.csv", comment + "x,y,z\n" + comment + "0,0,20 # here\n" + comment + "5,0,20\n" + comment, encoding)
    np.testing.assert_allclose(seam.points, [[0, 0, 0.02], [0.005, 0, 0.02]])


def test_names_that_are_not_understood_are_refused_with_all_of_them(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"columns 'x, y, z, breadth'; wanted are x, y, z"):
        read(tmp_path / "s.csv", "x,y,z,breadth\n0,0,20,14\n5,0,20,14\n")
    assert read(tmp_path / "s.csv", "x,y,z,width\n0,0,20,14\n5,0,20,14\n").width is not None


@pytest.mark.parametrize("first", [0, 1])
def test_a_column_that_counts_the_rows_is_not_taken_for_x_and_naming_it_helps(tmp_path: Path, first: int) -> None:
    rows = [f"{i + first},{-115 + 5 * i},0,20" for i in range(9)]
    (tmp_path / "s.csv").write_text("\n".join(rows))
    with pytest.raises(SceneError, match="counts the rows; name the columns in a first line: id,x,y,z"):
        read_seam_file(tmp_path / "s.csv", 1e-3)
    (tmp_path / "s.csv").write_text("\n".join(["id,x,y,z", *rows]))
    np.testing.assert_allclose(read_seam_file(tmp_path / "s.csv", 1e-3).points[0], [-0.115, 0, 0.02])


def test_rotation_vectors_after_the_points_are_not_taken_for_normals_and_the_advice_works(tmp_path: Path) -> None:
    poses = np.hstack([POINTS, np.tile([0.0, 3.1416, 0.0], (3, 1))])
    with pytest.raises(SceneError, match=r"no unit normals \(length 3.14\), rotation vectors perhaps: leave them out, or name"):
        read(tmp_path / "s.csv", rows(poses, ","))
    np.testing.assert_allclose(read(tmp_path / "s.csv", rows(poses[:, :3], ",")).points, POINTS * 1e-3)
    long = np.hstack([POINTS, 20 * NORMALS])
    np.testing.assert_allclose(read(tmp_path / "s.csv", "x,y,z,nx,ny,nz\n" + rows(long, ",")).normals, 20 * NORMALS)


def test_a_unit_in_a_comment_brackets_and_marks_between_thousands(tmp_path: Path) -> None:
    for text in (
        "# units: m\n" + "\n".join(",".join(f"{value:.6f}" for value in row) for row in POINTS * 1e-3),
        "\n".join(str(row.tolist()) for row in POINTS),
        "\n".join(str(tuple(map(float, row))) + "," for row in POINTS),
        "x [um];y [um];z [um]\n" + "\n".join(["-115.000,0;0,0;20.500,0", "0,0;500,0;20.000,0", "115.000,0;1.250,0;19.500,0"]),
    ):
        np.testing.assert_allclose(read(tmp_path / "s.csv", text).points, POINTS * 1e-3, atol=1e-12)


def test_a_column_that_tells_lines_apart_is_named_and_without_it_the_file_is_read(tmp_path: Path) -> None:
    with pytest.raises(SceneError, match=r"column 'Seam' tells lines apart; a part has one seam"):
        read(tmp_path / "a.csv", "x,y,z,Seam\n0,0,0,1\n1,0,0,1\n0,1,0,2\n1,1,0,2\n")
    assert len(read(tmp_path / "a.csv", "x,y,z\n0,0,0\n1,0,0\n").points) == 2


def test_names_of_points_and_directions_as_measuring_machines_export_them(tmp_path: Path) -> None:
    body = [["Point 1", "Point 2", "Point 3"], *POINTS.T, *NORMALS.T]
    lines = [";".join(f"{value}".replace(".", ",") for value in row) for row in zip(*body, strict=True)]
    for head in ("Name;X;Y;Z;Nx;Ny;Nz", "Element;X;Y;Z;I;J;K"):
        seam = read(tmp_path / "s.csv", "\n".join([head, *lines, ""]))
        np.testing.assert_allclose(seam.points, POINTS * 1e-3, atol=1e-12)
        np.testing.assert_allclose(seam.normals, NORMALS)


@pytest.mark.parametrize("column", ["Name", "id"])
def test_names_that_tell_lines_apart_are_refused_and_one_line_of_them_is_read(tmp_path: Path, column: str) -> None:
    one = [f"1,{x},{y},{z}" for x, y, z in POINTS]
    other = [f"2,{x},{y + 60},{z}" for x, y, z in POINTS]
    with pytest.raises(SceneError, match=f"column '{column}' has '1' more than once: does it tell lines apart"):
        read(tmp_path / "s.csv", "\n".join([f"{column},x,y,z", *one, *other, ""]))
    np.testing.assert_allclose(read(tmp_path / "s.csv", "\n".join([f"{column},x,y,z", *one, ""])).points, POINTS * 1e-3)


@pytest.mark.parametrize("title", ["Units: m", "# all in metres", "# coordinates in m", "Unit;m"])
def test_a_unit_in_a_title_outranks_the_scenes(tmp_path: Path, title: str) -> None:
    text = f"{title}\nx,y,z\n" + rows(POINTS * 1e-3, ",")
    np.testing.assert_allclose(read(tmp_path / "s.csv", text).points, POINTS * 1e-3, atol=1e-12)
