"""Golden figures: what every scene and method came to when it was last accepted, with tolerance and reason beside each.

A file of schema `weldsim.golden/2`: scenes, then methods, then figures; of each figure the value for each seed from 0
(SI units; null where there was none), the tolerance by which it may be worse (null = never judged), how it is judged ("seed":
each against the same seed's; "distribution": all seeds as one sample, see `weldsim.regression.distribution`), and why it is
as it is. In files of `weldsim.golden/1` every figure is judged by seed.
"""

import json
from collections.abc import Iterable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from weldsim import __version__
from weldsim.errors import InputError
from weldsim.output import write_whole
from weldsim.regression.figures import FIGURES, Figures, Judge, judge_of

SCHEMA = "weldsim.golden/2"
READABLE = ("weldsim.golden/1", SCHEMA)
JUDGES: tuple[Judge, ...] = ("seed", "distribution")
DIGITS = 7  # decimals kept: 0.1 um


@dataclass(frozen=True, kw_only=True)
class Entry:
    """One figure of one scene and method. Attributes: values, one a seed from 0; tolerance; reason; judge: as what."""

    values: tuple[float | None, ...]
    tolerance: float | None
    reason: str
    judge: Judge = "seed"

    def judges(self, seed: int) -> bool:
        """Whether this seed's figure is held against its own record."""
        return self.judge == "seed" and self.tolerance is not None and seed < len(self.values)


Entries = dict[str, Entry]


@dataclass(frozen=True, kw_only=True)
class Golden:
    """All recorded figures. Attributes: reason, version: of the last recording; scenes: {scene: {method: {figure: entry}}}."""

    reason: str = ""
    version: str = __version__
    scenes: dict[str, dict[str, Entries]] = field(default_factory=dict)

    def entries(self, scene: str, method: str) -> Entries:
        """The figures recorded for a scene and method; none where there are none."""
        return self.scenes.get(scene, {}).get(method, {})


@dataclass(frozen=True, kw_only=True)
class Deviation:
    """A figure that is worse than it may be.

    Attributes:
        scene, method, seed, figure: where.  value: as measured; None = it could not be.
        golden: as recorded.  tolerance: by which it may be worse.  excess: how much further it is off; None without value.
    """

    scene: str
    method: str
    seed: int
    figure: str
    value: float | None
    golden: float
    tolerance: float
    excess: float | None


def default_golden() -> Path:
    """The golden file that comes with weldsim: tests/regression/golden.json of a checkout, or inside the installed package."""
    package = Path(__file__).resolve().parents[1]
    packed = package / "_data" / "regression" / "golden.json"
    return packed if packed.is_file() else package.parent / "tests" / "regression" / "golden.json"


def is_packed(path: Path) -> bool:
    """Whether `path` is the golden file inside an installed package, which is not for changing."""
    return path.resolve() == default_golden().resolve() and "_data" in path.resolve().parts


def read_golden(path: Path | str) -> Golden:
    """The golden figures of a file.

    Raises:
        InputError: it is missing, no JSON, of another schema, or an entry is not what it must be; one line says which.
    """
    try:
        data = json.loads(Path(path).read_bytes())
    except FileNotFoundError:
        raise InputError(f"{path}: no such golden file; record one with --update --reason", path=str(path)) from None
    except OSError as error:
        raise InputError(f"{path}: cannot be read ({error.strerror})", path=str(path)) from None
    except (ValueError, RecursionError) as error:
        raise InputError(f"{path}: no golden file: not JSON ({error})", path=str(path)) from None
    if not isinstance(data, dict) or data.get("schema") not in READABLE or not isinstance(data.get("scenes"), dict):
        raise InputError(f"{path}: no golden file: wants schema {SCHEMA!r} and a table 'scenes'", path=str(path))
    scenes: dict[str, dict[str, Entries]] = {}
    for scene, methods in data["scenes"].items():
        for method, entries in _table(methods, f"{path}: {scene}").items():
            for name, entry in _table(entries, f"{path}: {scene}.{method}").items():
                where = f"{path}: {scene}.{method}.{name}"
                scenes.setdefault(scene, {}).setdefault(method, {})[name] = _entry(name, _table(entry, where), where)
    return Golden(reason=str(data.get("reason", "")), version=str(data.get("version", "")), scenes=scenes)


def write_golden(path: Path | str, golden: Golden) -> Path:
    """The file written, a line for each figure, whole or not at all. Raises OutputError."""
    head = {"schema": SCHEMA, "units": {"length": "m", "angle": "rad", "time": "s"}, "version": golden.version}
    lines = [f" {_text(key)}: {_text(value)}," for key, value in (head | {"reason": golden.reason}).items()]
    scenes = ",\n".join(
        f"  {_text(scene)}: {{\n" + ",\n".join(_method_text(*item) for item in sorted(methods.items())) + "\n  }"
        for scene, methods in sorted(golden.scenes.items())
    )
    return write_whole(path, "\n".join(["{", *lines, ' "scenes": {', scenes, " }", "}"]) + "\n")


def _method_text(method: str, entries: Entries) -> str:
    rows = [
        f"    {_text(name)}: {_text({'values': list(e.values), 'tolerance': e.tolerance, 'judge': e.judge, 'reason': e.reason})}"
        for name, e in entries.items()
    ]
    return f"   {_text(method)}: {{\n" + ",\n".join(rows) + "\n   }"


