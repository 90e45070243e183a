"""The pose of a camera as calibrations, ROS and others write it: the same pose from each, or one line of refusal."""

import json
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from weldsim.cloud.pose_files import read_pose
from weldsim.errors import CloudFileError
from weldsim.frames import Transform, matrix_from_rotation_vector

RPY = [2.9, 0.2, -0.5]
ROLL, PITCH, YAW = (matrix_from_rotation_vector(angle * axis) for angle, axis in zip(RPY, np.eye(3), strict=True))
X = Transform("BC", YAW @ PITCH @ ROLL, np.array([0.1, -0.45, 0.42]))
P, M, V = X.p.tolist(), X.matrix.tolist(), X.rotation_vector.tolist()
W, QX, QY, QZ = X.quaternion.tolist()
XYZ, XYZW = dict(zip("xyz", P, strict=True)), {"x": QX, "y": QY, "z": QZ, "w": W}
MM = [[*row[:3], row[3] * (1e3 if i < 3 else 1)] for i, row in enumerate(M)]
ROS = "header:\n  seq: 3\n  frame_id: base\npose:\n  position:\n" + "".join(f"    {k}: {v}\n" for k, v in XYZ.items())
ROS += "  orientation:\n" + "".join(f"    {k}: {v}\n" for k, v in XYZW.items())
HAND_EYE = "parameters:\n  robot_base_frame: base\ntransformation: " + str(
    {**{f"q{k}": v for k, v in XYZW.items()}, **XYZ}
).replace("'", "")
OPENCV = "%YAML:1.0\n---\nT_cam2base: !!opencv-matrix\n   rows: 4\n   cols: 4\n   dt: d\n   data: " + str(np.ravel(M).tolist())
ZIVID = "__version__:\n  data: 12\nFloatMatrix:\n  Data:\n    [\n" + ",\n".join(f"      {row}" for row in MM) + "\n    ]\n"
TF_ECHO = f"At time 0.0\n- Translation: {P}\n- Rotation: in Quaternion {[QX, QY, QZ, W]}\n            in RPY (radian) {RPY}\n"


@pytest.fixture
def put(tmp_path: Path) -> Callable[[Any], Path]:
    def put(content: Any) -> Path:
        path = tmp_path / "pose"
        path.write_text(content if isinstance(content, str) else json.dumps(content), encoding="utf-8")
        return path

    return put


@pytest.mark.parametrize(
    "content",
    [
        {"position": P, "quaternion_xyzw": [QX, QY, QZ, W]},
        {"position": P, "orientation_wxyz": [W, QX, QY, QZ]},
        {"position": XYZ, "orientation": XYZW},
        {"transform": {"translation": XYZ, "rotation": XYZW}},
        {"translation": P, "qx": QX, "qy": QY, "qz": QZ, "qw": W},
        {"position": P, "rotation_vector": V},
        {"rvec": [[v] for v in V], "tvec": [[v] for v in P]},
        {"position": P, "rotation_vector_deg": np.degrees(V).tolist()},
        {"R": X.R.tolist(), "t": P},
        {"rotation": X.R.tolist(), "translation": P},
        {"xyz": P, "rpy": RPY},
        {"xyz": P, "rpy_deg": np.degrees(RPY).tolist()},
        {**XYZ, "roll": RPY[0], "pitch": RPY[1], "yaw": RPY[2]},
        {"position_mm": (X.p * 1e3).tolist(), "quaternion_wxyz": [W, QX, QY, QZ]},
        {"unit": "mm", "position": (X.p * 1e3).tolist(), "quaternion_wxyz": [W, QX, QY, QZ]},
        {"units": "mm", "matrix": MM},
        {"camera_to_base": M},
        {"T_base_camera": M},
        {"matrix": X.matrix.T.tolist()},
        {"matrix": M, "position": P},
        {"transformation_matrix": M[:3]},
        "\n".join(" ".join(map(repr, row)) for row in M),
        str(np.array(M)).replace("\n ", "\n"),
        "\n".join(", ".join(map(repr, row)) for row in M[:3]),
        f"p{[*P, *V]}",
        ROS,
        HAND_EYE,
        OPENCV,
        ZIVID,
        TF_ECHO,
    ],
)
def test_the_same_pose_however_it_is_written(put, content: Any) -> None:
    np.testing.assert_allclose(read_pose(put(content)).matrix, M, atol=1e-5)


