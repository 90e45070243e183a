"""Words that make no command are answered with the words that were meant, and those make a command."""

import re
import shlex

import pytest

from weldsim.cli import main
from weldsim.cli.options import EVERYTHING, ConfigOptions
from weldsim.cli.usage import COMMANDS, MEANT_COMMANDS, MEANT_OPTIONS, SUFFIXES, overview, parse
from weldsim.config import CellConfig
from weldsim.errors import InputError, SceneError
from weldsim.regression.finders import load_finder, told_apart
from weldsim.scene.files import scene_path


def answer(words: list[str], capsys: pytest.CaptureFixture) -> str:
    """What a refusal says, in one line with exit code 2."""
    assert main(words) == 2
    out, said = capsys.readouterr()
    assert out == "" or "--json" in words
    assert said.count("\n") == 1
    return said


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("weld straight", "weldsim run straight"),
        ("weld path.json", "weldsim execute path.json --robot sim"),
        ("simulate my_part.toml", "weldsim run my_part.toml"),
        ("find scan.ply", "weldsim plan scan.ply"),
        ("pln scan.ply", "weldsim plan scan.ply"),
        ("Run straight --seed 1", "weldsim run straight --seed 1"),
        ("dryrun job.csv", "weldsim dry-run job.csv"),
        ("dry_run job.csv", "weldsim dry-run job.csv"),
        ("check robot.script", "weldsim dry-run robot.script"),
        ("show cuboid", "weldsim scenes show cuboid"),
        ("export cuboid -o cell.xml", "weldsim scenes export cuboid -o cell.xml"),
        ("scene", "weldsim scenes"),
        ("scene curve", "weldsim scenes show curve"),
        ("scens export cuboid -o a.xml", "weldsim scenes export cuboid -o a.xml"),
        ("list", "weldsim scenes"),
        ("settings cuboid", "weldsim config cuboid"),
        ("straight --seed 2", "weldsim run straight --seed 2"),
        ("scan.pcd", "weldsim plan scan.pcd"),
        ("path.json", "weldsim dry-run path.json"),
        ("my_part.toml", "weldsim run my_part.toml"),
        ("--json scenes", "weldsim scenes --json"),
        ("doctr", "weldsim doctor"),
        ("regres", "weldsim regress"),
        ("scenes straight", "weldsim scenes show straight"),
        ("scenes display cuboid", "weldsim scenes show cuboid"),
        ("scenes exprt cuboid -o a.xml", "weldsim scenes export cuboid -o a.xml"),
    ],
)
def test_the_command_meant_is_told_and_is_one(line, meant, capsys):
    said = answer(shlex.split(line), capsys)
    assert f"did you mean {meant}?" in said
    assert callable(parse(shlex.split(meant)[1:]))


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("run straight --seeds 3", "--seed"),
        ("scan straight --seeds 3", "--seed"),
        ("regress --seed 3", "--seeds"),
        ("regress --scene straight", "--scenes"),
        ("regress --method profile", "--methods"),
        ("run straight --output x", "--out"),
        ("run straight -o x", "--out"),
        ("run straight --metod thesis", "--method"),
        ("run straight --film x.mp4", "--video"),
        ("plan a.ply --output=x.json", "--out"),
        ("plan a.ply --unit mm", "--units"),
        ("plan a.ply --view-point 0 0 1", "--viewpoint"),
        ("execute a.json --robot ur --ip 192.0.2.1", "--host"),
        ("dry-run a.csv --nofix", "--no-fix"),
    ],
)
def test_the_option_meant_is_told_and_is_one(line, meant, capsys):
    words = shlex.split(line)
    said = answer(words, capsys)
    assert f"did you mean {meant}?" in said
    wrong = re.search(r"has no option (\S+);", said)
    assert wrong
    assert callable(parse([word.replace(wrong[1], meant) if word.startswith(wrong[1]) else word for word in words]))


def _after(words: list[str], option: str, value: str) -> list[str]:
    """The words with the value behind an option replaced."""
    at = words.index(option)
    return [*words[: at + 1], value, *words[at + 2 :]]


