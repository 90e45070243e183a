"""Poses in tables as other programs write them: rotations of other kinds, units, names of messages."""

import numpy as np
import pytest

from weldsim.dryrun.pose_table import read_poses
from weldsim.errors import InputError
from weldsim.frames import Transform, matrix_from_rotation_vector

N = 9
P = np.linspace([-0.04, -0.45, 0.1], [0.04, -0.44, 0.12], N)
RPY = np.linspace([3.1, 0.05, -0.4], [2.9, -0.1, 0.3], N)
ROLL, PITCH, YAW = (matrix_from_rotation_vector(RPY[:, i : i + 1] * np.eye(3)[i]) for i in range(3))
X = Transform("BT", YAW @ PITCH @ ROLL, P)
Q = X.quaternion[:, [1, 2, 3, 0]]
V = X.rotation_vector
POSES = np.hstack([P, V])
TIME = np.arange(N)[:, None] * 0.1


def table(header: str, *columns: np.ndarray, separator: str = ",") -> str:
    rows = [separator.join(f"{value:.10f}" for value in row) for row in np.hstack(columns)]
    return "\n".join([header, *rows, ""])


@pytest.mark.parametrize(
    "text",
    [
        table("x,y,z,qx,qy,qz,qw", P, Q),
        table("x,y,z,qw,qx,qy,qz", P, Q[:, [3, 0, 1, 2]]),
        table("x,y,z,qx,qy,qz,qw", P, -Q),
        table("position_x,position_y,position_z,rotation_x,rotation_y,rotation_z,rotation_w", P, Q),
        table("x y z rx ry rz rw", P, Q, separator=" "),
        table(
            "%time,"
            + ",".join(f"field.pose.{part}" for part in ("position.x", "position.y", "position.z"))
            + ","
            + ",".join(f"field.pose.orientation.{axis}" for axis in "xyzw"),
            TIME,
            P,
            Q,
        ),
        table("x,y,z,roll,pitch,yaw", P, RPY),
        table("x [mm],y [mm],z [mm],roll [deg],pitch [deg],yaw [deg]", P * 1e3, np.degrees(RPY)),
        table("x_mm,y_mm,z_mm,roll_deg,pitch_deg,yaw_deg", P * 1e3, np.degrees(RPY)),
        table("x [mm];y [mm];z [mm];rx [rad];ry [rad];rz [rad]", P * 1e3, V, separator=";").replace(".", ","),
        table("x,y,z,rx,ry,rz\nmm,mm,mm,rad,rad,rad", P * 1e3, V),
        table("x [mm],y [mm],z [mm],rx [deg],ry [deg],rz [deg]", P * 1e3, np.degrees(V)),
        table("X(mm),Y(mm),Z(mm),RX(deg),RY(deg),RZ(deg)", P * 1e3, np.degrees(V)),
        table("X (mm);Y (mm);Z (mm);RX (deg);RY (deg);RZ (deg)", P * 1e3, np.degrees(V), separator=";"),
        table("x[mm]\ty[mm]\tz[mm]\trx[deg]\try[deg]\trz[deg]", P * 1e3, np.degrees(V), separator="\t"),
        table("X(mm) Y(mm) Z(mm) RX(deg) RY(deg) RZ(deg)", P * 1e3, np.degrees(V), separator=" "),
        table("x_mm,y_mm,z_mm,Rx_deg,Ry_deg,Rz_deg", P * 1e3, np.degrees(V)),
        table("X mm,Y mm,Z mm,RotX deg,RotY deg,RotZ deg", P * 1e3, np.degrees(V)),
        table("X/mm,Y/mm,Z/mm,RX/\u00b0,RY/\u00b0,RZ/\u00b0", P * 1e3, np.degrees(V)),
        table("x in mm,y in mm,z in mm,rx in degrees,ry in degrees,rz in degrees", P * 1e3, np.degrees(V)),
        table("x (cm),y (cm),z (cm),rx (Degrees),ry (Degrees),rz (Degrees)", P * 1e2, np.degrees(V)),
        table("x [m],y [m],z [m],rx [rad],ry [rad],rz [rad]", P, V),
        table("x_m,y_m,z_m,rx_rad,ry_rad,rz_rad", P, V),
        table("x [um],y [um],z [um],rx,ry,rz", P * 1e6, V),
        table("x,y,z,rx,ry,rz\nmm,mm,mm,deg,deg,deg", P * 1e3, np.degrees(V)),
        table("x,y,z,qx [-],qy [-],qz [-],qw [-]", P, Q),
        table("X [in],Y [in],Z [in],RX,RY,RZ", P / 0.0254, V),
        "\n".join(f"Waypoint_{i} = p[{', '.join(map(repr, row))}]" for i, row in enumerate(POSES.tolist())),
        "\n".join(f"global Point_{i}_p=p[{', '.join(map(repr, row))}]" for i, row in enumerate(POSES.tolist())),
        "[" + ",\n ".join(f"[{', '.join(map(repr, row))}]" for row in POSES.tolist()) + "]",
    ],
)
def test_the_same_poses_however_they_are_written(text: str) -> None:
    read = read_poses(text, "a.csv").poses
    np.testing.assert_allclose(read[:, :3], P, atol=1e-8)
    np.testing.assert_allclose(matrix_from_rotation_vector(read[:, 3:]), X.R, atol=1e-7)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        (table("x,y,z,qx,qy,qz,qw", P, 2 * Q), "line [0-9]+: a quaternion of length 2, not 1"),
        (table("x,y,z,roll,pitch,yaw", P, np.degrees(RPY)), r"looks like degrees; name them roll \[deg\]"),
        (table("x [mm],y,z,rx,ry,rz", P * 1e3, V), r"line 1: x \[mm\], y, z are not all in one unit; give each of them the same"),
        (table("x,y,z,rx[deg],ry[rad],rz[deg]", P, V), r"rx\[deg\], ry\[rad\], rz\[deg\] are not all in one unit"),
        (table("x,y,z,rx(deg),ry,rz", P, V), r"rx\(deg\), ry, rz are not all in one unit"),
        (table("x,y,z,rx(grad),ry(grad),rz(grad)", P, V), r"column rx\(grad\) is in grad; rad or deg is needed"),
        (table("x(furlong),y(furlong),z(furlong),rx,ry,rz", P, V), r"x\(furlong\) is in furlong; m, mm, cm, um or in is needed"),
        (table("x [deg],y [deg],z [deg],rx,ry,rz", P, V), r"x \[deg\] is in deg; m, mm, cm, um or in is needed"),
        (table("x,y,z,rx [mm],ry [mm],rz [mm]", P, V), r"rx \[mm\] is in mm; rad or deg is needed"),
        (table("x,y,z,qx [deg],qy [deg],qz [deg],qw [deg]", P, Q), r"qx \[deg\] is in deg; no unit is needed"),
        (table("x [m],y [m],z [m],rx,ry,rz", P * 1e3, V), r"looks like millimetres.*name the columns x \[mm\]"),
        (table("x,y,z,rx [rad],ry [rad],rz [rad]", P, np.degrees(V)), r"looks like degrees.*rx \[deg\], ry \[deg\], rz \[deg\]"),
        (table("x,y,z,rx [deg],ry [deg],rz [deg]", P, 1.2 * np.degrees(V)), r"vector of \d+ deg \(limit 180 deg\); if they"),
        (table("x,y,z", P), "column rx is missing among x, y, z"),
        (table("x,y,z,nx,ny,nz", P, V), "column rx is missing among x, y, z, nx, ny, nz"),
        (table("X,Y,Z,W,P,R", P, V), "column rx is missing among X, Y, Z, W, P, R"),
        (table("# seven", P, Q), "name them on the first line: x y z qx qy qz qw"),
    ],
)
def test_what_leaves_a_pose_open_is_refused_in_one_line(text: str, words: str) -> None:
    with pytest.raises(InputError, match=f"^a.csv: .*{words}") as caught:
        read_poses(text, "a.csv")
    assert "\n" not in str(caught.value)


