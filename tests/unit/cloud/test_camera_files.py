"""Lens coefficients by every name that drivers and tools give them: applied, or refused; never ignored."""

import json
from dataclasses import astuple
from pathlib import Path
from typing import Any

import cv2
import numpy as np
import pytest

from weldsim.cloud.camera_files import read_camera
from weldsim.cloud.deproject import deproject
from weldsim.cloud.files import read_depth_frame
from weldsim.cloud.key_values import read_table
from weldsim.cloud.raw import Unreadable
from weldsim.errors import CloudFileError
from weldsim.frames import Transform
from weldsim.records import CameraIntrinsics, DepthFrame
from weldsim.records.lens import distorted, undistorted

FOCAL = {"width": 640, "height": 480, "fx": 620.0, "fy": 619.0, "cx": 311.0, "cy": 227.0}
K = [[620.0, 0, 311.0], [0, 619.0, 227.0], [0, 0, 1]]
MATRIX = {"width": 640, "height": 480}
LENS = [0.05, -0.02, 0.001, -0.0007, 0.01]
NAMED = dict(zip(("k1", "k2", "p1", "p2", "k3"), LENS, strict=True))

UPPER = {name.upper(): value for name, value in NAMED.items()}
CAMERA = CameraIntrinsics.from_opencv(**FOCAL, distortion=tuple(LENS))  # type: ignore[arg-type]

APPLIED: dict[str, dict[str, Any]] = {
    "by name": FOCAL | NAMED,
    "by name in capitals": FOCAL | UPPER,
    **{
        key: FOCAL | {key: LENS}
        for key in (
            "D", "d", "dist", "dist_coeffs", "distCoeffs", "distortion", "distortion_coeffs", "distortion_coefficients", "coeffs",
            "Coeffs", "distortion_params", "kc", "coefs", "dist_coefs", "distCoef", "lens_distortion_coefficients",
        )
    },
    "radial and tangential": FOCAL | {"radial_distortion": [0.05, -0.02, 0.01], "tangential_distortion": [0.001, -0.0007]},
    "camera_info of ROS 1": MATRIX | {"K": np.ravel(K).tolist(), "D": LENS, "distortion_model": "plumb_bob", "R": [1], "P": [2]},
    "camera_info of ROS 2": MATRIX | {"k": np.ravel(K).tolist(), "d": LENS, "distortion_model": "plumb_bob", "roi": {"width": 0}},
    "calibration of OpenCV": {
        "image_width": 640,
        "image_height": 480,
        "camera_matrix": {"rows": 3, "cols": 3, "data": np.ravel(K).tolist()},
        "distortion_coefficients": {"rows": 1, "cols": 5, "data": LENS},
    },
    "Zivid": {"CameraMatrix": {"FX": 620.0, "FY": 619.0, "CX": 311.0, "CY": 227.0}, "Distortion": UPPER,
              "width": 640, "height": 480},
    "Open3D": MATRIX | {"intrinsic_matrix": np.ravel(np.transpose(K)).tolist(), "distortion": LENS},
    "k and p": FOCAL | {"k": [0.05, -0.02, 0.01], "p": [0.001, -0.0007]},
    "a lens of its own": MATRIX | {"K": K, "lens": {"model": "brown", "k": [0.05, -0.02, 0.01], "p": [0.001, -0.0007]}},
    "ORB-SLAM": {f"Camera.{key}": value for key, value in (FOCAL | NAMED).items()},
    "Kalibr": {"cam0": {"camera_model": "pinhole", "distortion_coeffs": LENS, "distortion_model": "radtan",
                        "intrinsics": [620.0, 619.0, 311.0, 227.0], "resolution": [640, 480]}},
    "pyrealsense2": FOCAL | {"model": "distortion.brown_conrady", "coeffs": LENS},
    "nested": {"depth": FOCAL | {"distortion": {"model": "brown_conrady", "coeffs": LENS}}},
    "device": FOCAL | {"model": "Intel RealSense D415", "coeffs": LENS},
}  # fmt: skip


@pytest.mark.parametrize("name", APPLIED)
def test_coefficients_are_applied_by_any_of_their_names(name: str, tmp_path: Path) -> None:
    (tmp_path / "k.json").write_text(json.dumps(APPLIED[name]))
    camera = read_camera(read_table(tmp_path / "k.json"))
    assert astuple(camera) == astuple(CAMERA)


