#!/usr/bin/env python
"""Tests the tests: small faults are put into weldsim one at a time, and those that no test notices are printed.

mutmut makes the faults (mutants) and runs the narrow tests named in GROUPS in a copy of this checkout; the checkout stays as
it is. Of a module with many, SAMPLE are tried, drawn by a seed. Not tried are faults in prose (messages, in which tests look
for the figure, not for every word). Survivors that change nothing anybody could see are kept in scripts/mutants.toml with the
reason. It takes one processor a minute (frames) to a quarter of an hour (gate) a group; nothing is installed:

    .venv/bin/pip install mutmut==3.8.1    # once; it is not in requirements.lock, as no target of make needs it
    .venv/bin/python scripts/mutants.py path gate

Exit code 0 when nothing unexplained survives, 1 when something does, 2 when it cannot run.
"""

import argparse
import importlib.util
import json
import os
import random
import re
import shutil
import subprocess
import sys
import tempfile
import tomllib
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

ROOT = Path(__file__).resolve().parents[1]
EXPLAINED = ROOT / "scripts" / "mutants.toml"
RECORD = ROOT / "experiments" / "results" / "mutants.json"
COPIED = ("weldsim", "tests", "assets", "scenes", "experiments", "scripts", "CONVENTIONS.md", "README.md", "CHANGELOG.md")
SAMPLE = 60  # mutants of one module that are tried
SURVIVED = (0, 5, 33)  # mutmut's exit codes: all tests pass, or there is none of it
OUT_OF_TIME = (36, -24, 24, 152, 255)  # an endless loop, or a busy machine

GROUPS: dict[str, tuple[list[str], list[str]]] = {
    # modules below weldsim/, tests below tests/
    "path": (["path/*"], ["unit/path", "conventions/test_seam.py"]),
    "report": (
        [f"report/{name}" for name in ("limits", "metrics", "tracking", "view", "weld")],
        ["unit/report", "unit/path/test_ring.py", "property/test_metrics.py"],
    ),
    "records": (
        ["records/*"],
        ["unit/test_records.py", "unit/test_inputs.py", "unit/test_lens.py", "unit/cloud/test_camera_files.py"],
    ),
    "frames": (
        ["frames"],
        ["property/test_frames.py", "conventions/test_frames.py", "conventions/test_rotations.py", "unit/test_frames.py"],
    ),
    "kinematics": (["kinematics"], ["unit/test_kinematics.py", "unit/test_arm.py"]),
    "gate": (["execution/gate"], [f"unit/execution/{name}.py" for name in ("test_gate", "test_gate_told", "test_gate_kept")]),
    "ends": (["seam/profile/ends"], ["unit/seam/test_ends.py"]),
    "window": (["seam/profile/window"], ["unit/seam/test_window.py"]),
    "arm": (["motion/arm"], ["unit/motion/test_arm.py"]),
}
NOT_RUN = {  # tests left out, by parts of their names: they try execution/limits through the gate, or take long
    "records": "advice_for or names_are_where or camera_that_there or no_path_is or one_seam_of or fold_the_image",
    "gate": "0.002 or at_its_limit or workspace or joint_position or torch_speed or trails or whole_trajectory or keeps_to_every"
    " or test_stale_state or own_kinematics or black_box_keeps or begins_anew",
}
STRICT = ("strict=None", "strict=False", "")


@dataclass(frozen=True)
class Mutant:
    """A fault: its function, the lines taken out and put in, and mutmut's name for it."""

    name: str
    function: str
    was: str
    becomes: str

    @property
    def prose(self) -> bool:
        """Whether it changes a text of several words alone, as mutmut does: XX at its ends, all small or all capital."""
        if self.was.lower() == self.becomes.lower() or self.becomes.replace("XX", "") == self.was:
            texts = [re.findall(r'"[^"]*"', text) for text in (self.was, self.becomes)]
            return all(" " in a for a, b in zip(*texts, strict=False) if a != b)
        return False

    @property
    def harmless(self) -> str | None:
        """Why it changes nothing wherever it is made; None of most."""
        if "einsum" in self.was and self.was.lower() == self.becomes.lower():
            return "subscripts of einsum in capitals name the same axes"
        if "strict=True" in self.was and self.becomes in (self.was.replace("strict=True", other) for other in STRICT):
            return "what is zipped is of one length; strict says so"
        if "json.dumps" in self.was and re.sub(r"(ensure_ascii|allow_nan)=None", r"\1=False", self.becomes) == self.was:
            return "None is no for json, as False is"
        if self.becomes == self.was.replace('float("nan")', 'float("NAN")') != self.was:
            return "no number in capitals is no number"
        return None


@dataclass
class Tally:
    """What became of a group's mutants: `slow` ran out of time, `explained` are (mutant, reason)."""

    made: int = 0
    tried: int = 0
    noticed: int = 0
    slow: list[Mutant] = field(default_factory=list)
    explained: list[tuple[Mutant, str]] = field(default_factory=list)
    survived: list[Mutant] = field(default_factory=list)