def _text(value: Any) -> str:
    return json.dumps(value, ensure_ascii=False, allow_nan=False)


def compare(figures: Figures, entries: Entries) -> tuple[Deviation, ...]:
    """The figures of one seed that are worse than recorded by more than their tolerance.

    A figure without an entry, one recorded as null or as a distribution, or a seed beyond those recorded is not judged; better
    never fails.
    """
    out = []
    for name, value in figures.judged().items():
        entry = entries.get(name)
        if entry is None or entry.tolerance is None or not entry.judges(figures.seed):
            continue
        golden = entry.values[figures.seed]
        if golden is None:
            continue
        worse = None
        if value is not None:
            worse = (golden - value if FIGURES[name].larger_is_better else value - golden) - entry.tolerance
            if worse <= 0.5 * 10.0**-DIGITS:  # recorded values are rounded
                continue
        where = {"scene": figures.scene, "method": figures.method, "seed": figures.seed, "figure": name}
        out.append(Deviation(**where, value=value, golden=golden, tolerance=entry.tolerance, excess=worse))
    return tuple(out)


def updated(golden: Golden, rows: Iterable[Figures], reason: str) -> Golden:
    """The golden figures with those of `rows` in their place: tolerances are kept, and reasons too where nothing changed, except
    where a figure is judged in another way than before.

    A scene that could not be scanned stays as it was: that nothing was seen is not accepted as a figure.

    Args:
        golden: as it was.  rows: the new figures, of seeds 0 to n - 1 for each scene and method.  reason: why they change.
    Raises:
        InputError: an empty reason, or seeds that do not start at 0 without gaps.
    """
    if not reason.strip():
        raise InputError("golden figures change only with a reason; give one with --reason")
    grouped: dict[tuple[str, str], list[Figures]] = {}
    for row in rows:
        grouped.setdefault((row.scene, row.method), []).append(row)
    scenes = {scene: {method: dict(entries) for method, entries in methods.items()} for scene, methods in golden.scenes.items()}
    for (scene, method), members in grouped.items():
        members.sort(key=lambda row: row.seed)
        if [row.seed for row in members] != list(range(len(members))):
            raise InputError(f"{scene}, {method}: golden figures need seeds 0 to n - 1", seeds=[row.seed for row in members])
        before = golden.entries(scene, method)
        if any(row.seconds is None for row in members):
            continue
        judged = [row.judged() for row in members]
        names = [name for name in FIGURES if any(name in figures for figures in judged)]
        new = {name: _renewed(name, method, [figures.get(name) for figures in judged], before.get(name), reason) for name in names}
        kept = {name: entry for name, entry in before.items() if name.startswith(("executed", "tracking")) and name not in new}
        scenes.setdefault(scene, {})[method] = new | kept
    return replace(golden, reason=reason.strip(), version=__version__, scenes=scenes)


def _renewed(name: str, method: str, values: list[float | None], before: Entry | None, reason: str) -> Entry:
    rounded = tuple(None if value is None else round(float(value), DIGITS) for value in values)
    if FIGURES[name].kind == "time":  # the machine's mood is no change
        rounded = tuple(None if value is None else round(value, 2) for value in rounded)
        if before is not None and before.judge == judge_of(method) and len(before.values) == len(rounded):
            old = before.values
            if all(a is not None and b is not None and b / 2 <= a <= 2 * b for a, b in zip(rounded, old, strict=True)):
                return before
    if before is None or before.judge != judge_of(method):
        return Entry(values=rounded, tolerance=FIGURES[name].tolerance, reason=reason.strip(), judge=judge_of(method))
    if before.values == rounded:
        return before
    return replace(before, values=rounded, reason=reason.strip())


def _table(value: Any, where: str) -> dict[str, Any]:
    if not isinstance(value, dict):
        raise InputError(f"{where}: is no table", where=where)
    return value


def _entry(name: str, data: dict[str, Any], where: str) -> Entry:
    if name not in FIGURES:
        raise InputError(f"{where}: unknown figure; known are {', '.join(FIGURES)}", where=where, allowed=list(FIGURES))
    values, tolerance, reason, judge = data.get("values"), data.get("tolerance"), data.get("reason"), data.get("judge", "seed")
    if not isinstance(values, list) or not values or not all(value is None or _is_number(value) for value in values):
        raise InputError(f"{where}: 'values' must be a list of numbers or null, one a seed", where=where)
    if tolerance is not None and not (_is_number(tolerance) and tolerance >= 0):
        raise InputError(f"{where}: 'tolerance' must be a number of 0 or more, or null", where=where)
    if not isinstance(reason, str) or not reason.strip():
        raise InputError(f"{where}: 'reason' must say why the figure is as it is", where=where)
    if judge not in JUDGES:
        raise InputError(f"{where}: 'judge' must be one of {', '.join(JUDGES)}", where=where, allowed=list(JUDGES))
    return Entry(values=tuple(values), tolerance=tolerance, reason=reason, judge=judge)


def _is_number(value: Any) -> bool:
    return isinstance(value, int | float) and not isinstance(value, bool) and value == value and abs(value) != float("inf")
