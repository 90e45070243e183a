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
        (table("x [mm],y [mm],z [mm],rx [deg],ry [deg],rz [deg]", P * 1e3, np.degrees(V)), r"column rx is in deg.*roll \[deg\]"),
        (table("x [mm],y,z,rx,ry,rz", P * 1e3, V), "column x is in mm; metres and radians are needed, or mm of x, y and z alike"),
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
