"""What names of columns mean, and how the rows of other programs' text tables are parted."""

import pytest

from weldsim.columns import by_role, decode, find_table, is_comment, read_name


@pytest.mark.parametrize(
    ("cell", "role", "unit"),
    [
        ("x", "x", None),
        ("Y[m]", "y", "m"),
        ("Z (mm)", "z", "mm"),
        ("x_mm", "x", "mm"),
        ("x in cm", "x", "cm"),
        ("x/mm", "x", "mm"),
        ("X {µm}", "x", "um"),
        ("x_in", "x", "in"),
        ("pos_y", "y", None),
        ("position.z", "z", None),
        ("field.pose.position.x", "x", None),
        ("coordX", "x", None),
        ("Y-Koordinate", "y", None),
        ('"Points:2"', "z", None),
        ("Points_0", "x", None),
        ("Normals:1", "ny", None),
        ("NormalX", "nx", None),
        ("normal_z", "nz", None),
        ("Nx", "nx", None),
        ("RGB:0", "red", None),
        ("Gf", "green", None),
        ("diffuse_blue", "blue", None),
        ("Easting", "x", None),
        ("Height [m]", "z", "m"),
        ("groove width [mm]", "width", "mm"),
        ("Intensity", "other", None),
        ("ID", "other", None),
        ("Depth", "other", None),  # points away from z as often as along it
        ("orientation.x", None, None),
        ("x_left", None, None),
        ("u", None, None),
        ("velocity x", None, None),
    ],
)
def test_a_name_says_what_its_column_holds(cell: str, role: str | None, unit: str | None) -> None:
    name = read_name(cell)
    assert (name.role, name.unit) == (role, unit)


@pytest.mark.parametrize(
    ("row", "delimiter", "comma", "cells"),
    [
        ("0.1 0.2 0.3", None, False, ["0.1", "0.2", "0.3"]),
        ("0.1, 0.2, 0.3", ",", False, ["0.1", "0.2", "0.3"]),
        ("0,1;0,2;0,3", ";", True, ["0.1", "0.2", "0.3"]),
        ("0,1 0,2 0,3", None, True, ["0.1", "0.2", "0.3"]),
        ("0,1\t0,2\t0,3", "\t", True, ["0.1", "0.2", "0.3"]),
        ("-115,0;0,0;20,0", ";", True, ["-115.0", "0.0", "20.0"]),
        ('"0,1","0,2","0,3"', ",", False, ["0.1", "0.2", "0.3"]),
        ("0.1;0.2;0.3;", ";", False, ["0.1", "0.2", "0.3"]),
        ("1,2,3", ",", False, ["1", "2", "3"]),
        ("P7 0.1 0.2 0.3", None, False, ["P7", "0.1", "0.2", "0.3"]),
        ("1e-3 -2E+1 .5 # here", None, False, ["1e-3", "-2E+1", ".5"]),
    ],
)
def test_cells_of_a_row(row: str, delimiter: str | None, comma: bool, cells: list[str]) -> None:
    table = find_table([row, row])
    assert table is not None
    assert (table.delimiter, table.decimal_comma, table.cells(row)) == (delimiter, comma, cells)


def test_whole_numbers_first_do_not_hide_decimal_commas() -> None:
    table = find_table(["0 0 20", "0,5 0 20,0"])
    assert table is not None
    assert table.cells("0,5 0 20,0") == ["0.5", "0", "20.0"]


@pytest.mark.parametrize(
    ("above", "row", "roles"),
    [
        (["//X Y Z R G B"], "0.1 0.2 0.3 1 2 3", ["x", "y", "z", "red", "green", "blue"]),
        (["X [mm] Y [mm] Z [mm]"], "0.1 0.2 0.3", ["x", "y", "z"]),
        (["z,y,x", "mm,mm,mm"], "0.1,0.2,0.3", ["z", "y", "x"]),
        (["x y z"], "1 0.1 0.2 0.3", ["other", "x", "y", "z"]),  # R writes no name above the numbers of the rows
        (["x;y;z"], "0.1;0.2;0.3;7", ["x", "y", "z", "other"]),
        ([",y,x,z"], "0,0.1,0.2,0.3", ["other", "y", "x", "z"]),
        (["% a scanner's", "! x y z", "# 3 points"], "0.1 0.2 0.3", ["x", "y", "z"]),
    ],
)
def test_names_are_found_above_the_rows(above: list[str], row: str, roles: list[str]) -> None:
    rows = [row, row.replace("1", "2", 1), row.replace("1", "3", 1)]
    table = find_table([*above, *rows])
    assert table is not None
    assert table.names is not None
    assert [name.role for name in table.names] == roles


@pytest.mark.parametrize("title", ["", "# made by me", "// shown by a scanner", "Scan of a part", "200", "REM old", "-- sql"])
def test_what_names_nothing_is_a_title(title: str) -> None:
    table = find_table([title, "0.1 0.2 0.3"])
    assert table is not None
    assert table.names is None


def test_roles_that_are_missing_or_twice_are_named_with_all_columns() -> None:
    assert by_role([read_name(cell) for cell in ("ID", "y", "z", "x")]) == {"y": 1, "z": 2, "x": 3}
    with pytest.raises(ValueError, match="none of its columns is z: Depth, Y, X"):
        by_role([read_name(cell) for cell in ("Depth", "Y", "X")])
    with pytest.raises(ValueError, match="two of its columns may be x"):
        by_role([read_name(cell) for cell in ("pos_x", "coord_x", "y", "z")])
    assert by_role([read_name(cell) for cell in ("x", "y", "z", "pos_x")])["x"] == 0


@pytest.mark.parametrize("encoding", ["utf-8", "utf-8-sig", "latin-1", "cp1252", "utf-16"])
def test_text_of_every_encoding(encoding: str) -> None:
    assert decode("# Gr\u00f6\u00dfe\r\n1 2 3\r4".encode(encoding)) == "# Gr\u00f6\u00dfe\n1 2 3\n4"


def test_comments_of_any_language() -> None:
    for line in ("# a", "  // a", "% a", "! a", "; a", "* a", "-- a", "REM a", '"# a"', "/* a */"):
        assert is_comment(line), line
    for line in ("-5 1 2", "0.1", ";0.1;0.2", "x", "--"[:1] + "1"):
        assert not is_comment(line), line
