"""No number in a config is taken whatever it is: what would run for ever, or was meant in another unit, is refused in one line."""

import math

import pytest

from weldsim.config import CellConfig, load_config, load_scene, to_json
from weldsim.errors import WeldsimError
from weldsim.scene.config import SceneConfig, make_workpiece, part_pose

ANY = {"twin.seed"}  # names one of many units
TABLES = {  # which tables of a scene are read for which of the scenes that come with weldsim
    "curve": ("plate", "groove", "centre_line", "pose"),
    "cylinder": ("cylinder", "groove", "pose"),
    "cuboid": ("cuboid", "groove"),
    "y_branches": ("plate", "branches", "groove"),
}


def numbers(table: dict, lead: str = "") -> list[tuple[str, float]]:
    """Dotted key and default of every number."""
    out = []
    for key, value in table.items():
        if isinstance(value, dict):
            out += numbers(value, f"{lead}{key}.")
        elif isinstance(value, int | float) and not isinstance(value, bool):
            out.append((lead + key, value))
    return out


def cell(key: str, value: object) -> CellConfig:
    return load_config(None, [f"{key}={value}"])


def scene(name: str, key: str, value: object) -> SceneConfig:
    """A scene as it is checked before anything is drawn."""
    config = load_scene(name, [f"{key}={value}"])
    X_BP = part_pose(config.pose, make_workpiece(config))
    for view in config.views:
        view.pose(X_BP)
    return config


def refused(build, *args, named: bool = True) -> bool:
    """Whether it is; in one line, that names the key."""
    try:
        build(*args)
    except WeldsimError as error:
        message = str(error)
        assert "\n" not in message
        assert len(message) < 400
        assert not named or args[-2].rpartition(".")[2] in message
        return True
    return False


@pytest.mark.parametrize(("key", "default"), numbers(to_json(CellConfig())))
def test_every_number_of_the_cell_has_a_range(key: str, default: float) -> None:
    large = (10**12, 10**300) if isinstance(default, int) else ("1e7", "1e300")
    for value in large:
        assert refused(cell, key, value) is (key not in ANY)
        assert refused(cell, key, f"-{value}")
    for value in ("nan", "inf", "-inf", '"parsec"', "[1.0]", "true", "{a = 1}"):
        assert refused(cell, key, value)


@pytest.mark.parametrize("name", TABLES)
def test_every_size_of_a_scene_has_a_range(name: str) -> None:
    keys = [key for key, _ in numbers(to_json(load_scene(name))) if key.partition(".")[0] in TABLES[name]]
    assert len(keys) > 6
    for key in keys:
        if key == "branches.branches":  # one of two
            continue
        for value in ("1e3", "1e300", "-1e3", "-1e300", "nan", "inf", '"parsec"'):
            assert refused(scene, name, key, value)
        for value in ("0", "1e-9", "-1e-9"):  # taken or refused, but never an error of another kind
            refused(scene, name, key, value, named=False)


@pytest.mark.parametrize("key", ["standoff", "tilt", "heading", "roll", "shift_x", "shift_y", "shift_z"])
def test_every_number_of_a_view_has_a_range(key: str) -> None:
    for value in ("90", "1e300", "-1e300", '"parsec"'):
        with pytest.raises(WeldsimError, match=key):
            scene("straight", "views", f"[{{{key} = {value}}}]")


@pytest.mark.parametrize("pose", ["x = 400", "z = 1e300", "quaternion_wxyz = [0, 0, 0, 0]", "quaternion_wxyz = [1, 1, 1, 1]"])
def test_a_camera_pose_that_is_none_is_refused(pose: str) -> None:
    whole = {"x": "0.0", "y": "-0.4", "z": "0.5", pose.partition(" = ")[0]: pose.partition(" = ")[2]}
    text = ", ".join(f"{key} = {value}" for key, value in whole.items())
    with pytest.raises(WeldsimError, match=pose.partition(" = ")[0]):
        scene("straight", "views", f"[{{camera_in_base = {{{text}}}}}]")


def test_a_range_is_told_with_its_unit_and_the_whole_key() -> None:
    with pytest.raises(WeldsimError, match=r"config: execution\.simulation\.period = 8 s is outside 0\.0005 to 0\.1 s") as caught:
        cell("execution.simulation.period", 8)
    assert caught.value.data["key"] == "execution.simulation.period"
    with pytest.raises(WeldsimError, match=r"pose\.yaw = 90 rad is outside"):  # degrees without their unit
        scene("straight", "pose.yaw", 90)


@pytest.mark.parametrize(("low", "high"), [("min_width", "max_width"), ("max_width", "search_width")])
def test_widths_are_in_order(low: str, high: str) -> None:
    limit = getattr(CellConfig().seam.profile, high)
    with pytest.raises(WeldsimError, match=f"seam.profile.{high}"):
        cell(f"seam.profile.{low}", math.nextafter(limit, 1.0))


@pytest.mark.parametrize(
    ("key", "value", "meant"),
    [
        ("groove.width", "10", "10 mm"),
        ("groove.angle", "60", "60 deg"),  # one that may be left out has its unit all the same
        ("groove.root_gap", "4", "4 mm"),
        ("plate.length", "240", "240 mm"),
        ("centre_line.radius", "100", "100 mm"),
        ("fixture.overlap", "18", "18 mm"),
        ("pose.z", "30", "30 mm"),
        ("limits.max", "2", "2 mm"),
    ],
)
def test_a_size_in_millimetres_without_its_unit_is_asked_back(key: str, value: str, meant: str) -> None:
    with pytest.raises(WeldsimError, match=rf'{key} = {value} (m|rad) is outside .* (m|rad); "{meant}" is meant\?'):
        scene("straight", key, value)


def test_a_share_may_be_written_in_percent() -> None:
    assert cell("motion.least_speed", "30 %").motion.least_speed == pytest.approx(0.3)
    assert load_scene("straight", ['limits.least_speed="20%"']).limits.least_speed == pytest.approx(0.2)
    with pytest.raises(WeldsimError, match=r'limits\.least_speed = 30 is outside 0 to 1; "30 %" is meant\?'):
        scene("straight", "limits.least_speed", 30)
    with pytest.raises(WeldsimError, match="outside"):
        cell("motion.least_speed", "130 %")
