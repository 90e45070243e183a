"""From words on the command line to a command ready to run; what tyro has to say in one line, and what was meant."""

import contextlib
import io
import re
import shlex
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass, fields
from importlib import import_module
from itertools import groupby, pairwise, takewhile
from typing import Any, Literal, get_args, get_origin

import tyro

from weldsim import units
from weldsim.cli.meant import MEANT_CHOICES, MEANT_COMMANDS, MEANT_OPTIONS, SUFFIXES
from weldsim.cli.quantities import QuantitySpec, gathered
from weldsim.errors import InputError, WeldsimError
from weldsim.settings import nearest

Command = Callable[[], int]


@dataclass(frozen=True)
class Entry:
    """A command before it is loaded. Attributes: module and name of its class; about, the first sentence of its help."""

    module: str
    name: str
    about: str

    def load(self) -> Any:
        """The class."""
        return getattr(import_module(f"weldsim.cli.{self.module}"), self.name)


COMMANDS: dict[str, Entry] = {
    "plan": Entry("plan", "Plan", "Find the groove in a scan and plan the torch path along it."),
    "run": Entry("run", "Run", "Scan, plan and weld a workpiece in the twin, and judge the weld against the true seam."),
    "scan": Entry("scan", "Scan", "Let the twin scan a scene, and write what the camera saw as `weldsim plan` reads it."),
    "dry-run": Entry(
        "dry_run",
        "DryRunCommand",
        "Check a path or robot program before anything moves: a verdict per waypoint, what would help, cycle time.",
    ),
    "execute": Entry("execute", "Execute", "Weld a path with a robot, the twin's or a real one, through the safety gate."),
    "scenes": Entry(
        "scenes",
        "Scenes",
        "List the scenes that come with weldsim, draw one, `weldsim scenes show curve`, or export one as plain MJCF.",
    ),
    "config": Entry("settings", "Config", "Show every setting with its value, its unit and where the value comes from."),
    "regress": Entry(
        "regress", "Regress", "Hold every scene's figures against recorded ones, and say which are worse, where and by how much."
    ),
    "controller": Entry(
        "controller",
        "Controller",
        "Serve a virtual UR5 controller: dashboard 29999, scripts 30001 to 30003, RTDE 30004. Ends with Ctrl-C.",
    ),
    "doctor": Entry(
        "doctor",
        "Doctor",
        "Try every library, the rendering back end and write access, and say what to install where something fails.",
    ),
}
DESCRIPTION = "Simulation-first digital twin of a vision-guided arc-welding cell. `weldsim --version` prints the version."
HELP = ("-h", "--help")
LISTS = ("--scenes", "--methods")  # options of several values

_CHOICE = re.compile(r"invalid choice '(.*)' for argument '(.*)'\. Expected one of \((.*)\)")
_NUMBER = re.compile(r"error parsing (\S+): .*(?:int\(\)|float|INT|FLOAT).*(?:: '|\[')(.*)'")
_MISSING = re.compile(r"missing value for argument '(\S+)'\. Expected (\d+) values")
_VALUE = re.compile(r"=?\s*([-+]?\.?\d[\w.+-]*|true|false)\s*(\S*)")
_FRAME = re.compile(r"[│╭╮╰╯║|]")
_RULE = re.compile(r"[─━-]{4,}")


def parse(words: Sequence[str]) -> Command | int:
    """The command, or 0 where help was asked for and has been printed.

    Raises:
        InputError: words that make no command; one line.
    """
    if words and words[0] == "help":
        words = [*words[1:], "--help"]
    if words and words[0] in HELP:
        print(overview(), end="")
        return 0
    name = words[0] if words else ""
    if name not in COMMANDS:
        raise InputError(f"{_no_command(words)}; see weldsim --help", words=list(words))
    command, said = COMMANDS[name].load(), io.StringIO()
    _refuse_empty(name, words[1:])
    _refuse_bare(name, words[1:])
    words = [name, *gathered(words[1:], _quantities(command))]
    _check_options(name, command, words[1:])
    try:
        with contextlib.redirect_stderr(said):
            return tyro.cli(
                command,
                prog=f"weldsim {name}",
                args=list(words[1:]),
                config=(tyro.conf.FlagCreatePairsOff, tyro.conf.DisallowNone, tyro.conf.OmitArgPrefixes),
            )
    except SystemExit as ending:
        if not ending.code:
            return 0
        raise InputError(one_line(said.getvalue(), words), words=list(words)) from None