def configuration(group: str) -> str:
    """The pyproject.toml of the copy in which a group's mutants are tried."""
    modules, tests = GROUPS[group]
    quoted = {
        name: json.dumps(values)
        for name, values in (
            ("only_mutate", [f"weldsim/{module}.py" for module in modules]),
            ("also_copy", [name for name in COPIED if name not in ("weldsim", "tests")]),
            ("pytest_add_cli_args_test_selection", [f"tests/{test}" for test in tests]),
            ("pytest_add_cli_args", ["-k", f"not ({NOT_RUN[group]})"] if group in NOT_RUN else []),
        )
    }
    own = (ROOT / "pyproject.toml").read_text()
    pytest_part = own[own.index("[tool.pytest.ini_options]") : own.index("[tool.importlinter]")]
    lines = [f"{name} = {value}" for name, value in quoted.items()]
    return "\n".join(
        [
            pytest_part,
            "[tool.mutmut]",
            'source_paths = ["weldsim"]',
            "use_git_change_detection = false",
            "track_dependencies = false",
            "timeout_constant = 5.0",
            *lines,
            "",
        ]
    )


def mutmut(folder: Path, *words: str) -> str:
    """What mutmut had to say, run in the copy."""
    environment = {**os.environ, "OPENBLAS_NUM_THREADS": "1"}
    environment.pop("PYTHONPATH", None)  # the copy's own weldsim is meant
    environment.setdefault("MUJOCO_GL", "egl")
    command = [str(Path(sys.executable).with_name("mutmut")), *words]
    done = subprocess.run(command, cwd=folder, env=environment, capture_output=True, text=True, check=False)
    return done.stdout + done.stderr


def exit_codes(folder: Path) -> dict[str, dict[str, int | None]]:
    """Of each module of the copy, what became of every mutant; None of those not tried."""
    files = sorted((folder / "mutants").rglob("*.meta"))
    return {
        str(file.relative_to(folder / "mutants"))[: -len(".meta")]: json.loads(file.read_text())["exit_code_by_key"]
        for file in files
    }


def read_mutants(folder: Path, names: dict[str, str]) -> Iterator[Mutant]:
    """The mutants of some names, each with its module's path, as the copy has them."""
    script = (
        "import json, sys\n"
        "from mutmut.mutation.diff_apply import get_diff_for_mutant\n"
        "names = json.load(sys.stdin)\n"
        "print(json.dumps({name: get_diff_for_mutant(name, path=path) for name, path in names.items()}))"
    )
    command = [sys.executable, "-c", script]
    done = subprocess.run(command, cwd=folder, input=json.dumps(names), capture_output=True, text=True, check=True)
    for name, diff in json.loads(done.stdout).items():
        lines = diff.splitlines()[2:]
        was, becomes = ("\n".join(line[1:].strip() for line in lines if line.startswith(sign)) for sign in "-+")
        yield Mutant(name, function_of(name), was, becomes)


def function_of(name: str) -> str:
    """The function below weldsim that a mutant is of, by mutmut's name."""
    function = re.sub(r"__mutmut_\d+$", "", name).replace("xǁ", "").replace("ǁ", ".").replace(".x_", ".")
    return function.removeprefix("weldsim.")


def drawn(folder: Path, most: int, seed: int) -> list[Mutant]:
    """At most so many mutants of each module, drawn by the seed, none of them prose."""
    out: list[Mutant] = []
    for module, codes in exit_codes(folder).items():
        names = sorted(codes)
        random.Random(f"{seed} {module}").shuffle(names)
        out += [mutant for mutant in read_mutants(folder, dict.fromkeys(names[: 3 * most], module)) if not mutant.prose][:most]
    return out


def survivors(folder: Path, group: str) -> list[Mutant]:
    """The mutants that survived or ran out of time when the group was recorded last, as far as they can still be made."""
    last = json.loads(RECORD.read_text())[group]
    wanted = last["survived"] + last["slow"]
    functions = {entry["function"] for entry in wanted}
    out: list[Mutant] = []
    for module, codes in exit_codes(folder).items():
        names = [name for name in codes if function_of(name) in functions]
        out += [mutant for mutant in read_mutants(folder, dict.fromkeys(names, module)) if told(mutant) in wanted]
    return out


def reason(mutant: Mutant, explained: list[dict[str, str]]) -> str | None:
    """Why a survivor changes nothing that matters; None where nobody has said so."""
    if mutant.harmless:
        return mutant.harmless
    for entry in explained:
        if all(entry[key] == getattr(mutant, key) for key in ("function", "was", "becomes")):
            return entry["reason"]
    return None