LINES = {
    "rs-enumerate-devices": """ Intrinsic of "Depth" / 640x480 / {Z16}
  Width:      \t640
  Height:     \t480
  PPX:        \t311.0
  PPY:        \t227.0
  Fx:         \t620.0
  Fy:         \t619.0
  Distortion: \tBrown Conrady
  Coeffs:     \t0.05  \t-0.02  \t0.001  \t-0.0007  \t0.01
  FOV (deg):  \t54.6 x 42.3
""",
    "rostopic echo": """header:
  seq: 7
  frame_id: "camera_depth_optical_frame"
height: 480
width: 640
distortion_model: "plumb_bob"
D: [0.05, -0.02, 0.001, -0.0007, 0.01]
K: [620.0, 0.0, 311.0, 0.0, 619.0, 227.0, 0.0, 0.0, 1.0]
roi:
  height: 0
  width: 0
""",
    "ros2 topic echo": """height: 480
width: 640
distortion_model: plumb_bob
d:
- 0.05
- -0.02
- 0.001
- -0.0007
- 0.01
k:
- 620.0
- 0.0
- 311.0
- 0.0
- 619.0
- 227.0
- 0.0
- 0.0
- 1.0
---
""",
    "OpenCV's YAML": """%YAML:1.0
---
image_width: 640
image_height: 480
camera_matrix: !!opencv-matrix
   rows: 3
   cols: 3
   dt: d
   data: [ 6.2e+02, 0., 3.11e+02, 0., 6.19e+02,
       2.27e+02, 0., 0., 1. ]
distortion_coefficients: !!opencv-matrix
   rows: 1
   cols: 5
   dt: d
   data: [ 5.0e-02, -2.0e-02, 1.0e-03, -7.0e-04, 1.0e-02 ]
""",
    "decimal commas": "width: 640\nheight: 480\nfx: 620,0\nfy: 619,0\ncx: 311,0\ncy: 227,0\n"
    "coeffs: 0,05 -0,02 0,001 -0,0007 0,01\n",
    "toml": "width = 640\nheight = 480\nfx = 620.0\nfy = 619.0\ncx = 311.0\ncy = 227.0\n[distortion]\nk1 = 0.05\nk2 = -0.02\n"
    "p1 = 0.001\np2 = -0.0007\nk3 = 0.01\n",
}


@pytest.mark.parametrize("name", LINES)
def test_lines_as_tools_print_them(name: str, tmp_path: Path) -> None:
    (tmp_path / "k.txt").write_text(LINES[name], encoding="latin-1")
    camera = read_camera(read_table(tmp_path / "k.txt"))
    assert astuple(camera) == astuple(CAMERA)