def _refuse_empty(name: str, words: Sequence[str]) -> None:
    """Raises InputError for a word without content, as a shell's variable that is not set leaves it."""
    for before, word in pairwise(["", *words]):
        option, equals, value = word.partition("=")
        if not word.strip() or (equals and option.startswith("--") and not value.strip()):
            where = option if equals else before if before.startswith("-") else ""
            what = f"{where}: its value is empty" if where else "an argument is empty"
            raise InputError(f"{what}; see weldsim {name} --help", words=[name, *words])


def _refuse_bare(name: str, words: Sequence[str]) -> None:
    """Raises InputError for an option of several values that is given none: all there are would be taken, as without it."""
    for word, after in pairwise([*words, "--"]):
        if word in LISTS and after.startswith("-"):
            raise InputError(f"{word}: its values are missing; see weldsim {name} --help", words=[name, *words])


def overview() -> str:
    """What `weldsim --help` prints."""
    width = max(map(len, COMMANDS))
    rows = [f"  {name.ljust(width)}  {entry.about}" for name, entry in COMMANDS.items()]
    return "\n".join(["usage: weldsim COMMAND ...", "", DESCRIPTION, "", *rows, "", "`weldsim COMMAND --help` tells more.", ""])


def one_line(box: str, words: Sequence[str]) -> str:
    """What stands in the box that tyro draws: its first paragraph, what was meant, and where to read more."""
    rows = [_FRAME.sub("", row).strip() for row in box.splitlines()[1:]]  # without the title
    groups = [[*group] for ruled, group in groupby(filter(None, rows), lambda row: _RULE.fullmatch(row) is not None) if not ruled]
    paragraphs = groups or [[]]
    asked = paragraphs[0][:2] if "Required options" in box else paragraphs[0]
    message = " ".join(asked).partition(" Got errors:")[0].rstrip(".:") or "these words make no command"
    message = re.sub(r"'None', |, 'None'", "", message)
    name = next((word for word in words[:1] if word in COMMANDS), "")
    message = _said_better(f"{message[:1].lower()}{message[1:]}", name, words)
    return " ".join(f"{message}; see weldsim {name} --help".split())


def _said_better(message: str, name: str, words: Sequence[str]) -> str:
    """tyro's message with what was meant, where that can be told."""
    from weldsim.controller.fault_names import FaultName

    if match := _CHOICE.match(message):
        wrong, where, choices = match[1], match[2], re.findall(r"'([^']*)'", match[3])
        # tyro shuffles those that may be left out
        choices = [one for one in (*get_args(FaultName), *_choices(name, where)) if one in choices] or choices
        meant = _action_meant(name, wrong, words) if where == "action" else _choice_meant(where.lstrip("-"), wrong, choices)
        return f"{where} {wrong!r} is not one of {', '.join(choices)}{f'; did you mean {meant}?' if meant else ''}"
    if match := _NUMBER.match(message):
        if match[1] == "--seam" and name in ("run", "plan"):
            return f"--seam {match[2]!r} is neither a whole number nor all"
        if match[1] == "--seam" and match[2] == "all":
            return f"--seam all: weldsim {name} welds one seam of a file at a time; give its number, 1 first"
        whole = "whole " if "int()" in message or "INT" in message else ""
        return f"{match[1]} {match[2]!r} is no {whole}number"
    if match := _MISSING.match(message):
        wanted, given = int(match[2]), _values_after(match[1], words)
        if wanted == 1 or not given:
            return f"{match[1]}: {'its value is' if wanted == 1 else f'its {wanted} values are'} missing"
        return f"{match[1]} {' '.join(given)}: {len(given)} given, {wanted} needed"
    if message.startswith("unrecognized options: "):
        extra = message.removeprefix("unrecognized options: ").split(", ")
        setting = next((one for one, after in pairwise(words) if "=" in one and after == extra[0]), None)
        hint = f'; did you mean "{setting} {extra[0]}", in quotes?' if setting is not None else ""
        return f"{' '.join(extra)}: {'one word' if len(extra) == 1 else f'{len(extra)} words'} too many{hint}"
    return message


