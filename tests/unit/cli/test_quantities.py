"""A number without its unit that can hardly be SI is asked back, on every option; what is proposed is taken."""

import math
import re
import shlex

import pytest

from weldsim.cli import main
from weldsim.cli.quantities import (
    ALONG,
    COUNT,
    JOINTS,
    LEANED,
    MOVED,
    PACE,
    POINT,
    SHARE,
    SPELL,
    TURNED,
    WELD_SPEED,
    Quantity,
    listed,
    several,
)
from weldsim.cli.usage import parse
from weldsim.errors import InputError

KINDS = (ALONG, COUNT, JOINTS, LEANED, MOVED, PACE, POINT, SHARE, SPELL, TURNED, WELD_SPEED)

ASKED_BACK = [
    "dry-run a.csv --turn 15",
    "dry-run a.csv --turn -15",
    "dry-run a.csv --turn 1",
    "dry-run a.csv --turn=90",
    'dry-run a.csv --lean "15, 0"',
    'dry-run a.csv --lean "0, -5"',
    "dry-run a.csv --speed 5",
    "dry-run a.csv --speed 0.5",
    'dry-run a.csv --move "20, 30"',
    'dry-run a.csv --move "0, 300"',
    'dry-run a.csv --move "1, 0"',
    'dry-run a.csv --start "-90, -75, -109, -86, 90, 0"',
    "plan a.ply --viewpoint 0 -750 750",
    "plan a.ply --viewpoint 0 -75 75",
    "plan a.ply --near 20 -450 0",
    "plan a.png --intrinsics a.json --depth-unit 1",
    "plan a.png --intrinsics a.json --depth-unit 0.1",
    "run straight --near 20 -450 0",
    "execute a.json --robot sim --speed-scale 50",
]


@pytest.mark.parametrize("line", ASKED_BACK)
def test_what_must_have_been_millimetres_or_degrees_is_asked_back_and_the_answer_is_taken(line, capsys):
    """The proposal is put in the place of the bare number, until nothing is asked any more."""
    words = shlex.split(line)
    for _ in range(7):
        code, said = refused(words, capsys)
        if not code:
            break
        assert (code, said.count("\n")) == (2, 1)
        option = next(
            word.partition("=")[0] for word in words if word.startswith("--") and f"weldsim: {word.partition('=')[0]} " in said
        )
        match = re.search(r'"?([^";]*)"? is meant\?', said)
        assert match, said
        words = answered(words, option, match[1].strip())
    else:
        pytest.fail(f"still asked: {words}")
    assert words != shlex.split(line)


def refused(words: list[str], capsys: pytest.CaptureFixture) -> tuple[int, str]:
    """Exit code and line where words are refused, (0, "") where they make a command."""
    try:
        parse(words)
    except InputError:
        return main(words), capsys.readouterr().err
    return 0, ""


