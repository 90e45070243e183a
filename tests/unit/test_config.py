"""TOML to config dataclasses and back: what is accepted, and the one line that refuses the rest."""

import json
import subprocess
import sys
from dataclasses import dataclass, field
from enum import StrEnum
from typing import Literal

import pytest

from weldsim.config import (
    CellConfig,
    apply_overrides,
    describe,
    digest,
    limits_for,
    load_config,
    load_scene,
    load_toml,
    paced_for,
    structure,
    to_json,
)
from weldsim.errors import ConfigError
from weldsim.quantity import Metre, MetrePerSecond, Radian


class Shape(StrEnum):
    SINE = "sine"
    TRIANGLE = "triangle"


@dataclass(frozen=True, kw_only=True)
class Weave:
    amplitude: Metre = 0.002
    """Half of the width swept."""
    shape: Shape = Shape.SINE


@dataclass(frozen=True, kw_only=True)
class Job:
    """A job of every type.

    Attributes:
        name: what it is called.
        speed: of the torch tip, along
            the seam.
        work, travel: process angles [rad].  mode: how it starts.
    """

    name: str
    speed: MetrePerSecond = 0.008
    work: Radian = 0.0
    travel: Radian = 0.0
    mode: Literal["cold", "hot", 3] = "cold"
    passes: int = 1
    ratio: float = 0.5
    on: bool = True
    corner: tuple[Metre, Metre, Metre] | None = None
    stops: tuple[Metre, ...] = ()
    width: Metre | Literal["auto"] = "auto"
    weave: Weave = field(default_factory=Weave)
    layers: tuple[Weave, ...] = ()


FULL = {
    "name": "a",
    "speed": "6 mm/s",
    "work": "45 deg",
    "mode": 3,
    "passes": 2,
    "ratio": 1,
    "on": False,
    "corner": ["1 mm", 0.5, "2 cm"],
    "stops": ["1 in", 0],
    "width": "7 mm",
    "weave": {"amplitude": "3 mm", "shape": "triangle"},
    "layers": [{}, {"amplitude": 0.001}],
}


def test_every_type_is_read() -> None:
    job = structure(FULL, Job)
    assert (job.speed, job.mode, job.passes, job.ratio, job.on) == (pytest.approx(0.006), 3, 2, 1.0, False)
    assert job.work == pytest.approx(0.785398163)
    assert job.corner == pytest.approx((0.001, 0.5, 0.02))
    assert job.stops == pytest.approx((0.0254, 0.0))
    assert job.width == pytest.approx(0.007)
    assert structure({"name": "a"}, Job).width == "auto"
    assert job.weave == Weave(amplitude=0.003, shape=Shape.TRIANGLE)
    assert job.layers == (Weave(), Weave(amplitude=0.001))
    assert isinstance(job.ratio, float)


def test_json_reads_back_as_the_same_config() -> None:
    job = structure(FULL, Job)
    assert structure(json.loads(json.dumps(to_json(job))), Job) == job
    assert structure(to_json(CellConfig()), CellConfig) == CellConfig()


@pytest.mark.parametrize(
    ("change", "key", "words"),
    [
        ({"sped": 1}, "sped", ["unknown key 'sped'", "did you mean speed?", "allowed: name, speed"]),
        ({"weave": {"amplitud": 1}}, "weave.amplitud", ["unknown key 'weave.amplitud'", "allowed: amplitude, shape"]),
        ({"weave": {"amplitude": "3 kg"}}, "weave.amplitude", ["weave.amplitude", "'kg'", "mm"]),
        ({"weave": {"amplitude": True}}, "weave.amplitude", ["True is no quantity in m"]),
        ({"weave": {"amplitude": float("nan")}}, "weave.amplitude", ["not finite"]),
        ({"weave": {"amplitude": 10**400}}, "weave.amplitude", ["weave.amplitude"]),
        ({"weave": {"shape": "sin"}}, "weave.shape", ["'sin'", "sine, triangle", "did you mean sine?"]),
        ({"weave": []}, "weave", ["[] is no table"]),
        ({"layers": [{}, {"amplitude": "x"}]}, "layers[1].amplitude", ["layers[1].amplitude: 'x'"]),
        ({"layers": [3]}, "layers[0]", ["layers[0]: 3 is no table"]),
        ({"layers": "ab"}, "layers", ["layers: 'ab'"]),
        ({"corner": [1, 2]}, "corner", ["holds 2 values, 3 are needed"]),
        ({"corner": [1, 2, "3 s"]}, "corner[2]", ["corner[2]", "unit 's'"]),
        ({"mode": "warm"}, "mode", ["'warm' is not one of cold, hot, 3"]),
        ({"mode": 3.0}, "mode", ["not one of"]),
        ({"passes": 2.0}, "passes", ["2.0 is no whole number"]),
        ({"passes": "2"}, "passes", ["'2' is no whole number"]),
        ({"passes": True}, "passes", ["no whole number"]),
        ({"ratio": "1"}, "ratio", ["'1' is no number"]),
        ({"ratio": float("inf")}, "ratio", ["inf is no number"]),
        ({"on": 1}, "on", ["1 is no true | false"]),
        ({"on": "false"}, "on", ["'false' is no true | false"]),
        ({"name": 3}, "name", ["3 is no text"]),
        ({"width": "wide"}, "width", ["'wide' is no quantity in m | 'auto'"]),
        ({"a": 1, "b": 2}, "a", ["unknown key 'a'", "and 1 more"]),
    ],
)
def test_a_fault_is_one_line_with_its_dotted_path(change: dict, key: str, words: list[str]) -> None:
    with pytest.raises(ConfigError) as caught:
        structure(FULL | change, Job, where="job.toml")
    message = str(caught.value)
    assert message.startswith("job.toml: ")
    assert "\n" not in message
    for word in words:
        assert word in message
    assert caught.value.data["key"] == key


