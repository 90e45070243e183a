"""What a sensor saw: camera intrinsics, depth frame, point cloud."""

from dataclasses import dataclass, field

import numpy as np
from jaxtyping import Bool, Float, Float32, Int, UInt8
from numpy import ndarray

from weldsim.frames import Transform
from weldsim.records.checks import check_metres, check_unit, require, store
from weldsim.records.lens import COUNTS, undistorted


@dataclass(frozen=True, eq=False, kw_only=True)
class CameraIntrinsics:
    """A pinhole camera, or one whose lens distorts. Pixel (u, v) has its centre at (u + 1/2, v + 1/2), so a drivers'
    OpenCV-style principal point (pixel centres at whole numbers) is half a pixel smaller: use `from_opencv`.

    Attributes:
        width, height: image size [px].
        fx, fy: focal lengths [px].  cx, cy: principal point [px], half-pixel convention.
        distortion: coefficients of the lens in OpenCV's order (`weldsim.records.lens`); none for a pinhole.
    """

    width: int
    height: int
    fx: float
    fy: float
    cx: float
    cy: float
    distortion: tuple[float, ...] = ()

    def __post_init__(self) -> None:
        require(self.width > 0 and self.height > 0, self, "width", f"{self.width} x {self.height} is no image size")
        require(bool(np.isfinite([self.fx, self.fy, self.cx, self.cy]).all()), self, "fx", "not finite")
        require(self.fx > 0 and self.fy > 0, self, "fx", f"focal length ({self.fx}, {self.fy}) px must be positive")
        known = len(self.distortion) in COUNTS and bool(np.isfinite(self.distortion).all())
        require(known, self, "distortion", f"{self.distortion} are not {', '.join(map(str, COUNTS))} finite coefficients")

    @classmethod
    def from_opencv(
        cls, *, width: int, height: int, fx: float, fy: float, cx: float, cy: float, distortion: tuple[float, ...] = ()
    ) -> "CameraIntrinsics":
        """From figures as OpenCV, ROS and librealsense print them (pixel centres at whole numbers; thesis eq 5.1)."""
        return cls(width=width, height=height, fx=fx, fy=fy, cx=cx + 0.5, cy=cy + 0.5, distortion=distortion)

    def rays(self) -> Float[ndarray, "h w 3"]:
        """Direction of each pixel's ray in C, z = 1 (so depth times ray is the point); NaN where the lens gives a pixel none."""
        u = (np.arange(self.width) + 0.5 - self.cx) / self.fx
        v = (np.arange(self.height) + 0.5 - self.cy) / self.fy
        rays = np.ones((self.height, self.width, 3))
        rays[..., 0], rays[..., 1] = u[None, :], v[:, None]
        if self.distortion:
            rays[..., :2] = undistorted(rays[..., :2].reshape(-1, 2), self.distortion).reshape(*rays.shape[:2], 2)
        return rays


@dataclass(frozen=True, eq=False, kw_only=True)
class DepthFrame:
    """One depth image.

    Attributes:
        depth: z-depth along the optical axis [m], float32 (h, w); NaN = no return.
        colour: RGB (h, w, 3) uint8 registered to depth, or None.
        intrinsics: of the depth image.
        X_BC: pose of the camera in the robot base at exposure.
        t: time of exposure [s].
        source: which sensor or file it came from.
    """

    depth: Float32[ndarray, "h w"]
    intrinsics: CameraIntrinsics
    X_BC: Transform
    colour: UInt8[ndarray, "h w 3"] | None = None
    t: float = 0.0
    source: str = ""

    def __post_init__(self) -> None:
        shape = (self.intrinsics.height, self.intrinsics.width)
        store(self, "depth", self.depth, shape=shape, dtype=np.float32, nan=True)
        require(not np.isinf(self.depth).any(), self, "depth", "holds infinite values; use NaN for no return")
        require(not bool((self.depth <= 0).any()), self, "depth", "holds values <= 0; use NaN for no return")
        if self.colour is not None:
            store(self, "colour", self.colour, shape=(*shape, 3), dtype=np.uint8)
        require(self.X_BC.names == "BC", self, "X_BC", f"is X_{self.X_BC.names}")


@dataclass(frozen=True, eq=False, kw_only=True)
class PointCloud:
    """Points on surfaces, in one frame.

    Attributes:
        points: (n, 3) [m], all finite.
        frame: the letter of the frame they are expressed in.
        normals: (n, 3) unit, towards the sensor, or None.
        colours: (n, 3) in [0, 1], or None.
        viewpoints: (k, 3) [m] where the cameras stood, in the same frame; k = 0 when unknown.
        view: (n,) which viewpoint saw each point; None when k <= 1.
        pixel: (n,) row * width + column of each point in the depth image of its view, or None.
        intrinsics, X_BC: of that depth image, or None; X_BC is a batch, one pose a viewpoint, where there are several.
        notes: what was done to the points while they were read, one sentence each, for people.
    """

    points: Float[ndarray, "n 3"]
    frame: str = "B"
    normals: Float[ndarray, "n 3"] | None = None
    colours: Float[ndarray, "n 3"] | None = None
    viewpoints: Float[ndarray, "k 3"] = field(default_factory=lambda: np.zeros((0, 3)))
    view: Int[ndarray, "n"] | None = None
    pixel: Int[ndarray, "n"] | None = None
    intrinsics: CameraIntrinsics | None = None
    X_BC: Transform | None = None
    notes: tuple[str, ...] = ()

    def __post_init__(self) -> None:
        store(self, "points", self.points, shape=("n", 3))
        n = len(self.points)
        check_metres(self, "points", self.points)
        if self.normals is not None:
            store(self, "normals", self.normals, shape=(n, 3))
            check_unit(self, "normals", self.normals)
        if self.colours is not None:
            store(self, "colours", self.colours, shape=(n, 3))
        store(self, "viewpoints", self.viewpoints, shape=("k", 3))
        if self.view is not None:
            store(self, "view", self.view, shape=(n,), dtype=np.int64)
            named = n == 0 or bool(self.view.min() >= 0 and self.view.max() < len(self.viewpoints))
            require(named, self, "view", "names no viewpoint")
        if self.pixel is not None:
            store(self, "pixel", self.pixel, shape=(n,), dtype=np.int64)
            require(self.intrinsics is not None and self.X_BC is not None, self, "pixel", "needs intrinsics and X_BC")

    def __len__(self) -> int:
        return len(self.points)

    def select(self, keep: Bool[ndarray, "n"] | Int[ndarray, "m"]) -> "PointCloud":
        """The points picked by a mask or by indices, with everything that belongs to them."""

        def pick(array: ndarray | None) -> ndarray | None:
            return None if array is None else array[keep]

        return PointCloud(
            points=self.points[keep],
            frame=self.frame,
            normals=pick(self.normals),
            colours=pick(self.colours),
            viewpoints=self.viewpoints,
            view=pick(self.view),
            pixel=pick(self.pixel),
            intrinsics=self.intrinsics,
            X_BC=self.X_BC,
            notes=self.notes,
        )

    def sight_origins(self) -> Float[ndarray, "n 3"] | None:
        """Where the camera that saw each point stood (n, 3), or None when unknown."""
        if len(self.viewpoints) == 0:
            return None
        if self.view is None:
            return np.broadcast_to(self.viewpoints[0], self.points.shape)
        return self.viewpoints[self.view]