@pytest.mark.parametrize(
    ("line", "option", "meant"),
    [
        ("plan a.ply --units MM", "--units", "mm"),
        ("plan a.ply --units millimetres", "--units", "mm"),
        ("plan a.ply --units Inches", "--units", "in"),
        ("plan a.ply --method Profile", "--method", "profile"),
        ("run straight --method published", "--method", "thesis"),
        ("run straight --sensor D415", "--sensor", "d415"),
        ("scan straight --sensor kinectv2", "--sensor", "kinect"),
        ("execute a.json --robot simulated", "--robot", "sim"),
        ("execute a.json --robot UR5", "--robot", "ur"),
        ("dry-run a.csv --tool TCP", "--tool", "torch"),
        ("dry-run a.csv --base ros", "--base", "base_link"),
        ("controller --profile e-series", "--profile", "e"),
    ],
)
def test_the_choice_meant_is_told_and_is_one(line, option, meant, capsys):
    words = shlex.split(line)
    said = answer(words, capsys)
    assert f"; did you mean {meant}?" in said
    assert callable(parse(_after(words, option, meant)))


def test_choices_are_named_in_the_order_of_the_help(capsys):
    assert "one of m, cm, mm, um, in, ft" in answer(["plan", "a.ply", "--units", "x"], capsys)
    assert "one of profile, thesis" in answer(["plan", "a.ply", "--method", "x"], capsys)


@pytest.mark.parametrize("words", ["path.speed = 0.006", "path.speed 0.006", "path.speed =0.006", "path.speed '6 mm/s'"])
def test_a_setting_in_several_words_is_told_in_one_that_works(words, capsys):
    said = answer(["config", "--set", *shlex.split(words)], capsys)
    meant = said.partition("did you mean ")[2].partition("?; see")[0]
    assert main(["config", *shlex.split(meant)]) == 0


@pytest.mark.parametrize(
    ("line", "meant"),
    [
        ("run straight --set sensor=d435", "--sensor d435"),
        ("run straight --set=sensor=d435", "--sensor d435"),
        ("run straight --set camera=d435", "--sensor d435"),
        ("run straight --set seed=3 --set sensor=d435", "--seed 3"),
        ("run straight --set seam=all", "--seam all"),
        ("run straight --set method=thesis", "--method thesis"),
        ("scan straight --set output=a.ply", "--out a.ply"),
        ("plan a.ply --set 'viewpoint=0 0 1'", "--viewpoint '0 0 1'"),
        ("regress --set seeds=3", "--seeds 3"),
        ("execute a.json --set robot=sim", "--robot sim"),
        ("execute a.json --robot sim --set speed_scale=0.5", "--speed-scale 0.5"),
        ("execute a.json --robot sim --set arc=true", "--arc"),
        ("run straight --speed 6 mm/s", "--set 'path.speed=6 mm/s'"),
        ("run straight --path.speed=6mm/s", "--set path.speed=6mm/s"),
        ("run straight --min_length 0.02", "--set seam.profile.min_length=0.02"),
        ("plan a.ply --crop_min", "--set cloud.crop_min=VALUE"),
    ],
)
def test_a_setting_that_is_an_option_and_an_option_that_is_a_setting_are_told(line, meant, capsys):
    """The words that are told stand in place of those that were given, and make a command."""
    words = shlex.split(line)
    said = answer(words, capsys)
    told = said.partition("did you mean ")[2].partition("?")[0].split(" or --set ")[0]
    assert told == meant
    if "VALUE" in meant:
        return
    kept = [word for word in words if word in (words[0], words[1], "--robot", "sim") and "=" not in word and word != "--set"]
    command = parse([*kept, *shlex.split(told)])
    assert callable(command)
    if "--set" in told:
        assert isinstance(command, ConfigOptions)
        assert command.cell() != CellConfig()