def answered(words: list[str], option: str, meant: str) -> list[str]:
    """The words with the proposal in place of the first number of `option` that equals its number."""
    bare = meant.split(" ")[0]
    out = list(words)
    for i, word in enumerate(words):
        if word == f"{option}={bare}":
            out[i] = f"{option}={meant}"
            return out
        if word == option:
            for k in range(i + 1, len(words)):
                parts = [part.strip() for part in words[k].split(",")]
                if bare in parts:
                    parts[parts.index(bare)] = meant
                    out[k] = ", ".join(parts)
                    return out
            out[i + 1] = meant  # 50 for 0.5
            return out
    return out


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ('dry-run a.csv --turn "-15 deg"', "turn", math.radians(-15)),
        ("dry-run a.csv --turn 0.2", "turn", 0.2),
        ('dry-run a.csv --turn "3 rad"', "turn", 3.0),
        ("dry-run a.csv --turn 45°", "turn", math.radians(45)),
        ('dry-run a.csv --lean "5 deg, 0"', "lean", (math.radians(5), 0.0)),
        ('dry-run a.csv --move "20 mm, -3.5cm"', "move", (0.02, -0.035)),
        ("dry-run a.csv --move 0.02,-0.03", "move", (0.02, -0.03)),
        ('dry-run a.csv --speed "30 cm/min"', "speed", 0.005),
        ("dry-run a.csv --speed 0.005", "speed", 0.005),
        ('dry-run a.csv --start "-1.57, -1.3, -1.9, -1.5, 1.57, 0"', "start", (-1.57, -1.3, -1.9, -1.5, 1.57, 0.0)),
        ('plan a.ply --viewpoint 0 "-750 mm" 0.75', "viewpoint", (0.0, -0.75, 0.75)),
        ("plan a.ply --near 1 2 -3", "near", (1.0, 2.0, -3.0)),
        ('run straight --near 20mm "-450 mm" 0', "near", (0.02, -0.45, 0.0)),
        ('plan a.png --intrinsics a --depth-unit "0.1 mm"', "depth_unit", 1e-4),
        ("plan a.png --intrinsics a --depth-unit 0.001", "depth_unit", 1e-3),
        ("execute a.json --robot sim --speed-scale 0.1", "speed_scale", 0.1),
        ('execute a.json --robot sim --speed-scale "10 %"', "speed_scale", 0.1),
        ("execute a.json --robot sim --speed-scale 50%", "speed_scale", 0.5),
        ('controller --unlock-delay "500 ms"', "unlock_delay", 0.5),
        ("controller --speed 10", "speed", 10.0),
    ],
)
def test_a_quantity_is_si_in_the_command(line, name, value):
    assert getattr(parse(shlex.split(line)), name) == pytest.approx(value, rel=1e-12)


