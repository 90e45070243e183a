"""`weldsim scan`."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import Any, ClassVar, Literal

from weldsim.cli.options import ConfigOptions, SceneName, choose_platform
from weldsim.cli.outputs import check_outputs, check_suffix
from weldsim.cli.show import print_json, progress
from weldsim.counted import counted
from weldsim.errors import InputError
from weldsim.sensor.names import SensorName

CLOUDS = (".ply", ".npz", ".xyz", ".txt")


@dataclass(frozen=True, kw_only=True)
class Scan(ConfigOptions):
    """Let the twin scan a scene, and write what the camera saw as `weldsim plan` reads it."""

    reads: ClassVar[tuple[str, ...]] = ("twin", "sensor", "d435", "stereo", "kinect", "cloud", "scan", "motion", "execution")

    scene: SceneName
    """Name of a scene (`weldsim scenes`), or a TOML file."""

    seed: int = 0
    """Of the camera's noise."""

    sensor: SensorName = "d415"
    """What looks: the model of a D415 or D435, rendered and matched infrared images, the Kinect v2 above, or exact depth."""

    out: Path | None = None
    """Where to write the cloud of all views: PLY, NPZ, XYZ or TXT."""

    depth: Path | None = None
    """Where to write the depth image (16-bit PNG, or NPY in metres); intrinsics and pose are written beside it."""

    view: int = 1
    """Which view the depth image is of, counted from 1."""

    views: Literal["scene", "auto"] | None = None
    """Views to take: the scene's own, or chosen from the part's drawing (as does --set scan.views=auto)."""

    def __call__(self) -> int:
        """0."""
        from weldsim.cloud.depth_output import depth_file_names
        from weldsim.sensor.choose import depth_step

        if self.seed < 0:
            raise InputError(f"--seed {self.seed}: 0 or more is needed", seed=self.seed)
        check_suffix(self.out, CLOUDS, "a cloud")
        files = () if self.depth is None else depth_file_names(self.depth)
        check_outputs((self.out, *files), (self.config,))
        config, scene = self.cell(), self.scene_of(self.scene)
        if self.views is not None:
            config = replace(config, scan=replace(config.scan, views=self.views))
        views = 1 if self.sensor == "kinect" else config.scan.most if config.scan.views == "auto" else len(scene.views)
        if self.view != 1 and self.depth is None:
            raise InputError(f"--view {self.view}: belongs to a depth image; give --depth too", view=self.view)
        if not 1 <= self.view <= max(1, views):
            raise InputError(f"--view {self.view}: scene {scene.name!r} has {views}, counted from 1", view=self.view)
        choose_platform()

        from weldsim.cloud.register import lines
        from weldsim.pipeline import Clock, look

        with progress() as tell:
            seen = look(scene, config, seed=self.seed, sensor=self.sensor, clock=Clock(tell))
        captures, cloud, found = seen.captures, seen.cloud, seen.registration
        if self.view > len(captures):
            raise InputError(f"--view {self.view}: {len(captures)} were taken, counted from 1", view=self.view)
        self._write(cloud, captures[self.view - 1].frame, depth_step(self.sensor, config))
        written = [str(path) for path in (self.out, *files) if path is not None]
        if self.json:
            what = {"scene": scene.name, "seed": self.seed, "sensor": self.sensor, "views": len(captures), "points": len(cloud)}
            what |= {"notes": list(seen.world.workpiece.notes)}
            lined_up = None if found is None else asdict(found)
            print_json({**what, "viewpoints": cloud.viewpoints.tolist(), "lined_up": lined_up, "written": written})
            return 0
        seen_in = f"{counted(len(cloud), 'point')} from {counted(len(captures), 'view')}"
        print(f"{scene.name}, seed {self.seed}, {captures[0].frame.source}: {seen_in}")
        for i, (x, y, z) in enumerate(cloud.viewpoints, start=1):
            print(f"  view {i} from ({x:.4f}, {y:.4f}, {z:.4f}) m in the base")
        for line in (*seen.world.workpiece.notes, *seen.world.notes, *lines(found)):
            print(f"  {line}")
        for name in written:
            print(f"  wrote {name}")
        return 0

    def _write(self, cloud: Any, frame: Any, step: float) -> None:
        from weldsim.cloud.depth_output import write_depth_frame
        from weldsim.cloud.files import write_cloud

        if self.out is not None:
            write_cloud(self.out, cloud)
        if self.depth is not None:
            write_depth_frame(self.depth, frame, depth_unit=step)
