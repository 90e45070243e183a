"""Words that make no command are refused in one line that says what is wrong; outputs are tried before the work."""

import os
from pathlib import Path

import pytest

from weldsim.cli import main
from weldsim.cli.options import parted
from weldsim.cli.outputs import check_outputs, check_suffix
from weldsim.cli.plan import Plan
from weldsim.cli.run import Run
from weldsim.cli.show import table
from weldsim.cli.usage import COMMANDS, parse
from weldsim.errors import InputError, OutputError, WeldsimError


@pytest.mark.parametrize(
    ("words", "says"),
    [
        ([], "expected one of"),
        (["frobnicate"], "frobnicate"),
        (["plan"], "missing from weldsim plan: CLOUD; see weldsim plan --help"),
        (["run"], "missing from weldsim run: SCENE"),
        (["plan", "a.ply", "--metod", "thesis"], "--metod"),
        (["plan", "a.ply", "--method", "best"], "best"),
        (["plan", "a.ply", "--viewpoint", "1", "2"], "--viewpoint"),
        (["plan", "a.ply", "b.ply"], "b.ply"),
        (["run", "straight", "--seed", "one"], "--seed"),
        (["plan", "a.ply", "--seam", "1.5"], "--seam"),
        (["plan", "--set"], "--set"),
        (["scan", "straight", "--sensor", "eye\nglass"], "eye"),
        (["plan", "[bold]a[/bold]", "│ ── x"], "x"),
        (["regress", "--scenes", "plain", "--scenes=y"], "--scenes is given twice; give its values together: --scenes A B"),
    ],
)
def test_usage_errors_are_one_line_and_exit_2(words, says, capsys):
    assert main(words) == 2
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert err.startswith("weldsim: ")
    assert says in err
    assert not set(err) & set("╭╮╰╯") and "\x1b" not in err  # noqa: PT018 - one look at one line


@pytest.mark.parametrize("words", [["--help"], *([name, "--help"] for name in COMMANDS)])
def test_help_goes_to_stdout_and_names_every_option(words, capsys):
    assert main(words) == 0
    out, err = capsys.readouterr()
    assert err == ""
    assert ("--json" in out) or words == ["--help"]


def test_version(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("weldsim ")


def test_words_become_options():
    options = "--viewpoint 0 -0.45 1e-1 --set path.speed=0.01 --set seam.method=thesis --json --near 1 2 -3"
    command = parse(["plan", "a.ply", *options.split()])
    assert isinstance(command, Plan)
    assert (command.cloud, command.viewpoint, command.near) == (Path("a.ply"), (0.0, -0.45, 0.1), (1.0, 2.0, -3.0))
    config = command.cell(None)
    assert (config.path.speed, config.seam.method) == (0.01, "thesis")
    assert command.cell("profile").seam.method == "profile"


def test_a_list_may_be_written_with_commas(tmp_path):
    own = tmp_path / "a,b.toml"
    own.touch()
    assert parted(("plain,y", "curve,", str(own))) == ("plain", "y", "curve", str(own))


def test_settings_of_the_scene_start_with_scene():
    command = parse(["run", "straight", "--set", "scene.groove.width=10 mm", "--set", "path.speed=5 mm/s"])
    assert isinstance(command, Run)
    assert command.scene_of("straight").groove.width == pytest.approx(0.010)
    assert command.cell().path.speed == pytest.approx(0.005)


@pytest.mark.parametrize("name", ["", "a/b", "..", ".hidden"])
def test_a_scene_name_cannot_lead_out_of_its_folder(name, tmp_path):
    scene = tmp_path / "x.toml"
    scene.write_text(f'name = "{name}"\n')
    command = parse(["run", str(scene)])
    assert isinstance(command, Run)
    with pytest.raises(InputError, match="cannot name a folder"):
        command.scene_config()


def test_outputs_are_tried_and_nothing_is_left(tmp_path):
    taken = tmp_path / "taken"
    taken.write_text("x")
    check_outputs([tmp_path / "a", None, tmp_path / "b", taken])
    assert [path.name for path in tmp_path.iterdir()] == ["taken"]
    with pytest.raises(OutputError, match="is a folder"):
        check_outputs([tmp_path])
    with pytest.raises(OutputError, match="no such folder"):
        check_outputs([tmp_path / "no" / "a"])
    with pytest.raises(OutputError, match="it is a file, no folder"):
        check_outputs([taken / "a"])
    with pytest.raises(InputError, match="given twice"):
        check_outputs([tmp_path / "a", tmp_path / "." / "a"])
    with pytest.raises(InputError, match="is read by this command"):
        check_outputs([taken], [taken])
    with pytest.raises(OutputError, match=r"ends in \.mp4"):
        check_suffix(Path("a.avi"), (".mp4",), "a film")


def test_a_folder_that_cannot_be_written_is_told(tmp_path, monkeypatch):
    def refuse(**_: object) -> None:
        raise PermissionError(13, "Permission denied")

    monkeypatch.setattr("tempfile.TemporaryFile", refuse)
    with pytest.raises(OutputError, match="Permission denied"):
        check_outputs([tmp_path / "a"])


class Failing:
    """A command that raises."""

    def __init__(self, error: BaseException) -> None:
        self.error = error

    def __call__(self) -> int:
        raise self.error


@pytest.mark.parametrize(
    ("error", "code", "says"),
    [
        (WeldsimError("two\nlines"), 2, "two lines"),
        (KeyboardInterrupt(), 130, "interrupted"),
        (KeyboardInterrupt("interrupted: the arm was stopped"), 130, "interrupted: the arm was stopped"),
        (ValueError("odd\nvalue"), 70, "defect of weldsim"),
        (OSError(28, "No space left on device", "x.json"), 2, "x.json: No space left"),
        (MemoryError(), 2, "out of memory"),
    ],
)
def test_every_failure_is_one_line_with_its_own_code(error, code, says, monkeypatch, capsys):
    monkeypatch.setattr("weldsim.cli.usage.parse", lambda words: Failing(error))
    monkeypatch.delenv("WELDSIM_DEBUG", raising=False)
    assert main(["plan", "x"]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    assert says in err


def test_a_defect_shows_its_traceback_when_asked(monkeypatch, capsys):
    monkeypatch.setattr("weldsim.cli.usage.parse", lambda words: Failing(ValueError("odd")))
    monkeypatch.setenv("WELDSIM_DEBUG", "1")
    assert main(["plan", "x"]) == 70
    assert "Traceback" in capsys.readouterr().err


def test_table_is_aligned():
    lines = table([["1", "long cell", "x"], ["22", "b", "y"]], ("n", "name", "z")).splitlines()
    assert len({line.index(last) for line, last in zip(lines, "zxy", strict=True)}) == 1


def test_environment_is_kept_from_threads_that_wait(monkeypatch):
    monkeypatch.delenv("OPENBLAS_NUM_THREADS", raising=False)
    main(["--version"])
    assert os.environ["OPENBLAS_NUM_THREADS"] == "1"
    monkeypatch.setenv("OPENBLAS_NUM_THREADS", "3")
    main(["--version"])
    assert os.environ["OPENBLAS_NUM_THREADS"] == "3"