def test_models_that_are_known_and_more_coefficients() -> None:
    for model in ("plumb_bob", "Brown Conrady", "brown-conrady", "radtan", "opencv", "pinhole", "D415"):
        assert read_camera(FOCAL | {"model": model, "coeffs": LENS}).distortion == tuple(LENS)
    eight = [0.1, -0.05, 0.001, 0.0, 0.02, 0.08, -0.03, 0.01]
    assert read_camera(FOCAL | {"distortion_model": "rational_polynomial", "D": eight}).distortion == tuple(eight)
    assert read_camera(FOCAL | {"D": [0.05, -0.02, 0, 0]}).distortion == (0.05, -0.02, 0.0, 0.0)
    assert read_camera(FOCAL | {"k1": 0.05, "k2": -0.02}).distortion == (0.05, -0.02, 0.0, 0.0)
    for none in (
        {"D": []},
        {"D": [0] * 5},
        {"distortion_model": "none"},
        {"Distortion": "Inverse Brown Conrady", "Coeffs": [0] * 5},
    ):
        assert read_camera(FOCAL | none).distortion == ()


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"model": "Inverse Brown Conrady", "coeffs": LENS}, "'Inverse Brown Conrady' is not known"),
        ({"distortion": "Modified Brown Conrady", "coeffs": LENS}, "'Modified Brown Conrady' is not known"),
        ({"distortion_model": "equidistant", "D": [0.0] * 4}, "no pinhole with Brown-Conrady"),
        ({"model": "kannala_brandt4", "coeffs": LENS}, "no pinhole"),
        ({"distortion_model": "none", "D": LENS}, "its coefficients are not zero"),
        ({"D": [0.1, 0.2, 0.3]}, "3 coefficients of the lens"),
        ({"D": [0.0] * 12 + [0.1, 0.2]}, "14 coefficients"),
        ({"lens_dist_poly": [0.1]}, "lensdistpoly: may be a coefficient of the lens that is not known"),
        ({"k7": 0.1}, "k7: may be a coefficient"),
        ({"D": LENS, "k1": 0.2}, "twice"),
        ({"D": "soft", "coeffs": LENS}, "'soft' is not known"),
        ({"D": [0.1, None, 0, 0]}, "d: "),
        ({"depth": FOCAL | {"fx": 1.0}}, "gives 'fx' twice"),
        ({"kappa": -120.0}, "kappa: of a division model of the lens, which is not known"),
        ({"distortion_model": "division", "Lambda": -1e-6}, "lambda: of a division model"),
        ({"k1": 0.05, "k2": 0.01, "k3": 0.001, "k4": 0.0001}, "k1 to k4 without p1 and p2: of a fisheye lens, or rational"),
        ({"camera_matrix": [[600.0, 0, 311.0], [0, 600.0, 227.0], [0, 0, 1]]}, "the principal point twice, and differently"),
        ({"skew": 2.5}, "skew 2.5: pixels aslant are not modelled"),
    ],
)
def test_what_is_not_known_is_refused(more: dict[str, Any], words: str) -> None:
    with pytest.raises(Unreadable, match=words):
        read_camera(FOCAL | more)


@pytest.mark.parametrize("count", [4, 5, 8, 12])
def test_the_lens_is_opencvs_and_goes_back_and_forth(count: int) -> None:
    lens = (0.12, -0.08, 0.002, -0.0015, 0.03, 0.05, -0.02, 0.01, 0.002, -0.001, 0.0015, 0.0005)[:count]
    xy = np.random.default_rng(0).uniform([-0.5, -0.4], [0.5, 0.4], (300, 2))
    theirs, _ = cv2.projectPoints(np.column_stack([xy, np.ones(300)]), np.zeros(3), np.zeros(3), np.eye(3), np.array(lens))
    np.testing.assert_allclose(distorted(xy, lens), theirs[:, 0], atol=1e-12)
    np.testing.assert_allclose(undistorted(distorted(xy, lens), lens), xy, atol=1e-9)


def test_points_lie_where_the_lens_saw_them() -> None:
    """A plane, seen through a lens: every point of the cloud lies on it, where the pinhole would have bent it."""
    normal, offset = np.array([0.1, -0.2, 1.0]), 0.5
    depth = offset / (CAMERA.rays() @ normal)
    X_BC = Transform("BC", np.diag([1.0, -1.0, -1.0]), np.array([0.0, -0.45, 0.42]))
    cloud = deproject(DepthFrame(depth=depth.astype(np.float32), intrinsics=CAMERA, X_BC=X_BC))
    np.testing.assert_allclose(X_BC.inverse().points(cloud.points) @ normal, offset, atol=1e-7)
    bent = deproject(DepthFrame(depth=depth.astype(np.float32), intrinsics=CameraIntrinsics.from_opencv(**FOCAL), X_BC=X_BC))  # type: ignore[arg-type]
    assert np.abs(bent.points - cloud.points).max() > 1e-3


def test_coefficients_that_fold_the_image_are_refused(tmp_path: Path) -> None:
    np.save(tmp_path / "d.npy", np.full((480, 640), 0.5, np.float32))
    (tmp_path / "k.json").write_text(json.dumps(FOCAL | {"D": [-3.0, 0, 0, 0]}))
    with pytest.raises(CloudFileError, match=r"fold the image over at pixel \(\d+, \d+\)"):
        read_depth_frame(tmp_path / "d.npy", tmp_path / "k.json")


