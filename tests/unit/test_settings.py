"""Where each value comes from: a given one always wins, whatever it is, and `weldsim config` shows it."""

import json
import pickle
import re
from dataclasses import fields, replace
from itertools import pairwise

import pytest

from weldsim.cli import main
from weldsim.config import SCENE, CellConfig, digest, for_scene, limits_for, load_config, load_scene, paced_for, to_json
from weldsim.errors import ConfigError, SceneError
from weldsim.report.limits import ReportConfig
from weldsim.scene.config import SceneConfig
from weldsim.schema import choices, keys
from weldsim.settings import MEANT_VALUES, Source, load_toml, meant_keys, with_sources
from weldsim.units import parse

GENERAL = ReportConfig()


def numbers(tables: dict, lead: str = "") -> dict[str, float]:
    """Dotted key and value of every number."""
    found: dict[str, float] = {}
    for key, value in tables.items():
        if isinstance(value, dict):
            found |= numbers(value, f"{lead}{key}.")
        elif isinstance(value, int | float):
            found[lead + key] = value
    return found


def config_json(capsys: pytest.CaptureFixture, *words: str) -> dict[str, dict]:
    assert main(["config", *words, "--json"]) == 0
    return {row["key"]: row for row in json.loads(capsys.readouterr().out)["settings"]}


def test_a_limit_that_is_given_wins_though_it_equals_the_default():
    cuboid = load_scene("cuboid")
    assert cuboid.limits.max != GENERAL.max
    for name in ("mean", "p95", "max"):
        given = load_config(overrides=[f"report.{name}={getattr(GENERAL, name)!r}"])
        assert getattr(limits_for(given, cuboid), name) == getattr(GENERAL, name)
        others = {"mean", "p95", "max"} - {name}
        assert all(getattr(limits_for(given, cuboid), other) == getattr(cuboid.limits, other) for other in others)
    pace = load_config(overrides=["motion.least_speed=0.5"])
    assert pace.motion == CellConfig().motion
    assert paced_for(pace, load_scene("cuboid", ["limits.least_speed=0.1"])).motion.least_speed == 0.5


def test_a_limit_in_a_file_wins_over_the_scene_and_the_command_line_over_both(tmp_path):
    file = tmp_path / "cell.toml"
    file.write_text('[report]\nmax = "1.2 mm"\n')
    cuboid, asked = load_scene("cuboid"), load_scene("cuboid", ["limits.max=3 mm"])
    assert limits_for(load_config(file), cuboid).max == 0.0012
    assert limits_for(load_config(file, ["report.max=1 mm"]), cuboid).max == 0.001
    assert limits_for(load_config(file), asked).max == 0.003  # the command line's, though it is the scene's
    assert limits_for(load_config(file, ["report.max=1 mm"]), asked).max == 0.001
    assert limits_for(load_config(), asked).max == 0.003


def test_a_value_set_in_python_wins_where_it_differs_or_is_named():
    cuboid = load_scene("cuboid")
    own = replace(CellConfig(), report=replace(GENERAL, max=0.0015))
    assert limits_for(own, cuboid).max == 0.0015
    assert limits_for(own, cuboid).mean == cuboid.limits.mean
    named = replace(CellConfig(), given={"report.max": Source("command line")})
    assert limits_for(named, cuboid).max == GENERAL.max
    assert limits_for(load_config({"report": {"max": "1.2 mm"}}), cuboid).max == GENERAL.max


def test_a_config_for_one_scene_can_be_made_for_another():
    cuboid = load_scene("cuboid")
    once = for_scene(CellConfig(), cuboid)
    assert once == for_scene(once, cuboid)
    assert once.source("report.max") == Source("scene", "cuboid")
    stricter = replace(cuboid, limits=replace(cuboid.limits, max=0.0017), given={})
    assert for_scene(once, stricter).report.max == 0.0017
    assert for_scene(CellConfig(), None) == CellConfig()