def _choices(name: str, option: str) -> list[str]:
    """What an option of a command may be, in the order in which help names it."""
    known = fields(COMMANDS[name].load()) if name in COMMANDS else ()
    hints = [one.type for one in known if f"--{_name(one)}" == option]
    return [str(choice) for hint in hints for choice in _literals(hint)]


def _literals(hint: Any) -> list[Any]:
    """All choices of a type, in order."""
    if get_origin(hint) is Literal:
        return list(get_args(hint))
    return [choice for part in get_args(hint) for choice in _literals(part)]


def _choice_meant(option: str, wrong: str, choices: Sequence[str]) -> str:
    """Which of the choices is meant, in whatever case or by another name; "" where none is near."""
    word = wrong.lower()
    known = MEANT_CHOICES.get(option, {}).get(word) or (units.known_unit(word, "m") if option == "units" else "")
    return known if known in choices else nearest(word, choices)


def _check_setting(name: str, words: Sequence[str]) -> None:
    """Raises InputError for a setting in several words, `key = value` or `key value`, with the one that is meant.

    Args:
        words: behind `--set`.
    """
    key, rest = words[0], " ".join(takewhile(lambda word: not word.startswith("--"), words[1:4]))
    match = _VALUE.match(rest)
    if match is None or key.startswith("--") or ("=" in key and not key.endswith("=")):
        return
    unit = match[2] if units.is_unit(match[2]) else ""
    setting = f"{key.rstrip('= ')}={match[1]} {unit}".rstrip()
    said = f"--set {key} {match[0].strip() if unit else match[0].removesuffix(match[2]).strip()}"
    raise InputError(f"{said}: did you mean --set {shlex.quote(setting)}?; see weldsim {name} --help", words=[*words[:2]])


def _check_option_set(name: str, command: Any, text: str, others: Sequence[str]) -> None:
    """Raises InputError for an option that is given as a setting, `--set sensor=d435`, with the words that are meant.

    Args:
        text: behind `--set`.  others: the other words behind the command.
    """
    key, equals, value = (part.strip() for part in text.partition("="))
    option = key.lower().replace("_", "-")
    if not equals or "." in key or option == "set":
        return
    said, known, positional = f"--set {shlex.quote(text)}", _options(command), _options(command, positional=True)
    if option in positional and _command_for(value) == name:
        raise InputError(f"{said}: {option} goes without --set; did you mean weldsim {name} {value}?", words=[text])
    for one in [option] if option in known else [one for one in MEANT_OPTIONS.get(option, ()) if one in known]:
        for meant in ([f"--{one}", value], [f"--{one}"] if value.lower() in ("true", "yes", "on") else []):
            if meant and _makes_command(name, [*_without_settings(others), *meant]):
                raise InputError(f"{said}: did you mean {shlex.join(meant)}?; see weldsim {name} --help", words=[text])

    if option not in known and (homes := [one for one, entry in COMMANDS.items() if option in _options(entry.load())]):
        from weldsim.config import CellConfig, keys, meant_keys

        tables = {one.partition(".")[0] for one in keys(CellConfig)}
        of_option = any(value in _choices(home, f"--{option}") for home in homes)
        if of_option or (key not in tables and not meant_keys(key, keys(CellConfig))):
            have = f"weldsim {' and '.join(homes)} {'has' if len(homes) == 1 else 'have'} an option --{option}"
            raise InputError(f"{said}: it is no setting; {have}", words=[text])


def _without_settings(words: Sequence[str]) -> list[str]:
    """The words without every `--set` and what it sets."""
    return [word for before, word in zip(["", *words], words, strict=False) if "--set" not in (before, word)]


def _makes_command(name: str, words: Sequence[str]) -> bool:
    """Whether words make this command."""
    try:
        return callable(parse([name, *words]))
    except InputError:
        return False


