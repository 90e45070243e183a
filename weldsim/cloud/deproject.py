"""Depth image to points: each pixel's depth along its ray, in the robot base."""

import numpy as np

from weldsim.records import DepthFrame, PointCloud


def deproject(frame: DepthFrame) -> PointCloud:
    """The points_B of every pixel with a return, in row order, with the pixel each came from.

    The pinhole model of thesis eq 5.1: p_C = depth * ((u + 1/2 - cx) / fx, (v + 1/2 - cy) / fy, 1), u and v the pixel's
    column and row; where the lens distorts, the ray that it bends to that pixel. The camera's position is the cloud's
    viewpoint; a colour image gives the colours. Points of a lens that distorts do not keep their pixels: in that image
    planes are not affine.
    """
    camera, X_BC = frame.intrinsics, frame.X_BC
    pixel = np.flatnonzero(np.isfinite(frame.depth))
    row, column = np.divmod(pixel, camera.width)
    depth = frame.depth.reshape(-1)[pixel].astype(float)
    if camera.distortion:
        x, y = camera.rays().reshape(-1, 3)[pixel, :2].T * depth
    else:
        x = ((np.arange(camera.width) + 0.5 - camera.cx) / camera.fx)[column] * depth
        y = ((np.arange(camera.height) + 0.5 - camera.cy) / camera.fy)[row] * depth
    points = np.empty((len(pixel), 3))
    for axis in range(3):
        r = X_BC.R[axis]
        points[:, axis] = r[0] * x + r[1] * y + r[2] * depth + X_BC.p[axis]
    return PointCloud(
        points=points,
        frame="B",
        colours=None if frame.colour is None else frame.colour.reshape(-1, 3)[pixel] / 255.0,
        viewpoints=X_BC.p[None],
        pixel=None if camera.distortion else pixel,
        intrinsics=None if camera.distortion else camera,
        X_BC=None if camera.distortion else X_BC,
    )