def test_where_values_come_from_is_no_setting():
    given = load_config(overrides=["report.max=1.2 mm"])
    assert given == CellConfig()
    assert digest(given) == digest(CellConfig())
    assert "given" not in to_json(given)
    assert "given" not in to_json(load_scene("straight"))
    with pytest.raises(ConfigError, match="unknown key 'given'"):
        load_config({"given": {}})
    assert pickle.loads(pickle.dumps(given)).given == given.given  # regress hands it to other processes
    assert "given" not in {*keys(CellConfig), *keys(SceneConfig)}


def test_a_table_that_is_replaced_as_a_whole_comes_from_there_alone():
    tables, given = with_sources(
        {"report": {"max": 1, "mean": 2}, "path": {"speed": 1}},
        Source("file", "a"),
        ["report={max=3}", "path.speed=2", "path.step=1"],
    )
    assert tables == {"report": {"max": 3}, "path": {"speed": 2, "step": 1}}
    assert {key: source.kind for key, source in given.items()} == dict.fromkeys(
        ("report.max", "path.speed", "path.step"), "command line"
    )


def test_the_config_command_shows_every_setting_with_its_source(tmp_path, capsys):
    file = tmp_path / "cell.toml"
    file.write_text('[path]\nspeed = "6 mm/s"\n')
    rows = config_json(capsys, "cuboid", "--config", str(file), "--set", "report.max=1.2 mm", "--set", "scene.groove.width=15 mm")
    assert list(rows) == [*keys(CellConfig), *(SCENE + key for key in keys(SceneConfig))]
    expected = {
        "report.max": (0.0012, "m", "command line"),
        "report.mean": (load_scene("cuboid").limits.mean, "m", "scene"),
        "path.speed": (0.006, "m/s", "file"),
        "path.step": (CellConfig().path.step, "m", "default"),
        "scene.groove.width": (0.015, "m", "command line"),
        "scene.groove.depth": (load_scene("cuboid").groove.depth, "m", "scene"),
        "scene.groove.angle": (SceneConfig().groove.angle, "rad", "default"),
    }
    for key, (value, unit, source) in expected.items():
        assert (rows[key]["unit"], rows[key]["source"]) == (unit, source), key
        assert rows[key]["value"] == pytest.approx(value)
    assert rows["path.speed"]["from"] == str(file)
    assert all(row["doc"] for key, row in rows.items() if not key.startswith(SCENE))


def test_given_settings_alone_are_shown_when_asked(capsys):
    assert list(config_json(capsys, "--given", "--set", "path.speed=6 mm/s")) == ["path.speed"]
    assert main(["config", "--given"]) == 0
    assert "default" in capsys.readouterr().out


def test_what_the_table_shows_can_be_set_and_is_the_same(capsys):
    """A person's table is in millimetres and degrees; each row handed back gives the value that is in force."""
    assert main(["config", "cuboid"]) == 0
    lines = capsys.readouterr().out.splitlines()
    head = lines[0]
    starts = [head.index(name) for name in ("setting", "value", "unit", "source")]
    settings = []
    for line in lines[1:]:
        key, value, unit = (line[a:b].strip() for a, b in pairwise(starts))
        if value != "none" and not value.endswith("..."):
            settings.append(f'{key}="{value} {unit}"' if unit else f"{key}={value}")
    assert 'report.max="2 mm"' in settings
    assert len(settings) > 150
    cell = load_config(overrides=[text for text in settings if not text.startswith(SCENE)])
    assert numbers(to_json(cell)) == pytest.approx(numbers(to_json(for_scene(CellConfig(), load_scene("cuboid")))), rel=1e-5)
    shape = tuple(f"scene.{table}." for table in ("cuboid", "groove", "pose", "limits", "fixture", "material"))
    scene = load_scene(
        "cuboid", [text.removeprefix(SCENE) for text in settings if text.startswith(shape) and "clearance" not in text]
    )
    assert numbers(to_json(scene)) == pytest.approx(numbers(to_json(load_scene("cuboid"))), rel=1e-5)