@pytest.mark.parametrize(
    ("line", "name", "value"),
    [
        ("dry-run a.csv --speed 5 mm/s", "speed", 0.005),
        ("dry-run a.csv --turn -15 deg --no-fix", "turn", math.radians(-15)),
        ("dry-run --turn 15 Degrees a.csv", "turn", math.radians(15)),
        ('dry-run a.csv --turn "1,5 deg"', "turn", math.radians(1.5)),
        ("dry-run a.csv --speed 12 in/min", "speed", 12 * 0.0254 / 60),
        ("dry-run a.csv --speed 0.3 m/min", "speed", 0.005),
        ("dry-run a.csv --move 20 mm -30 mm", "move", (0.02, -0.03)),
        ("dry-run --move 20mm -30mm a.csv", "move", (0.02, -0.03)),
        ('dry-run a.csv --move "20mm -30mm"', "move", (0.02, -0.03)),
        ('dry-run a.csv --move "20,5 mm; -30 mm"', "move", (0.0205, -0.03)),
        ('dry-run a.csv --move "20,5 mm, 3,5 mm"', "move", (0.0205, 0.0035)),
        ("dry-run a.csv --lean 5 deg 0", "lean", (math.radians(5), 0.0)),
        ("dry-run a.csv --start [-1.57,-1.3,-1.9,-1.5,1.57,0]", "start", (-1.57, -1.3, -1.9, -1.5, 1.57, 0.0)),
        (
            "dry-run a.csv --start -90 deg, -75 deg, -109 deg, -86 deg, 90 deg, 0",
            "start",
            tuple(map(math.radians, (-90, -75, -109, -86, 90, 0))),
        ),
        ("plan a.ply --viewpoint 0,-0.75,0.75", "viewpoint", (0.0, -0.75, 0.75)),
        ('plan a.ply --viewpoint "0 -0.75 0.75"', "viewpoint", (0.0, -0.75, 0.75)),
        ("plan a.ply --viewpoint=0,-0.75,0.75", "viewpoint", (0.0, -0.75, 0.75)),
        ("plan --viewpoint 0 -750 mm 750 mm a.ply", "viewpoint", (0.0, -0.75, 0.75)),
        ("plan a.ply --near '(0, -0.45, 0)'", "near", (0.0, -0.45, 0.0)),
        ("execute a.json --robot sim --speed-scale 50 %", "speed_scale", 0.5),
        ("execute a.json --robot sim --from 69 mm", "from_", 0.069),
        ("controller --seconds 2 seconds", "seconds", 2.0),
    ],
)
def test_values_are_read_however_the_shell_parted_them(line, name, value):
    command = parse(shlex.split(line))
    assert getattr(command, name) == pytest.approx(value, rel=1e-12)
    assert str(getattr(command, "file", None) or getattr(command, "cloud", None) or "a.")[:2] == "a."


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("dry-run a.csv --turn 15 mm", "--turn '15 mm': unit 'mm' is not one of rad"),
        ("dry-run a.csv --move 20 mm", "--move '20 mm': 1 given, 2 needed"),
        ("dry-run a.csv --speed 5 6", "6: one word too many"),
        ('dry-run a.csv --speed "1,500 mm/s"', '"1.500 mm/s" or "1500 mm/s"? write which'),
        ("dry-run a.csv --speed fast", '"8 mm/s" say'),
        ("dry-run a.csv --turn much", '"15 deg" say'),
        ("execute a.json --robot sim --from 69", '"69 mm" is meant?'),
    ],
)
def test_what_stays_no_quantity_is_named_as_it_was_meant(line, says, capsys):
    assert main(shlex.split(line)) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert says in said


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("plan a.ply --near 0 0 nan", "--near '0, 0, nan': a finite number is needed"),
        ("plan a.ply --near 0 0 inf", "finite"),
        ("run straight --near 0 0 fish", "'fish' is no quantity"),
        ('dry-run a.csv --lean "5 deg"', "1 given, 2 needed"),
        ('dry-run a.csv --move "1 mm, 2 mm, 3 mm"', "3 given, 2 needed"),
        ('dry-run a.csv --start "0, 0"', "joint 6"),
        ('dry-run a.csv --turn "15 mm"', "unit 'mm' is not one of rad, deg"),
        ('dry-run a.csv --speed "5 mm"', "unit 'mm' is not one of m/s, mm/s"),
        ("dry-run a.csv --speed 0", "outside"),
        ('dry-run a.csv --speed "-5 mm/s"', "outside"),
        ('plan a.png --intrinsics a --depth-unit "0 mm"', "outside"),
        ('plan a.ply --viewpoint 0 0 "900 m"', "outside"),
        ("execute a.json --robot sim --speed-scale 0", "outside"),
        ('execute a.json --robot sim --speed-scale "150 %"', "1.5 is outside"),
        ("execute a.json --robot sim --speed-scale 200", "outside"),
        ("controller --seconds -1", "outside"),
        ("controller --speed fast", "'fast' is no number"),
    ],
)
def test_what_is_no_such_quantity_is_refused_in_one_line_that_names_the_option(line, says, capsys):
    words = shlex.split(line)
    assert main(words) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert says in said
    assert next(word for word in reversed(words) if word.startswith("--")) in said


@pytest.mark.parametrize("kind", KINDS, ids=lambda kind: kind.example or "plain")
def test_the_example_and_both_ends_of_every_range_are_taken(kind: Quantity):
    count = len(kind.names)
    if kind.example:
        assert len(listed(", ".join([kind.example] * count), kind, "--x")) == count
    for end in (kind.low, kind.high):
        assert several([f"{end!r} {kind.unit}".strip()] * count, kind, "--x") == pytest.approx((end,) * count)
        beyond = end + math.copysign(1e-3 * max(1.0, abs(end)), end - 0.5 * (kind.low + kind.high))
        with pytest.raises(InputError, match="outside"):
            several([f"{beyond!r} {kind.unit}".strip()] * count, kind, "--x")