def test_a_recorded_trajectory_names_its_columns_in_a_comment_and_its_frames_between_them() -> None:
    rows = [f"{0.1 * i:.1f} base 0.{i} -0.45 0.1 0.0 1.0 0.0 0.0" for i in range(1, 4)]
    table = read_poses("\n".join(["# timestamp frame_id tx ty tz qx qy qz qw", *rows]), "path.csv")
    np.testing.assert_allclose(table.poses[:, 0], [0.1, 0.2, 0.3])
    np.testing.assert_allclose(np.abs(table.poses[:, 4]), np.pi)


def test_marks_between_thousands_in_a_table_of_poses() -> None:
    rows = ["-100,5;-1.050,25;100,0;0,0;3,14;0,0", "100,5;-1.050,25;100,0;0,0;3,14;0,0"]
    table = read_poses("\n".join(["x [mm];y [mm];z [mm];rx;ry;rz", *rows]), "path.csv")
    np.testing.assert_allclose(table.poses[0], [-0.1005, -1.05025, 0.1, 0.0, 3.14, 0.0])


def test_degrees_of_a_rotation_vector_are_told() -> None:
    (note,) = read_poses(table("x,y,z,RX (deg),RY (deg),RZ (deg)", P, np.degrees(V)), "a.csv").notes
    assert note.startswith("RX (deg), RY (deg), RZ (deg) are read as a rotation vector in degrees; if they are roll, pitch and yaw")
    renamed = read_poses(table("x,y,z,roll [deg],pitch [deg],yaw [deg]", P, np.degrees(RPY)), "a.csv")
    assert renamed.notes == ()
    np.testing.assert_allclose(matrix_from_rotation_vector(renamed.poses[:, 3:]), X.R, atol=1e-7)


def test_radians_that_are_called_degrees_are_read_as_the_header_says_and_told() -> None:
    found = read_poses(table("x,y,z,rx [deg],ry [deg],rz [deg]", P, V), "a.csv")
    np.testing.assert_allclose(found.poses[:, 3:], np.radians(V), atol=1e-9)
    assert "are all under 7 deg: if they are radians, name them so, [rad]" in found.notes[1]
    assert read_poses(table("x,y,z,rx [rad],ry [rad],rz [rad]", P, V), "a.csv").notes == ()