def _settings_meant(command: Any, option: str, words: Sequence[str]) -> list[str]:
    """The settings of which an unknown option has the name, each as one would give it.

    Args:
        words: the option, and those behind it.
    """
    from weldsim.config import SCENE, CellConfig, keys, meant_keys
    from weldsim.scene.config import SceneConfig

    if "set" not in _options(command):
        return []
    known = [key for key in keys(CellConfig) if key.partition(".")[0] in command.reads]
    if "scene" in _options(command, positional=True):
        known += [SCENE + key for key in keys(SceneConfig)]
    key = option.replace("-", "_")
    found = [one for one in meant_keys(key, known) if f".{one}".endswith(f".{key}")]
    _, equals, first = words[0].partition("=")
    behind = list(words[1:]) if not equals else [first, *words[1:]]
    value = [word for word in behind[:1] if not re.match(r"--?[A-Za-z]", word)]
    value += [word for word in behind[1:2] if value and units.is_unit(word)]
    given = " ".join(value) or "VALUE"
    settings = [f"{one}={given}" for one in found]
    return [f"--set {shlex.quote(text if _is_read(text) else f'{one}=VALUE')}" for one, text in zip(found, settings, strict=True)]


def _is_read(setting: str) -> bool:
    """Whether a setting of the cell, or of a scene, may have the value it is given."""
    from weldsim.config import SCENE, load_config, load_scene

    try:
        load_scene("straight", [setting.removeprefix(SCENE)]) if setting.startswith(SCENE) else load_config(None, [setting])
    except WeldsimError:
        return False
    return True


def _values_after(option: str, words: Sequence[str]) -> list[str]:
    """The words behind an option, up to the next one."""
    behind = words[words.index(option) + 1 :] if option in words else []
    return [*takewhile(lambda word: not re.match(r"--?[A-Za-z]", word), behind)]


def _action_meant(name: str, wrong: str, words: Sequence[str]) -> str:
    """Which action of `weldsim scenes` or `controller` is meant, with what it is for."""
    from weldsim.controller.fault_names import FaultName
    from weldsim.scene.files import scene_names

    if name == "controller":
        fault = nearest(wrong, get_args(FaultName))
        return f"weldsim controller fault {fault}" if fault else nearest(wrong, ("serve", "fault", "status"))
    if wrong in scene_names() or wrong.endswith(".toml"):
        return f"weldsim scenes show {wrong}"
    meant = {"display": "show", "draw": "show", "view": "show", "picture": "show", "mjcf": "export", "save": "export"}
    action = meant.get(wrong) or nearest(wrong, ("list", "show", "export"))
    return f"weldsim scenes {' '.join(action if word == wrong else word for word in words[1:])}" if action else ""


def _no_command(words: Sequence[str]) -> str:
    """What to say where the first word is no command."""
    if not words:
        return f"a command is missing: expected one of {', '.join(COMMANDS)}"
    name, rest = words[0], list(words[1:])
    later = next((word for word in rest if word in COMMANDS), "")
    if name.startswith("-") and later:
        rest.remove(later)
        return f"{name} stands before the command; did you mean {_command(later, [*rest, name])}?"
    if own := _command_for(name):
        kind = "a scene" if own == "run" else "a file"
        return f"{name!r} is {kind}, no command; did you mean {_command(own, words)}?"
    word = name.lower().replace("_", "-").lstrip("-")
    meant = MEANT_COMMANDS.get(word) or next(filter(None, [nearest(word, COMMANDS)]), "")
    if meant in ("run", "execute", "plan", "dry-run"):  # what stands behind it says which it can be
        meant = next(filter(None, map(_command_for, rest)), meant) if meant != "dry-run" else meant
        if meant == "dry-run" and word in ("weld", "robot", "send", "play"):
            meant = "execute"
    guess = f"; did you mean {_command(meant, rest)}?" if meant else f": expected one of {', '.join(COMMANDS)}"
    return f"{name!r} is no command{guess}"


def _command(name: str, words: Sequence[str]) -> str:
    """The command as one would type it."""
    if name == "scenes" and words and not words[0].startswith("-"):
        return _action_meant("scenes", words[0], ["scenes", *words]) or f"weldsim {name}"
    needed = ["--robot", "sim"] if name == "execute" and "--robot" not in words else []
    return " ".join(["weldsim", name, shlex.join([*words, *needed])]).rstrip()