@pytest.mark.parametrize(
    ("content", "words"),
    [
        ({"position": P, "quaternion": [QX, QY, QZ, W]}, "name it quaternion_wxyz or quaternion_xyzw"),
        ({"position": P, "orientation": [QX, QY, QZ, W]}, "first number or its last"),
        ({"position": P, "euler": RPY}, "of which order"),
        ({"position": P, "rotation": RPY}, "of which order"),
        ({"position": P, "rpy": [170, 5, -3]}, "looks like degrees; name it rpy_deg"),
        ({"base_to_camera": M}, "base_to_camera: may lead from the base to the camera"),
        ({"extrinsic": M}, "may lead from the base"),
        ({"T_camera_base": M}, "may lead from the base"),
        ({"cam2gripper": M}, "pose in the hand"),
        ({"eye_on_hand": True, **XYZ, **{f"q{k}": v for k, v in XYZW.items()}}, "on the hand"),
        ({"child_frame_id": "camera_link", "position": XYZ, "orientation": XYZW}, "camera's optical frame"),
        ({"a": M, "b": M}, "several matrices"),
        ({"matrix": M, "position": [0, 0, 0]}, "twice"),
        ({"position": P, "rotation_vector": V, "quaternion_wxyz": [W, QX, QY, QZ]}, "rotation twice"),
        ({"unit": "furlong", "position": P, "rotation_vector": V}, "unit 'furlong'"),
        ({"matrix": np.array(M)[[1, 0, 2, 3]].tolist()}, "left-handed"),
        (f"{P[0]} {P[1]} {P[2]} {QX} {QY} {QZ} {W}", "7 numbers"),
        ([*P, *V], "6 numbers"),
        ({"T_base_camera_link": M}, "T_base_camera_link: the x axis of that frame looks ahead"),
        ({"base_to_camera_link": M}, "looks ahead"),
        ({"parent": "base", "child": "d435_camera_link", "T": M}, "pose of d435_camera_link"),
        ({"from": "camera_color_frame", "to": "base", "matrix": M}, "pose of camera_color_frame"),
        ({"T_base_link_camera_optical": M}, "half a turn about z from a UR controller's base"),
        ({"parent_frame": "base_link", "matrix": M}, "half a turn about z"),
        ({"robot_base_frame": "base_link", "matrix": M}, "half a turn about z"),
        (
            {"header": {"frame_id": "camera_depth_optical_frame"}, "child_frame_id": "base", "matrix": M},
            "from the base to the camera",
        ),
        ({"from": "base", "to": "camera_optical_frame", "matrix": M}, "from the base to the camera"),
        ({"parent": "tool0", "child": "camera_optical_frame", "matrix": M}, "parent tool0: it is a pose of or in the hand"),
        ({"frame_id": "base", "child_frame_id": "tool0", "matrix": M}, "child_frame_id tool0: it is a pose of or in the hand"),
        ({"R_cam2gripper": X.R.tolist(), "t_cam2gripper": P}, "R_cam2gripper: is the camera's pose in the hand"),
        ({"R_base2cam": X.R.tolist(), "t_base2cam": P}, "R_base2cam: may lead from the base"),
        ("<opencv_storage></opencv_storage>", "is XML; give the same figures as JSON or YAML"),
    ],
)
def test_what_leaves_the_pose_open_is_refused_in_one_line(put, content: Any, words: str) -> None:
    path = put(content)
    with pytest.raises(CloudFileError, match=f"^{path}: .*{words}") as caught:
        read_pose(path)
    assert "\n" not in str(caught.value)


def test_the_names_that_are_asked_for_help(put) -> None:
    for key in ("quaternion_wxyz", "quaternion_xyzw"):
        quaternion = [W, QX, QY, QZ] if key.endswith("wxyz") else [QX, QY, QZ, W]
        np.testing.assert_allclose(read_pose(put({"position": P, key: quaternion})).matrix, M, atol=1e-9)
    degrees = {"position": P, "rpy_deg": np.degrees(RPY).tolist()}
    np.testing.assert_allclose(read_pose(put(degrees)).matrix, M, atol=1e-9)
    np.testing.assert_allclose(read_pose(put({"parent_frame": "base", "matrix": M})).matrix, M, atol=1e-9)
    np.testing.assert_allclose(read_pose(put({"matrix": np.linalg.inv(X.inverse().matrix).tolist()})).matrix, M, atol=1e-9)


def test_more_names_of_the_same_pose(put) -> None:
    column = [[value] for value in P]
    rows = "\n".join(";".join(f"{value:.9f}".replace(".", ",") for value in row) for row in M)
    for content in (
        {"R_cam2base": X.R.tolist(), "t_cam2base": column},
        {"T_cam2base": M},
        {"T": np.array(M).T.tolist()},  # MATLAB's, rows from the right
        {"parent": "base", "child": "camera_depth_optical_frame", "T": M},
        {"source": "camera_optical_frame", "target": "base", "matrix": M},
        {"matrix": MM, "translation_unit": "mm"},
        rows,
        rows.replace(";", " "),
        rows.replace(";", "\t"),
    ):
        np.testing.assert_allclose(read_pose(put(content)).matrix, M, atol=1e-6)
