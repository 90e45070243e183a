"""`weldsim plan`."""

from dataclasses import asdict, dataclass, replace
from pathlib import Path
from typing import TYPE_CHECKING, Annotated, Any, ClassVar, Literal

import tyro

from weldsim import units
from weldsim.cli.options import ConfigOptions, Method, refuse_together
from weldsim.cli.outputs import check_folder, check_outputs, check_suffix, nearest_folder, refuse_file, refuse_run
from weldsim.cli.quantities import COUNT, POINT, quantities, quantity
from weldsim.cli.show import Tell, progress, reasons_refused, table, times
from weldsim.counted import counted
from weldsim.errors import CloudError, InputError, NoSeamError, PathError

if TYPE_CHECKING:
    from weldsim.config import CellConfig
    from weldsim.pipeline import Clock, PlanResult
    from weldsim.records import PointCloud

DEPTH_UNITS = ("1 mm", "0.1 mm")  # of a count, as depth cameras have them


@dataclass(frozen=True, kw_only=True)
class Plan(ConfigOptions):
    """Find the groove in a scan and plan the torch path along it.

    The cloud is a PLY, PCD, XYZ, PTX, NPZ or NPY file in the base of the robot, or with --intrinsics a depth image. Without
    --out nothing is written and a summary is printed.
    """

    reads: ClassVar[tuple[str, ...]] = ("cloud", "seam", "path", "report")

    cloud: Annotated[tyro.conf.Positional[Path], tyro.conf.arg(metavar="CLOUD")]
    """File with the cloud, or with a depth image (16-bit PNG, NPY)."""

    viewpoint: Annotated[tuple[float, float, float] | None, quantities(POINT, "--viewpoint", words=3)] = None
    """Where the camera stood: metres, or each with its unit, "-750 mm" say; by default what the file says."""

    units: Literal["m", "cm", "mm", "um", "in", "ft"] | None = None
    """Unit of length of the cloud; by default the one that its columns' names give, else metres."""

    intrinsics: Path | None = None
    """Camera of a depth image: JSON, TOML or `key: value` lines."""

    pose: Path | None = None
    """Pose of that camera in the base: JSON, TOML or YAML, or a 4x4 matrix; by default the base is where the camera is."""

    depth_unit: Annotated[float | None, quantity(COUNT, "--depth-unit")] = None
    """Length of one count of a depth image, "1 mm" by default."""

    method: Method | None = None
    """Seam finder: ours (the default) or the published one."""

    seam: int | Literal["all"] | None = None
    """Which seam, counted from 1, the best one; `all`, the default, takes every one."""

    near: Annotated[tuple[float, float, float] | None, quantities(POINT, "--near", words=3)] = None
    """The seam nearest to this point: metres, or each with its unit."""

    out: Path | None = None
    """Where to write the path as JSON, schema weldsim.path/1."""

    csv: Path | None = None
    """Where to write the path as CSV with UR poses of the torch tip."""

    report: Path | None = None
    """Where to write the report: a page ending in .html, a picture ending in .png, or a folder for both. It says how far the seams
    move with the threshold: for that they are found twice more, which takes twice as long as finding them."""

    def __call__(self) -> int:
        """0. Raises NoSeamError, after the report where one was asked for."""
        page, picture = self._report_files()
        self._check(page, picture)
        config = self.cell(self.method)
        with progress() as tell:
            result, clock = self._plan(config, tell)
            if self.report is not None:
                with clock.stage("stability"):
                    result = _with_stability(result, config)
            chosen, numbers = self._chosen(result)
            if self.report is not None:
                with clock.stage("report"):
                    self._write_report(page, picture, chosen, clock, config)
        if not result.findings.seams:
            told = "; ".join((reasons_refused(result.findings, config.seam.profile), *result.notes))
            raise NoSeamError(
                f"{self.cloud}: no seam found; {told}{self._hint(config, result)}",
                rejected=[asdict(refused) for refused in result.findings.rejected],
            )
        document = self._document(chosen, numbers, clock)
        self._write(document)
        if self.json:
            self._print_json(document, result)
        else:
            self._print(chosen, numbers, result, clock, [path for path in (self.out, self.csv, page, picture) if path is not None])
        return 0

    def _check(self, page: Path | None, picture: Path | None) -> None:
        """Raises InputError where options contradict each other or an output cannot be written."""
        refuse_together(seam=self.seam, near=self.near)
        refuse_together(viewpoint=self.viewpoint, intrinsics=self.intrinsics)
        refuse_together(units=self.units, intrinsics=self.intrinsics)
        for name in ("pose", "depth_unit"):
            if getattr(self, name) is not None and self.intrinsics is None:
                raise InputError(f"--{name.replace('_', '-')}: belongs to a depth image; give its --intrinsics too", option=name)
        check_suffix(self.out, (".json",), "a path", others={".csv": "--csv"})
        check_suffix(self.csv, (".csv",), "a path as CSV", others={".json": "--out"})
        if isinstance(self.seam, int) and self.seam < 1:
            raise InputError(f"--seam {self.seam}: seams are counted from 1", seam=self.seam)
        if page is not None and page.parent == self.report and not page.parent.exists():
            check_folder(nearest_folder(page), page)
            page = picture = None  # in a folder still to be made
        self._refuse_scene()
        check_outputs((self.out, self.csv, page, picture), (self.cloud, self.intrinsics, self.pose, self.config))

    def _refuse_scene(self) -> None:
        """Raises InputError where the cloud is the name of a scene."""
        from weldsim.scene.files import scene_names

        if str(self.cloud) in scene_names() and not self.cloud.exists():
            raise InputError(
                f"{self.cloud} is a scene, no cloud; did you mean weldsim run {self.cloud}, or first"
                f" weldsim scan {self.cloud} --out {self.cloud}.ply?"
            )

    def _hint(self, config: "CellConfig", result: "PlanResult") -> str:
        """What to do where no seam was found; empty where nothing that was tried helps."""
        from weldsim.hints import hint

        return hint(self._read(config), config, result.findings.rejected, imaged=self.intrinsics is not None)

    def _report_files(self) -> tuple[Path | None, Path | None]:
        """HTML and PNG; None for what is not asked for. Raises OutputError for a name that is neither, nor a folder's."""
        suffix = "" if self.report is None else self.report.suffix.lower()
        if self.report is None:
            return None, None
        if suffix in (".html", ".htm"):
            return self.report, None
        if suffix == ".png":
            return None, self.report
        refuse_file(self.report, "--report", "a page ends in .html, a picture in .png, a folder in neither")
        refuse_run(self.report, "--report")
        return self.report / "report.html", self.report / "report.png"

    def _plan(self, config: "CellConfig", tell: Tell) -> "tuple[PlanResult, Clock]":
        from weldsim import pipeline

        clock = pipeline.Clock(tell)
        with clock.stage("read"):
            cloud = self._read(config)
        try:
            return pipeline.plan(cloud, config, clock=clock), clock
        except (CloudError, PathError) as error:
            hint = self._depth_unit_hint(config) if "distance" in error.data and self.intrinsics is not None else ""
            raise type(error)(f"{self.cloud}: {error}{hint}", **error.data) from None

    def _depth_unit_hint(self, config: "CellConfig") -> str:
        """Which unit of a count brings a depth image that lies too far away within reach; empty where none does."""
        from weldsim.cloud.extent import check_reach

        for unit in DEPTH_UNITS:
            try:
                check_reach(replace(self, depth_unit=units.parse(unit, "m"))._read(config))
            except InputError:
                continue
            return f'; with --depth-unit "{unit}" it lies within reach'
        return ""

    def _read(self, config: "CellConfig") -> "PointCloud":
        """The cloud in the file. Raises CloudFileError, CloudError, ConfigError."""
        from weldsim.cloud.deproject import deproject
        from weldsim.cloud.depth_files import check_depth_unit
        from weldsim.cloud.files import read_cloud, read_depth_frame

        if self.intrinsics is None:
            box = config.cloud
            crop = None if box.crop_min is None or box.crop_max is None else (box.crop_min, box.crop_max)
            return read_cloud(self.cloud, unit=self.units, viewpoint=self.viewpoint, crop=crop)
        if self.depth_unit is not None:
            check_depth_unit(self.intrinsics, self.depth_unit)
        count = {} if self.depth_unit is None else {"depth_unit": self.depth_unit}
        return deproject(read_depth_frame(self.cloud, self.intrinsics, pose=self.pose, **count))

    def _chosen(self, result: "PlanResult") -> "tuple[PlanResult, tuple[int, ...]]":
        """The result with the seams that were asked for alone, and their numbers."""
        import numpy as np

        from weldsim.pipeline import pick

        findings = result.findings
        everything = tuple(range(1, len(findings.seams) + 1))
        if not everything or (self.seam in (None, "all") and self.near is None):
            return result, everything
        index = pick(findings, self.seam if isinstance(self.seam, int) else None, self.near)
        if index in result.refused:
            raise PathError(f"{self.cloud}: seam {index + 1}: {result.refused[index]}", **result.refused[index].data)
        region = np.where(findings.region == index + 1, 1, 0)
        findings = replace(findings, seams=(findings.seams[index],), region=region)
        return replace(result, findings=findings, paths=(result.paths[index],), refused={}), (index + 1,)

    def _document(self, chosen: "PlanResult", numbers: tuple[int, ...], clock: "Clock") -> dict[str, Any]:
        from weldsim.path.files import path_document

        viewpoints = chosen.cloud.viewpoints.tolist()
        source = {"file": self.cloud.name, "points": len(chosen.cloud), "viewpoints": viewpoints, "method": chosen.findings.method}
        return path_document(
            chosen.findings.seams,
            chosen.paths,
            clock.seconds,
            source,
            chosen.config_digest,
            numbers=numbers or None,
            refused={index: str(error) for index, error in chosen.refused.items()},
        )

    def _write(self, document: dict[str, Any]) -> None:
        from weldsim.path.files import write_path_csv, write_path_json

        if self.out is not None:
            write_path_json(self.out, document)
        if self.csv is not None:
            write_path_csv(self.csv, document)

    def _write_report(
        self, page: Path | None, picture: Path | None, chosen: "PlanResult", clock: "Clock", config: "CellConfig"
    ) -> None:
        from weldsim.output import write_whole
        from weldsim.pipeline import unplanned
        from weldsim.report.html import write_html
        from weldsim.report.png import png
        from weldsim.report.weld import weld_report

        report = weld_report(
            chosen.findings,
            chosen.paths,
            scene=self.cloud.name,
            unplanned=unplanned(chosen),
            timing=dict(clock.seconds),
            config_digest=chosen.config_digest,
            config=config.report,
        )
        still = png(report, chosen.cloud, chosen.findings, chosen.paths, config=config.report)
        if page is not None:
            page.parent.mkdir(parents=True, exist_ok=True)
            write_html(page, report, chosen.cloud, chosen.findings, chosen.paths, config=config.report, still=still)
        if picture is not None:
            write_whole(picture, still)

    def _print_json(self, document: dict[str, Any], result: "PlanResult") -> None:
        import numpy as np

        from weldsim.path.files import path_text

        threshold = result.findings.threshold
        more: dict[str, Any] = {"rejected": [asdict(refused) for refused in result.findings.rejected], "notes": list(result.notes)}
        if threshold is not None:
            kept = {factor: move if np.isfinite(move) else None for factor, move in threshold.stability.items()}
            more["threshold"] = {**asdict(threshold), "stability": kept}
        print(path_text({**document, **more}), end="")

    def _print(
        self, chosen: "PlanResult", numbers: tuple[int, ...], result: "PlanResult", clock: "Clock", written: list[Path]
    ) -> None:
        import numpy as np

        from weldsim.pipeline import unplanned

        found, method = len(result.findings.seams), chosen.findings.method
        print(f"{self.cloud.name}: {counted(len(result.cloud), 'point')}, {counted(found, 'seam')}, method {method}")
        rows = []
        for number, seam, path in zip(numbers, chosen.findings.seams, chosen.paths, strict=True):
            sigma = "-" if seam.sigma is None else f"{units.to_mm(float(np.median(seam.sigma))):.3f} mm"
            rows.append(
                [
                    str(number),
                    f"{units.to_mm(seam.length):.1f} mm",
                    f"{units.to_mm(seam.width):.1f} mm" if seam.width > 0 else "-",
                    "-" if seam.depth is None else f"{units.to_mm(seam.depth):.1f} mm",
                    f"{seam.confidence:.2f}" if seam.confidence > 0 else "-",
                    sigma,
                    seam.reference,
                    "-" if path is None else str(len(path.s)),
                ]
            )
        print(table(rows, ("seam", "length", "width", "depth", "confidence", "sigma", "reference", "poses")))
        for number, seam in zip(numbers, chosen.findings.seams, strict=True):
            for s0, s1 in seam.gaps:
                print(
                    f"  seam {number}: {units.to_mm(s0):.0f} to {units.to_mm(s1):.0f} mm not measured, the line is carried across"
                )
        for clause in (*unplanned(chosen), *result.notes):
            print(f"  {clause}")
        print(times(clock.seconds))
        if self.report is not None:
            print(f"  stability, for the report alone: the seams found twice more, {clock.seconds['stability']:.1f} s")
        for path in written:
            print(f"  wrote {path}")


def _with_stability(result: "PlanResult", config: "CellConfig") -> "PlanResult":
    from weldsim.seam.stability import with_stability

    return replace(result, findings=with_stability(result.cloud, result.findings, config.seam))