def _command_for(word: str) -> str:
    """The command for a scene, a cloud, or a path or program; "" for any other word."""
    from weldsim.scene.files import scene_names

    if word in scene_names():
        return "run"
    return next((name for name, suffixes in SUFFIXES.items() if word.lower().endswith(suffixes)), "")


def _check_options(name: str, command: Any, words: Sequence[str]) -> None:
    """Raises InputError for an option that the command does not have; one line that names the one meant."""
    known, positional, short = _options(command), _options(command, positional=True), _short(command)
    lists, given = _lists(command), set()
    for index, word in enumerate(words):
        if word == "--":
            return
        option = word.lstrip("-").partition("=")[0].replace("_", "-")
        if word == "--set" and words[index + 1 :]:
            _check_setting(name, words[index + 1 :])
            _check_option_set(name, command, words[index + 1], [*words[:index], *words[index + 2 :]])
        if word.startswith("--set="):
            _check_option_set(name, command, word.removeprefix("--set="), [*words[:index], *words[index + 1 :]])
        if word.startswith("--") and option in lists:
            if option in given:  # the last would silently take the place of the others
                raise InputError(f"--{option} is given twice; give its values together: --{option} A B", words=[word])
            given.add(option)
        if not word.startswith("-") or not option[:1].isalpha() or (word.startswith("--") and option in {*known, "help"}):
            continue
        if (not word.startswith("--") and word in short) or " " in word:
            continue
        if option in positional:
            value = words[index + 1 : index + 2]
            hint = f"it goes without one: weldsim {name} {' '.join(value) or option.upper()}"
            raise InputError(f"weldsim {name}: {option} is no option; {hint}; see weldsim {name} --help", words=[word])
        guess = [f"--{one}" for one in _named_options(option, known)]
        others = [] if guess else [other for other, entry in COMMANDS.items() if option in _options(entry.load())]
        guess = guess or _settings_meant(command, option, words[index:])
        guess = guess or [f"--{one}" for one in filter(None, [nearest(option, sorted(known))]) if not others]
        hint = f"; did you mean {' or '.join(guess)}?" if guess else ""
        hint += f"; weldsim {' and '.join(others)} {'has' if len(others) == 1 else 'have'}" if others else ""
        raise InputError(f"weldsim {name} has no option {word.partition('=')[0]}{hint}; see weldsim {name} --help", words=[word])


def _named_options(option: str, known: Iterable[str]) -> list[str]:
    """Which of the known options is meant by another name for it."""
    known = sorted(known)
    if found := [one for one in MEANT_OPTIONS.get(option, ()) if one in known]:
        return found
    return [one for one in known if one in (f"{option}s", option.removesuffix("s"))]


def _options(command: Any, *, positional: bool = False) -> set[str]:
    """Names of the options of a command, or of what it takes without a name."""
    return {_name(one) for one in fields(command) if (tyro.conf.Positional in _marks(one.type)) is positional}


def _lists(command: Any) -> set[str]:
    """Names of the options that take several words at once."""
    alone = {tyro.conf.UseAppendAction, tyro.conf.Positional}
    plain = {_name(one): getattr(one.type, "__origin__", None) for one in fields(command) if not alone & set(_marks(one.type))}
    return {name for name, origin in plain.items() if origin is tuple or get_origin(origin) is tuple}


def _quantities(command: Any) -> dict[str, QuantitySpec]:
    """The options of a command that take quantities."""
    marks = {f"--{_name(one)}": _marks(one.type) for one in fields(command)}
    return {name: mark for name, own in marks.items() for mark in own if isinstance(mark, QuantitySpec)}


def _name(field: Any) -> str:
    """What an option is called on the command line."""
    own = next((mark.name for mark in _marks(field.type) if getattr(mark, "name", None)), field.name)
    return own.replace("_", "-")


def _short(command: Any) -> set[str]:
    """Options of one letter."""
    return {
        "-h",
        *(alias for one in fields(command) for mark in _marks(one.type) for alias in getattr(mark, "aliases", None) or ()),
    }


def _marks(hint: Any) -> tuple[Any, ...]:
    """What a type is annotated with."""
    return getattr(hint, "__metadata__", ())