def test_a_scene_that_is_set_is_told_without(capsys):
    assert "did you mean weldsim run curve?" in answer(["run", "straight", "--set", "scene=curve"], capsys)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("run straight --golden x", "weldsim regress has"),
        ("run straight --viewpoint 0 0 1", "weldsim plan has"),
        ("run straight --frobnicate", "weldsim run has no option --frobnicate; see weldsim run --help"),
        ("run straight --scene cuboid", "weldsim run cuboid"),
        ("plan --cloud a.ply", "weldsim plan a.ply"),
        ("run straight --set path.speed=6 mm/s", 'did you mean "path.speed=6 mm/s", in quotes?'),
        ("run straight curve", "curve: one word too many"),
        ("regress --set --seeds 3", "--set: its value is missing"),
        ("plan a.ply --seam one", "--seam 'one' is neither a whole number nor all"),
        ("plan a.ply --near 0 -0.45", "--near 0 -0.45: 2 given, 3 needed"),
        ("plan a.ply --viewpoint --json", "--viewpoint: its 3 values are missing"),
        ("execute a.json --robot sim --seam one", "--seam 'one' is no whole number"),
        ("execute a.json --robot sim --seam all", "welds one seam of a file at a time"),
        ("controller fault protectivestop", "local-control, remote-control, recover; did you mean protective-stop?"),
        ("plan a.ply --seam 1.5", "--seam '1.5' is neither a whole number nor all"),
        ("run straight --seed", "--seed: its value is missing"),
        ("run straight --sensor kinekt", "did you mean kinect?"),
        ("run straight --method profil", "did you mean profile?"),
        ("controller fault stal", "did you mean stall?"),
        ("plan straight", "did you mean weldsim run straight"),
        ("run strait", "did you mean straight?"),
        ("scenes show cubiod", "did you mean cuboid?"),
    ],
)
def test_what_is_wrong_is_said_without_the_words_of_a_parser(line, says, capsys):
    said = answer(shlex.split(line), capsys)
    assert says in said
    for noise in ("argument", "unrecognized", "invalid literal", "instantiated", "parsing"):
        assert noise not in said


def test_a_negative_number_and_a_value_with_dashes_are_no_options():
    assert parse(["plan", "a.ply", "--near", "0", "-0.45", "-1e-3"]).near == (0.0, -0.45, -1e-3)  # type: ignore[union-attr]
    assert parse(["dry-run", "a.csv", "--turn", "-15 deg"]).turn < 0  # type: ignore[union-attr]
    assert parse(["dry-run", "a.csv", "--no_fix"]).no_fix  # type: ignore[union-attr]
    assert str(parse(["scenes", "show", "y", "-o", "y.png"]).out) == "y.png"  # type: ignore[union-attr]


def test_help_names_every_command_as_the_command_does(capsys):
    for name, entry in COMMANDS.items():
        assert f"  {name} " in overview()
        said = " ".join((entry.load().__doc__ or "").split())
        assert said.startswith(entry.about), name
    assert main(["--help"]) == main(["-h"]) == 0
    assert capsys.readouterr().out == 2 * overview()


def test_every_guess_is_of_something_there_is():
    options = {f.replace("_", "-") for entry in COMMANDS.values() for f in entry.load().__dataclass_fields__}
    assert {one for meant in MEANT_OPTIONS.values() for one in meant} <= options
    assert {meant.split()[0] for meant in MEANT_COMMANDS.values()} <= {*COMMANDS, "--version", "--help"}
    assert set(SUFFIXES) <= set(COMMANDS)
    assert set(EVERYTHING) == {name for name in CellConfig.__dataclass_fields__ if name != "given"}