@pytest.mark.parametrize(("scale", "unit"), [(1e3, "mm"), (1e6, "um")])
@pytest.mark.parametrize(("turn", "angle"), [(1.0, "rad"), (180 / np.pi, "deg")])
def test_the_columns_named_as_an_error_asks_are_read(scale, unit, turn, angle) -> None:
    columns = np.round(P * scale), V * turn
    with pytest.raises(InputError, match="name the columns") as caught:
        read_poses(table("# poses", *columns), "a.csv")
    names = str(caught.value).split("name the columns ")[1].split(" in a first line")[0]
    assert names == f"x [{unit}], y [{unit}], z [{unit}], rx [{angle}], ry [{angle}], rz [{angle}]"
    read = read_poses(table(names, *columns), "a.csv").poses
    np.testing.assert_allclose(read[:, :3], P, atol=1e-3)
    np.testing.assert_allclose(matrix_from_rotation_vector(read[:, 3:]), X.R, atol=1e-7)


def test_a_unit_that_a_comment_gives_is_kept_in_the_advice_and_asked_about_where_it_cannot_be() -> None:
    columns = P * 1e3, np.degrees(V)
    with pytest.raises(InputError, match=r"name the columns x \[mm\], y \[mm\], z \[mm\], rx \[deg\]"):
        read_poses(table("# units: mm", *columns), "a.csv")
    named = table("# units: mm\nx [mm],y [mm],z [mm],rx [deg],ry [deg],rz [deg]", *columns)
    np.testing.assert_allclose(read_poses(named, "a.csv").poses[:, :3], P, atol=1e-8)
    with pytest.raises(InputError, match=r"m from the base \(limit 3 m\), read in mm as the file says; is that its unit\?$"):
        read_poses(table("x [mm],y [mm],z [mm],rx,ry,rz", P * 1e6, V), "a.csv")


def test_two_columns_that_may_be_x_are_refused_and_both_remedies_work() -> None:
    rotation = "rx,ry,rz"
    both = table(f"flange_x,flange_y,flange_z,tcp_x,tcp_y,tcp_z,{rotation}", P + 0.1, P, V)
    with pytest.raises(
        InputError, match="two of its columns may be x: flange_x and tcp_x; call those that are meant x y z rx ry rz"
    ):
        read_poses(both, "a.csv")
    for text in (
        table(f"flange_x,flange_y,flange_z,x [mm],y [mm],z [mm],{rotation}", P + 0.1, P * 1e3, V),
        table(f"x [mm],y [mm],z [mm],tcp_x,tcp_y,tcp_z,{rotation}", P * 1e3, P + 0.1, V),
        table(f"tcp_x,tcp_y,tcp_z,{rotation}", P, V),
    ):
        np.testing.assert_allclose(read_poses(text, "a.csv").poses[:, :3], P, atol=1e-6)


@pytest.mark.parametrize(
    ("given", "named", "turns", "words"),
    [
        ("q1,q2,q3,q4", "qw,qx,qy,qz", Q[:, [3, 0, 1, 2]], "is w its q1, as ABB's is, or its q4"),
        (
            "A [deg],B [deg],C [deg]",
            "yaw [deg],pitch [deg],roll [deg]",
            np.degrees(RPY[:, ::-1]),
            "A B C of KUKA are yaw pitch roll",
        ),
        ("W [deg],P [deg],R [deg]", "roll [deg],pitch [deg],yaw [deg]", np.degrees(RPY), "W P R of Fanuc are roll pitch yaw"),
    ],
)
def test_rotations_of_other_makers_are_told_what_to_be_called_and_it_works(
    given: str, named: str, turns: np.ndarray, words: str
) -> None:
    with pytest.raises(InputError, match=words):
        read_poses(table(f"X [mm],Y [mm],Z [mm],{given}", P * 1e3, turns), "a.csv")
    found = read_poses(table(f"X [mm],Y [mm],Z [mm],{named}", P * 1e3, turns), "a.csv").poses
    np.testing.assert_allclose(matrix_from_rotation_vector(found[:, 3:]), matrix_from_rotation_vector(V), atol=1e-6)


def test_a_quaternion_counted_from_0_begins_with_w() -> None:
    found = read_poses(table("x,y,z,q0,q1,q2,q3", P, Q[:, [3, 0, 1, 2]]), "a.csv").poses
    np.testing.assert_allclose(matrix_from_rotation_vector(found[:, 3:]), matrix_from_rotation_vector(V), atol=1e-6)


@pytest.mark.parametrize(("title", "scale"), [("Units: inch", 0.0254), ("Unit;mm", 1e-3), ("# all positions in mm", 1e-3)])
def test_a_unit_in_a_title_is_believed(title: str, scale: float) -> None:
    text = f"Path of today\n{title}\n" + table("X;Y;Z;RX;RY;RZ", P / scale, V, separator=";")
    np.testing.assert_allclose(read_poses(text, "a.csv").poses[:, :3], P, atol=1e-6)
