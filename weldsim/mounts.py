"""Where things are bolted in the thesis's cell, and its camera figures: facts shared by the twin, motion and the CLI.

Sources: the thesis author's published code (three calibrations agree within 1 mm, 4 mm in z) and thesis eq 5.2.
"""

import numpy as np

from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.records import CameraIntrinsics

X_FT = Transform("FT", matrix_from_rotation_vector(np.array([np.deg2rad(-48.70), 0.0, 0.0])), np.array([0.0, 0.048, 0.227]))
"""Flange to torch tip at nominal stick-out."""

PAYLOAD = 1.2
"""Mass of torch, bracket and camera [kg]: an assumption, of the size of common light torches."""

PAYLOAD_COG = np.array([0.0, -0.02, 0.08])
"""Its centre in F [m]."""

X_FC = Transform("FC", np.eye(3), np.array([-0.0356, -0.1161, 0.0739]))
"""Flange to the D415's optical frame (eye in hand)."""

X_WB = Transform("WB", np.diag([-1.0, -1.0, 1.0]), np.array([0.0, 0.0, 0.75]))
"""The robot's controller base in the twin's world: the world has the orientation of `base_link` (the controller's base
turned half a turn about z) and its floor 0.75 m below the table top, on which the arm stands."""

X_WC_KINECT = Transform("WC", np.diag([1.0, -1.0, -1.0]), np.array([-0.041, 0.444, 0.75 + 0.830]))
"""The overhead Kinect v2's optical frame; base_link to Kinect is t = (-0.041, 0.444, 0.830) m."""

D415_640X480 = CameraIntrinsics.from_opencv(
    width=640,
    height=480,
    fx=619.9661254882812,
    fy=619.856201171875,
    cx=311.2325744628906,
    cy=226.9261474609375,
)
"""Thesis eq 5.2."""

KINECT_V2 = CameraIntrinsics.from_opencv(width=512, height=424, fx=365.456, fy=365.456, cx=254.878, cy=205.395)
"""A common Kinect v2 depth camera."""