def test_a_scene_file_without_its_suffix_is_told(tmp_path):
    (tmp_path / "part.toml").write_text("")
    with pytest.raises(SceneError, match=r"did you mean .*part\.toml\?"):
        scene_path(tmp_path / "part")


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("scenes show straight --set arm=ur10e", "it is no setting; weldsim dry-run has an option --arm"),
        ("scenes export straight --set arm=ur10e -o a.xml", "it is no setting; weldsim dry-run has an option --arm"),
        ("run straight --set viewpoint=1", "it is no setting; weldsim plan has an option --viewpoint"),
        ("config --set sensor=d435", "it is no setting; weldsim run and scan and regress have an option --sensor"),
        ("run straight --set frob=1", "unknown key 'frob'; allowed"),
        ("scenes export straight --set groove.width=10mm", "did you mean scene.groove.width?"),
        ("scenes show straight --set path.speed=0.01", "changes nothing here"),
        ("scenes show straight --set scene.cylinder.radius=100mm", "changes nothing here"),
        ("run part.stl", 'part.stl is a mesh, no scene; write a TOML file beside it: workpiece = "mesh"'),
        ("scan my/cloud.PLY", "is a cloud, no scene; did you mean weldsim plan my/cloud.PLY?"),
        ("scenes show job/path.json", "is a path or program, no scene; did you mean weldsim dry-run job/path.json?"),
        ("scenes show straight --set scene.frobnicate=1", "unknown key 'frobnicate'"),
        ("scenes --set path.speed=0.01", "did you mean scenes show?"),
        ("plan a.ply --set scene.pose.x=0.1", "no scene is read here"),
        ("plan a.ply --set execution.gate.tip_speed=0.1", "changes nothing here; what is read is cloud, seam, path, report"),
        ("dry-run a.csv --set scene.pose.x=0.1", "give a scene with it"),
        ("dry-run a.csv --set sensor.baseline=0.05", "changes nothing here"),
        ("execute a.json --robot sim --set scene.pose.x=0.1", "give a scene with it"),
        ("scan straight --set path.speed=0.01", "changes nothing here"),
        ("config --set scene.pose.x=0.1", "give a scene with it"),
        ("regress --set seam.method=thesis", "did you mean --methods?"),
        ("scan straight --view 2", "give --depth too"),
        ("dry-run a.json --tool tool0", "changes nothing here"),
        ("dry-run a.script --base base_link", "changes nothing here"),
        ("dry-run a.script --roll", "changes nothing here"),
    ],
)
def test_a_setting_that_would_change_nothing_is_refused(line, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert says in answer(shlex.split(line), capsys)
    assert list(tmp_path.iterdir()) == []


@pytest.mark.parametrize("line", ["scenes show straight", "scenes export straight"])
def test_a_file_of_settings_that_are_not_read_is_refused(line, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "cell.toml").write_text('[path]\nspeed = "6 mm/s"\n')
    assert "changes nothing here" in answer([*line.split(), "--config", "cell.toml"], capsys)


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("plan a.ply --out path.txt", "a path ends in .json"),
        ("plan a.ply --out path", "a path ends in .json"),
        ("plan a.ply --out path.csv", "did you mean --csv path.csv?"),
        ("plan a.ply --csv path.json", "did you mean --out path.json?"),
        ("plan a.ply --report report.pdf", "a page ends in .html, a picture in .png"),
        ("run straight --out path.json", "a run directory is written"),
        ("execute a.json --robot sim --out weld.html", "a run directory is written"),
        ("scan straight --out scan.json", "a cloud ends in .ply"),
        ("scan straight --depth depth.jpg", ".png, .npy"),
        ("run straight --video weld.avi", "a film ends in .mp4"),
        ("run straight --video .mp4", ".mp4: a name is missing before .mp4"),
        ("plan a.ply --out .json", ".json: a name is missing before .json"),
        ("plan a.ply --out ''", "--out: its value is empty; see weldsim plan --help"),
        ("plan a.ply --out=", "--out: its value is empty"),
        ("plan a.ply --near 0 '' 0", "an argument is empty"),
        ("scenes show straight -o ' '", "-o: its value is empty"),
        ("plan ''", "an argument is empty; see weldsim plan --help"),
        ("run ''", "an argument is empty"),
        ("regress --scenes", "--scenes: its values are missing; see weldsim regress --help"),
        ("regress --methods --seeds 1", "--methods: its values are missing"),
    ],
)
def test_a_file_is_what_its_name_says(line, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert says in answer(shlex.split(line), capsys)
    assert list(tmp_path.iterdir()) == []


def test_a_report_does_not_take_the_place_of_a_runs(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    (tmp_path / "job").mkdir()
    (tmp_path / "job" / "run.json").write_text("{}")
    said = answer(["plan", "a.ply", "--report", "job"], capsys)
    assert "--report job: holds a run, whose report would be lost; give another folder" in said
    assert [path.name for path in (tmp_path / "job").iterdir()] == ["run.json"]


FINDER = """
import numpy as np
def find(cloud):
    x = np.linspace(-0.1, 0.1, 20)
    return np.stack([x, np.full(20, -0.45), np.full(20, 0.02)], axis=1)
WORD = 3
"""


def test_a_finder_is_loaded_by_name(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr("sys.path", [*__import__("sys").path])
    (tmp_path / "own_finder_a.py").write_text(FINDER)
    package = tmp_path / "deep"
    package.mkdir()
    (package / "own_finder_b.py").write_text(FINDER)
    for name, label in (
        ("own_finder_a:find", "own_finder_a:find"),
        ("own_finder_a.py:find", "own_finder_a:find"),
        ("deep.own_finder_b:find", "deep.own_finder_b:find"),
        ("deep/own_finder_b.py:find", "own_finder_b:find"),
    ):
        found, finder = load_finder(name)
        assert found == label
        assert finder(None).shape == (20, 3)  # type: ignore[arg-type, attr-defined]
    assert told_apart(["profile", "own_finder_a:find"], None)[0] == ["profile"]
    with pytest.raises(InputError, match=r"did you mean own_finder_a:find\?"):
        load_finder("own_finder_a.find")
    with pytest.raises(InputError, match=r"there is no fnd; did you mean find\?"):
        load_finder("own_finder_a:fnd")
    with pytest.raises(InputError, match="WORD is no function"):
        load_finder("own_finder_a:WORD")
    with pytest.raises(InputError, match="nowhere cannot be imported"):
        load_finder("nowhere:find")
    with pytest.raises(InputError, match="no such file"):
        load_finder("nowhere.py:find")
    with pytest.raises(InputError, match=r"did you mean thesis\?"):
        load_finder("thesi")
    (tmp_path / "own_finder_c.py").write_text("raise RuntimeError('no licence')\n")
    with pytest.raises(InputError, match="RuntimeError: no licence"):
        load_finder("own_finder_c:find")


def test_help_is_a_command_too(capsys):
    assert main(["help"]) == 0
    overview = capsys.readouterr().out
    assert main(["--help"]) == 0
    assert capsys.readouterr().out == overview
    assert main(["help", "scan"]) == 0
    assert "usage: weldsim scan" in capsys.readouterr().out


@pytest.mark.parametrize(("words", "seam"), [("plan a.ply --seam all", "all"), ("plan a.ply --seam 2", 2), ("plan a.ply", None)])
def test_all_seams_may_be_asked_for_by_name(words, seam):
    assert parse(words.split()).seam == seam  # type: ignore[union-attr]


@pytest.mark.parametrize(
    ("line", "says"),
    [
        ("run curve.toml", "did you mean curve, which comes with weldsim?"),
        ("run job", "job is a run directory, no scene; did you mean weldsim dry-run job/path.json?"),
        ("run empty", "empty is a folder, no scene"),
        ("plan mine.toml", "it is no cloud; of a scene, weldsim scan mine.toml --out mine.ply makes one"),
        ("plan part.stl", "it is an STL mesh, no cloud"),
        ("plan job/path.json", "did you mean weldsim dry-run job/path.json?"),
        ("plan robot.script", "it is a robot program, no cloud; did you mean weldsim dry-run robot.script?"),
    ],
)
def test_a_file_of_another_kind_is_called_that(line, says, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    for folder in ("job", "empty"):
        (tmp_path / folder).mkdir()
    (tmp_path / "job" / "path.json").write_text('{"schema": "weldsim.path/1"}')
    (tmp_path / "mine.toml").write_text('workpiece = "cuboid"\n')
    (tmp_path / "part.stl").write_bytes(bytes(200))
    (tmp_path / "robot.script").write_text("def p():\nend\n")
    said = answer(shlex.split(line), capsys)
    assert says in said
    meant = re.search(r"(?:did you mean |of a scene, )(weldsim [^?;]*?)(?:\?| makes)", said)
    if meant:
        assert callable(parse(shlex.split(meant[1])[1:]))