def test_a_missing_key_is_named() -> None:
    with pytest.raises(ConfigError, match="key 'name' is missing"):
        structure({}, Job)


def test_a_check_of_the_dataclass_itself_is_led_by_its_table() -> None:
    with pytest.raises(ConfigError, match=r"config: cloud: crop box: z from 2 m to 1 m"):
        structure({"cloud": {"crop_min": [0, 0, "2 m"], "crop_max": [1, 1, 1]}}, CellConfig)


def test_overrides_reach_into_tables_and_leave_the_original_alone() -> None:
    data = {"weave": {"amplitude": 1.0}}
    texts = [
        "name=b c",
        "weave.shape=sine",
        "weave.amplitude = 12 mm",
        "on=false",
        "passes=4",
        'stops=["1 mm", 2]',
        "mode=hot=cold",
    ]
    result = apply_overrides(data, texts)
    assert result["weave"] == {"amplitude": "12 mm", "shape": "sine"}
    assert (result["name"], result["on"], result["passes"], result["stops"]) == ("b c", False, 4, ["1 mm", 2])
    assert result["mode"] == "hot=cold"
    assert data == {"weave": {"amplitude": 1.0}}
    assert apply_overrides({}, ["name=1\nb=2"]) == {"name": "1\nb=2"}


@pytest.mark.parametrize("text", ["", "a", "=3", "a..b=3", ".a=3", "name.x=3"])
def test_an_override_that_leads_nowhere_is_refused(text: str) -> None:
    with pytest.raises(ConfigError, match="override"):
        apply_overrides({"name": "a"}, [text])


@pytest.mark.parametrize(
    ("content", "word"),
    [(b"a = \n", "line 1"), (b"a = 1\na = 2", "no TOML"), (b"\xff\xfe", "UTF-8"), (b"a = " + b"[" * 99999, "TOML")],
)
def test_a_bad_toml_file_is_one_line(tmp_path, content: bytes, word: str) -> None:
    path = tmp_path / "x.toml"
    path.write_bytes(content)
    with pytest.raises(ConfigError, match=word) as caught:
        load_toml(path)
    assert str(path) in str(caught.value)
    assert "\n" not in str(caught.value)


def test_a_file_that_cannot_be_read_is_one_line(tmp_path) -> None:
    with pytest.raises(ConfigError, match="no such file"):
        load_toml(tmp_path / "missing.toml")
    with pytest.raises(ConfigError, match="cannot be read"):
        load_toml(tmp_path)


def test_file_then_overrides(tmp_path) -> None:
    path = tmp_path / "cell.toml"
    path.write_text('[cloud]\nvoxel = "1 mm"\noutlier_neighbours = 3\n')
    config = load_config(path, ["cloud.voxel=2 mm"])
    assert config.cloud.voxel == pytest.approx(0.002)
    assert config.cloud.outlier_neighbours == 3
    assert load_config() == CellConfig()
    path.write_text("[cloud]\nvoxl = 1\n")
    with pytest.raises(ConfigError, match=r"cell\.toml: unknown key 'cloud\.voxl'"):
        load_config(path)


def test_digest_depends_on_values_alone() -> None:
    base = load_config()
    assert len(digest(base)) == 16
    assert digest(base) == digest(load_config(overrides=["cloud.voxel=0 mm"]))
    assert digest(base) != digest(load_config(overrides=["cloud.voxel=1 mm"]))


def test_every_field_of_every_stage_is_documented() -> None:
    lines = describe(CellConfig)
    assert [line.key for line in lines if not line.doc] == []
    assert len({line.key for line in lines}) == len(lines)


def test_describe_reads_both_kinds_of_docstring() -> None:
    lines = {line.key: line for line in describe(Job)}
    assert lines["speed"].doc == "of the torch tip, along the seam."
    assert lines["speed"].unit == "m/s"
    assert lines["travel"].doc == "process angles [rad]."
    assert lines["mode"].doc == "how it starts."
    assert lines["name"].default == "required"
    assert lines["weave.amplitude"].doc == "Half of the width swept."
    assert lines["layers[].amplitude"].default == "0.002"
    assert lines["corner"].unit == "m"
    assert lines["weave.shape"].default == '"sine"'


def test_reading_a_config_loads_no_heavy_library() -> None:
    heavy = {"open3d", "mujoco", "numba", "trimesh", "mink", "plotly", "matplotlib"}
    code = f"import sys, weldsim.config; print(sorted({heavy} & set(sys.modules)))"
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, check=True)
    assert done.stdout.strip() == "[]"


def test_a_scene_has_limits_of_its_own_and_the_config_goes_before_them() -> None:
    cuboid, straight = load_scene("cuboid"), load_scene("straight")
    general = CellConfig()
    assert limits_for(general, straight) == general.report
    assert limits_for(general, cuboid).max == cuboid.limits.max != general.report.max
    assert limits_for(load_config(overrides=["report.max=3 mm"]), cuboid).max == 0.003

    assert paced_for(general, None) == paced_for(general, straight) == general
    slow = load_scene("cuboid", overrides=["limits.least_speed=0.1"])
    assert paced_for(general, cuboid) == general
    assert paced_for(general, slow).motion.least_speed == 0.1
    assert paced_for(load_config(overrides=["motion.least_speed=0.7"]), slow).motion.least_speed == 0.7
    with pytest.raises(ConfigError, match="least_speed"):
        load_scene("cuboid", overrides=["limits.least_speed=1.5"])