@pytest.mark.parametrize("key", ["path.speed", "report.axis_p95", "motion.period", "sensor.baseline", "seam.profile.min_width"])
def test_a_value_is_written_as_it_is_read(key):
    from weldsim.units import written

    table, name = key.rpartition(".")[0], key.rpartition(".")[2]
    own = CellConfig()
    for part in table.split("."):
        own = getattr(own, part)
    dimension = {"speed": "m/s", "axis_p95": "rad", "period": "s"}.get(name, "m")
    assert parse(" ".join(written(getattr(own, name), dimension)), dimension) == pytest.approx(getattr(own, name), rel=1e-5)


@pytest.mark.parametrize(
    ("setting", "meant"),
    [
        ("groove.width=10 mm", "scene.groove.width"),
        ("groove.wdth=10 mm", "scene.groove.width"),
        ("pose.yaw=1", "scene.pose.yaw"),
        ("lead_speed=6 mm/s", "motion.lead_speed"),
        ("path.sped=6 mm/s", "path.speed"),
        ("pth.speed=6 mm/s", "path.speed"),
        ("scene.path.speed=6 mm/s", "path.speed"),
        ("scene.groove.widht=10 mm", "scene.groove.width"),
        ("scene.yaw=1", "scene.pose.yaw"),
        ("profile.min_width=5 mm", "seam.profile.min_width"),
        ("mean=0.1 mm", "report.mean or scene.limits.mean"),
        ("scene.pose.pitch=0.1", "scene.pose.tilt"),
        ("scene.pose.rotation=0.1", "scene.pose.yaw"),
        ("path.velocity=6 mm/s", "path.speed"),
        ("seam.min_len=20 mm", "seam.profile.min_length"),
        ("min_len=20 mm", "seam.profile.min_length"),
        ("path.min_len=20 mm", "seam.profile.min_length"),
        ("seam.profil.min_len=20 mm", "seam.profile.min_length"),
        ("wdth=100 mm", "scene.plate.width or scene.cuboid.width or scene.groove.width"),
    ],
)
def test_an_unknown_setting_is_told_with_the_one_meant_and_that_one_works(setting, meant, capsys):
    assert main(["config", "straight", "--set", setting]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    told = said.partition("did you mean ")[2].partition("?")[0].split(" or ")
    assert sorted(told) == sorted(meant.split(" or "))
    value = setting.partition("=")[2]
    for key in told:
        scene = "cuboid" if "cuboid" in key else "straight"
        assert main(["config", scene, "--set", f"{key}={value}"]) == 0
        capsys.readouterr()


@pytest.mark.parametrize(
    ("setting", "meant"),
    [
        ("scene.fixture=none", "scene.fixture.clamps=0"),
        ("scene.fixture=2", "scene.fixture.clamps=2"),
        ("fixture=none", "scene.fixture.clamps=0"),
        ("scene.material=steel", "scene.material.finish=ground"),
        ("material=Black", "scene.material.finish=black"),
        ("scene.centre_line=curve", "scene.centre_line.shape=arc"),
        ("seam=thesis", "seam.method=thesis"),
        ("seam=published", "seam.method=thesis"),
        ("cloud.register=off", "cloud.register.enabled=false"),
        ("execution.ur=ur5e", "execution.ur.series=e"),
    ],
)
def test_a_value_in_place_of_a_table_is_told_with_its_setting_and_that_works(setting, meant, capsys):
    assert main(["config", "straight", "--set", setting]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f"did you mean {meant}?" in said
    assert main(["config", "straight", "--given", "--set", meant]) == 0
    key, value = meant.split("=")
    assert re.search(rf"{re.escape(key)} +{value} ", capsys.readouterr().out)


@pytest.mark.parametrize(
    ("setting", "meant"),
    [
        ("seam.method=published", "thesis"),
        ("seam.method=THESIS", "thesis"),
        ("scene.workpiece=box", "cuboid"),
        ("scene.material.finish=shiny", "ground"),
        ("scene.fixture.clamps=none", "0"),
        ("scene.fixture.stand=off", "false"),
        ("path.reverse=yes", "true"),
        ("path.reverse=True", "true"),
    ],
)
def test_a_choice_that_is_meant_is_told_and_works(setting, meant, capsys):
    assert main(["config", "straight", "--set", setting]) == 2
    said = capsys.readouterr().err
    assert f"did you mean {meant}?" in said
    assert main(["config", "straight", "--set", f"{setting.partition('=')[0]}={meant}"]) == 0


@pytest.mark.parametrize("text", ["0,-0.5,0", "0, -450 mm, 1e-2", "-.1 , 2.5cm, 0"])
def test_a_list_without_brackets_is_told_with_them_and_works(text, capsys):
    assert main(["config", "--set", f"cloud.crop_min={text}", "--set", "cloud.crop_max=[1,1,1]"]) == 2
    meant = capsys.readouterr().err.partition("did you mean ")[2].partition("?")[0]
    assert main(["config", "--set", f"cloud.crop_min={meant}", "--set", "cloud.crop_max=[1,1,1]"]) == 0


def test_every_word_for_a_choice_is_for_one_that_there_is():
    known = {**choices(CellConfig), **choices(SceneConfig)}
    for name, words in MEANT_VALUES.items():
        own = {one for key, some in known.items() if key.rpartition(".")[2] == name for one in some}
        assert own, name
        assert set(words.values()) <= own
        assert not set(words) & own


def test_a_table_without_such_a_setting_is_told_with_those_it_holds(capsys):
    assert main(["config", "straight", "--set", "scene.groove=10"]) == 2
    assert "; scene.groove holds width, depth, angle, root_gap, misalignment, margin" in capsys.readouterr().err


def test_in_a_file_what_is_meant_is_written_as_a_file_takes_it(tmp_path):
    scene, cell = tmp_path / "part.toml", tmp_path / "cell.toml"
    for file, load, text in ((scene, load_scene, 'fixture = "none"'), (cell, load_config, 'seam = "thesis"')):
        file.write_text(f"{text}\n")
        with pytest.raises(ConfigError, match="did you mean ") as caught:
            load(file)
        file.write_text(str(caught.value).partition("did you mean ")[2].partition("?")[0] + "\n")
        load(file)
    cell.write_text('fixture = "none"\n')
    with pytest.raises(ConfigError, match="fixture is a scene's: it belongs in the scene's file"):
        load_config(cell)


def test_what_may_be_left_out_is_unset_as_it_is_shown():
    assert load_scene("cuboid").limits.max is not None
    assert load_scene("cuboid", ["limits.max=none"]).limits.max is None
    assert load_scene("straight", ["limits.reason=none"]).limits.reason == "none"  # a text is kept


def test_a_setting_in_the_wrong_file_is_told_where_it_belongs(tmp_path):
    cell, scene = tmp_path / "cell.toml", tmp_path / "part.toml"
    cell.write_text('[groove]\nwidth = "10 mm"\n')
    scene.write_text('[path]\nspeed = "6 mm/s"\n')
    with pytest.raises(ConfigError, match=r"groove\.width is a scene's: it belongs in the scene's file"):
        load_config(cell)
    with pytest.raises(ConfigError, match=r"path\.speed is the cell's: it belongs in a --config file"):
        load_scene(scene)
    assert load_scene(cell).groove.width == pytest.approx(0.01)  # each where it belongs
    assert load_config(scene).path.speed == pytest.approx(0.006)


@pytest.mark.parametrize(
    ("key", "bare", "meant"),
    [
        ("path.speed", "5", "5 mm/s"),
        ("report.max", "1.5", "1.5 mm"),
        ("report.axis_p95", "4", "4 deg"),
        ("scene.pose.yaw", "90", "90 deg"),
        ("scene.pose.y", "-450", "-450 mm"),
        ("motion.period", "8", "8 ms"),
    ],
)
def test_a_bare_number_in_millimetres_or_degrees_is_asked_back_and_the_answer_works(key, bare, meant, capsys):
    assert main(["config", "straight", "--set", f"{key}={bare}"]) == 2
    said = capsys.readouterr().err
    assert said.count("\n") == 1
    assert f'"{meant}" is meant?' in said
    assert main(["config", "straight", "--set", f"{key}={meant}"]) == 0


def test_a_given_unit_is_not_asked_back(capsys):
    assert main(["config", "--set", "path.speed=5 m/s"]) == 2
    assert "is meant?" not in capsys.readouterr().err


@pytest.mark.parametrize(
    ("scene", "setting", "says"),
    [
        ("straight", "cylinder.radius=100 mm", "reads plate, groove, centre_line"),
        ("cylinder", "plate.length=100 mm", "reads cylinder, groove"),
        ("cuboid", "centre_line.shape=arc", "reads cuboid, groove"),
        ("plain", "groove.width=10 mm", "reads plate"),
        ("straight", "mesh={file='part.stl', units='mm'}", "reads plate, groove, centre_line"),
        ("cuboid", "pose.clearance=10 mm", "both say how high"),
    ],
)
def test_a_size_that_the_part_does_not_have_is_refused(scene, setting, says):
    with pytest.raises((SceneError, ConfigError)) as caught:
        load_scene(scene, [setting])
    assert says in str(caught.value)
    # what the file itself holds is no fault: a plate made plain keeps its [groove]
    assert load_scene("straight", ["workpiece=plain_plate"]).workpiece == "plain_plate"


def test_clamps_on_ones_own_part_are_refused(tmp_path):
    file = tmp_path / "mine.toml"
    file.write_text('workpiece = "mesh"\n[mesh]\nfile = "a.stl"\nunits = "mm"\n[fixture]\nclamps = 2\n')
    with pytest.raises(SceneError, match="own part has none"):
        load_scene(file)
    assert load_scene(file, ["fixture.clamps=0"]).fixture.clamps == 0


def test_every_limit_of_a_scene_is_one_of_the_cell():
    cell = {field.name for table in ("report", "motion") for field in fields(getattr(CellConfig(), table))}
    assert {field.name for field in fields(SceneConfig().limits)} <= cell | {"reason"}


def test_keys_that_may_be_meant():
    known = ["path.speed", "path.step", "scene.groove.width", "scene.plate.width"]
    assert meant_keys("width", known) == ["scene.groove.width", "scene.plate.width"]
    assert meant_keys("groove.width", known) == ["scene.groove.width"]
    assert meant_keys("cell.path.speed", known) == ["path.speed"]
    assert meant_keys("nothing.alike", known) == []


@pytest.mark.parametrize("line", ["y = -450 mm", "y = 12mm", "name = part one"])
def test_a_value_that_wants_quotes_is_told_with_them_and_is_toml_then(line, tmp_path):
    file = tmp_path / "part.toml"
    file.write_text(f"[pose]\n{line}\n")
    with pytest.raises(ConfigError, match="no TOML") as caught:
        load_toml(file)
    told = str(caught.value).partition("; write ")[2]
    file.write_text(f"[pose]\n{told}\n")
    assert load_toml(file)["pose"][line.partition(" ")[0]] == line.partition("= ")[2].strip("'")


def test_what_quotes_do_not_mend_is_not_told_to_want_them(tmp_path):
    file = tmp_path / "part.toml"
    file.write_text("[pose\n")
    with pytest.raises(ConfigError) as caught:
        load_toml(file)
    assert "; write" not in str(caught.value)


@pytest.mark.parametrize(
    ("setting", "meant"),
    [
        ("report.max=0.4", '"0.4 mm" is meant'),
        ("report.mean=0.2", '"0.2 mm" is meant'),
        ("report.tracking=0.3", '"0.3 mm" is meant'),
        ("report.coverage=95", '"95 %" is meant'),
        ("scene.limits.max=0.4", '"0.4 mm" is meant'),
    ],
)
def test_a_limit_that_was_meant_in_millimetres_or_percent_is_asked_back(setting: str, meant: str, capsys) -> None:
    assert main(["config", "straight", "--set", setting]) == 2
    assert meant in capsys.readouterr().err
    key = setting.partition("=")[0]
    assert main(["config", "straight", "--set", f"{key}={meant.split(chr(34))[1]}"]) == 0
