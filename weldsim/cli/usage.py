"""From words on the command line to a command ready to run; what tyro has to say in one line."""

import contextlib
import io
import re
from collections.abc import Callable, Sequence
from itertools import groupby

import tyro

from weldsim.cli.controller import Controller
from weldsim.cli.doctor import Doctor
from weldsim.cli.dry_run import DryRunCommand
from weldsim.cli.execute import Execute
from weldsim.cli.plan import Plan
from weldsim.cli.regress import Regress
from weldsim.cli.run import Run
from weldsim.cli.scan import Scan
from weldsim.cli.scenes import Scenes
from weldsim.errors import InputError

COMMANDS: dict[str, Callable[..., Callable[[], int]]] = {
    "plan": Plan,
    "run": Run,
    "scan": Scan,
    "dry-run": DryRunCommand,
    "execute": Execute,
    "scenes": Scenes,
    "regress": Regress,
    "controller": Controller,
    "doctor": Doctor,
}
DESCRIPTION = "Simulation-first digital twin of a vision-guided arc-welding cell. `weldsim --version` prints the version."

_FRAME = re.compile(r"[│╭╮╰╯║|]")
_RULE = re.compile(r"[─━-]{4,}")


def parse(words: Sequence[str]) -> Callable[[], int] | int:
    """The command, or 0 where help was asked for and has been printed.

    Raises:
        InputError: words that make no command; one line.
    """
    said = io.StringIO()
    try:
        with contextlib.redirect_stderr(said):
            return tyro.extras.subcommand_cli_from_dict(
                COMMANDS,
                prog="weldsim",
                description=DESCRIPTION,
                args=list(words),
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone, tyro.conf.OmitArgPrefixes),
            )
    except SystemExit as ending:
        if not ending.code:
            return 0
        raise InputError(one_line(said.getvalue(), words), words=list(words)) from None


def one_line(box: str, words: Sequence[str]) -> str:
    """What stands in the box that tyro draws: its first paragraph, its guess, and where to read more."""
    rows = [_FRAME.sub("", row).strip() for row in box.splitlines()[1:]]  # without the title
    groups = [[*group] for ruled, group in groupby(filter(None, rows), lambda row: _RULE.fullmatch(row) is not None) if not ruled]
    paragraphs = groups or [[]]
    asked = paragraphs[0][:2] if "Required options" in box else paragraphs[0]
    message = " ".join(asked).partition(" Got errors:")[0].rstrip(".:") or "these words make no command"
    message = re.sub(r"'None', ", "", message)
    guesses = [" ".join(rows[1:2]) for rows in paragraphs[1:] if rows and rows[0].startswith("Perhaps")]
    hint = f"; perhaps {guesses[0]}" if guesses else ""
    name = next((word for word in words[:1] if word in COMMANDS), "")
    return " ".join(f"{message[:1].lower()}{message[1:]}{hint}; see weldsim {name} --help".split())