def try_group(group: str, folder: Path, choose: Callable[[Path], list[Mutant]]) -> Tally:
    """A group's mutants, made in an empty folder, and those of them tried that `choose` picks there."""
    for name in COPIED:
        source = ROOT / name
        copy = shutil.copytree if source.is_dir() else shutil.copy
        copy(source, folder / name)
    (folder / "pyproject.toml").write_text(configuration(group))
    said = mutmut(folder, "run", "--max-children", "1", "none of them")  # makes the mutants and times the tests
    made = {name: code for codes in exit_codes(folder).values() for name, code in codes.items()}
    chosen = choose(folder)
    if not made:
        sys.exit(f"mutants: {group}: no mutants were made; mutmut says:\n{said[-2000:]}")
    if not chosen:
        return Tally(made=len(made))
    said = mutmut(folder, "run", "--max-children", "1", *(mutant.name for mutant in chosen))
    codes = {name: code for codes in exit_codes(folder).values() for name, code in codes.items()}
    explained = tomllib.loads(EXPLAINED.read_text())["mutant"]
    tally = Tally(made=len(made), tried=len(chosen))
    for mutant in chosen:
        code = codes[mutant.name]
        if code is None:
            sys.exit(f"mutants: {group}: {mutant.name} was not tried; mutmut says:\n{said[-2000:]}")
        if code in OUT_OF_TIME:
            tally.slow.append(mutant)
        elif code not in SURVIVED:
            tally.noticed += 1
        elif why := reason(mutant, explained):
            tally.explained.append((mutant, why))
        else:
            tally.survived.append(mutant)
    return tally


def recorded(group: str, tally: Tally, again: bool) -> dict[str, Any]:
    """All records with a group's new one; `again`: with what has become of its survivors, the others as they were."""
    out: dict[str, Any] = json.loads(RECORD.read_text()) if RECORD.exists() else {}
    before = out[group] if again else {"tried": tally.tried, "noticed": 0, "explained": []}
    out[group] = {
        "made": tally.made,
        "tried": before["tried"],
        "noticed": before["noticed"] + tally.noticed,
        "slow": [told(mutant) for mutant in tally.slow],
        "explained": before["explained"] + [{**told(mutant), "reason": why} for mutant, why in tally.explained],
        "survived": [told(mutant) for mutant in tally.survived],
    }
    return dict(sorted(out.items()))


def page(record: dict[str, Any]) -> str:
    """The record to read: a table, and what survived with its reason."""
    lines = [
        "# Faults that tests notice",
        "",
        "Written by `scripts/mutants.py --record`: small faults put into weldsim one at a time, and what the tests made of them.",
        "",
        "| modules | faults made | tried | noticed | out of time | survived, with a reason | survived |",
        "|---|---|---|---|---|---|---|",
    ]
    for group, tally in record.items():
        figures = [tally["made"], tally["tried"], tally["noticed"], *(len(tally[key]) for key in ("slow", "explained", "survived"))]
        lines.append(f"| {group} | " + " | ".join(map(str, figures)) + " |")
    titles = {"survived": "Survivors", "slow": "Out of time", "explained": "Survivors that change nothing which matters"}
    for key, title in titles.items():
        lines += ["", f"## {title}", ""]
        for tally in record.values():
            for mutant in tally[key]:
                change = " -> ".join(f"`{' '.join(mutant[part].split()) or '(nothing)'}`" for part in ("was", "becomes"))
                lines.append(f"* {mutant['function']}: {change}" + (f": {mutant['reason']}" if "reason" in mutant else ""))
    return "\n".join(lines).rstrip() + "\n"


def told(mutant: Mutant) -> dict[str, str]:
    return {"function": mutant.function, "was": mutant.was, "becomes": mutant.becomes}


def main() -> int:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("groups", nargs="*", metavar="GROUP", help=f"of {', '.join(GROUPS)}; all of them where none is named")
    parser.add_argument("--sample", type=int, default=SAMPLE, help="mutants tried of each module, at most")
    parser.add_argument("--seed", type=int, default=0, help="draws them")
    parser.add_argument("--again", action="store_true", help="try those alone that survived when it was recorded last")
    parser.add_argument("--record", action="store_true", help=f"write the result to {RECORD.relative_to(ROOT)} and .md beside it")
    given = parser.parse_args()
    unknown = [group for group in given.groups if group not in GROUPS]
    if unknown:
        parser.error(f"no group {unknown[0]!r}; there are {', '.join(GROUPS)}")
    if importlib.util.find_spec("mutmut") is None:
        parser.error(f"mutmut is missing: {sys.executable} -m pip install mutmut==3.8.1")
    unexplained = 0
    for group in given.groups or GROUPS:
        with tempfile.TemporaryDirectory(prefix="weldsim-mutants-") as folder:

            def choose(folder: Path, group: str = group) -> list[Mutant]:
                return survivors(folder, group) if given.again else drawn(folder, given.sample, given.seed)

            tally = try_group(group, Path(folder), choose)
        unexplained += len(tally.survived)
        print(
            f"{group}: {tally.tried} of {tally.made} tried, {tally.noticed} noticed, {len(tally.slow)} out of time,"
            f" {len(tally.explained)} explained",
            flush=True,
        )
        for mutant in tally.survived:
            print(f"  survived in {mutant.function}\n    - {mutant.was}\n    + {mutant.becomes}", flush=True)
        if given.record:
            record = recorded(group, tally, given.again)
            RECORD.write_text(json.dumps(record, indent=1, ensure_ascii=False) + "\n")
            RECORD.with_suffix(".md").write_text(page(record))
    return 1 if unexplained else 0


if __name__ == "__main__":
    sys.exit(main())