@pytest.mark.parametrize(
    ("more", "words"),
    [
        ({"lens_polynomial": [0.1, -0.02, 0.0, 0.003]}, "lenspolynomial: may be a coefficient"),
        ({"fx": 0.97, "fy": 1.29, "cx": 0.49, "cy": 0.47}, "fx 0.97 px is under 0.1 of an image 640 px"),
        ({"fx": 1.88, "fy": 1.88}, "millimetres"),
        ({"cx": 933.0}, "cx 933 px lies outside the image of 640 px"),
        ({"cy": -20.0}, "cy -20 px lies outside the image of 480 px"),
        ({"binning_x": 2, "binning_y": 2}, "pixels are joined"),
        ({"model": "SIMPLE_RADIAL", "k": 0.1}, "SIMPLE_RADIAL' is not known"),
        ({"model": "distortion.inverse_brown_conrady", "coeffs": LENS}, "is not known"),
    ],
)
def test_figures_of_another_unit_image_or_lens_are_refused(more: dict[str, Any], words: str) -> None:
    with pytest.raises(Unreadable, match=words):
        read_camera(FOCAL | more)


def test_lists_that_are_no_coefficients_are_passed_over() -> None:
    for more in (
        {"crop": [0, 0, 640, 480]},
        {"pose_quaternion": [0.5, 0.5, 0.5, 0.5]},
        {"fov": [54.6, 42.3]},
        {"binning_x": 0, "binning_y": 1},
        {"P": [620.0, 0, 311.5, 0, 0, 619.0, 227.5, 0, 0, 0, 1, 0]},
        {"p": [620.0, 0, 311.5, 0, 0, 619.0, 227.5, 0, 0, 0, 1, 0]},
    ):
        assert read_camera(FOCAL | more).distortion == ()


MATLAB = {"ImageSize": [480, 640], "RadialDistortion": LENS[:2], "TangentialDistortion": LENS[2:4]}
FROM_ONE = [[620.0, 0, 312.0], [0, 619.0, 228.0], [0, 0, 1]]


@pytest.mark.parametrize(
    "focal",
    [
        {"FocalLength": [620.0, 619.0], "PrincipalPoint": [312.0, 228.0], "Skew": 0},
        {"K": FROM_ONE},
        {"IntrinsicMatrix": np.transpose(FROM_ONE).tolist()},
        {"FocalLength": [620.0, 619.0], "PrincipalPoint": [312.0, 228.0], "K": FROM_ONE},
    ],
)
def test_matlabs_image_size_is_rows_and_columns_and_its_first_pixel_is_one(focal: dict[str, Any]) -> None:
    wanted = CameraIntrinsics.from_opencv(**FOCAL, distortion=tuple(LENS[:4]))  # type: ignore[arg-type]
    assert astuple(read_camera(MATLAB | focal)) == astuple(wanted)
    assert astuple(read_camera({"Intrinsics": MATLAB | focal})) == astuple(wanted)


def test_focal_lengths_and_principal_point_as_lists() -> None:
    wanted = CameraIntrinsics.from_opencv(**FOCAL)  # type: ignore[arg-type]
    size, centre = {"image_size": [640, 480]}, {"principal_point": [311.0, 227.0]}
    assert astuple(read_camera(size | centre | {"focal_length": [620.0, 619.0]})) == astuple(wanted)
    one = CameraIntrinsics.from_opencv(**FOCAL | {"fy": 620.0})  # type: ignore[arg-type]
    assert astuple(read_camera(size | centre | {"focal_length": 620.0})) == astuple(one)


def test_the_name_of_the_model_that_is_asked_for_helps() -> None:
    lens = {"k1": 0.05, "k2": 0.01, "k3": 0.001, "k4": 0.0001}
    assert read_camera(FOCAL | lens | {"distortion_model": "rational_polynomial"}).distortion == (
        0.05,
        0.01,
        0,
        0,
        0.001,
        0.0001,
        0,
        0,
    )


def test_an_image_whose_sides_are_swapped_is_told_so(tmp_path: Path) -> None:
    np.save(tmp_path / "depth.npy", np.full((480, 640), 0.5))
    (tmp_path / "camera.json").write_text(json.dumps(FOCAL | {"width": 480, "height": 640}))
    with pytest.raises(CloudFileError, match="are width and height swapped there, rows first"):
        read_depth_frame(tmp_path / "depth.npy", tmp_path / "camera.json")
