"""Part and fixture stand on the table, whole, clear of the arm's base: else the scene is refused, with a place that will do."""

import re
from dataclasses import replace

import numpy as np
import pytest

from weldsim.config import load_scene
from weldsim.errors import SceneError
from weldsim.scene.config import FixtureConfig, PartPoseConfig, SceneConfig
from weldsim.scene.files import scene_names
from weldsim.scene.standing import Standing
from weldsim.scene.workpieces.plate import PlateConfig
from weldsim.scene.world import build_world

LENGTH, WIDTH = 0.24, 0.20  # [m] of the plate here
BASE = 0.076  # [m] radius of the arm's base
TABLE = ((-0.60, 0.60), (-0.84, 0.20))  # [m] its top in B


def plate(x: float = 0.0, y: float = -0.45, clamps: int = 0, length: float = LENGTH, **pose: float) -> SceneConfig:
    return SceneConfig(
        plate=PlateConfig(length=length, width=WIDTH),
        pose=PartPoseConfig(x=x, y=y, **pose),
        fixture=FixtureConfig(clamps=clamps),  # type: ignore[arg-type]
    )


@pytest.fixture(scope="module")
def bare() -> Standing:
    return Standing(model=build_world(plate()).model)


@pytest.mark.parametrize("name", scene_names())
def test_what_comes_with_weldsim_stands_well(name: str) -> None:
    world = build_world(load_scene(name))
    assert Standing(model=world.model).fault() is None
    assert world.notes == ()


def depth(fault: str | None, what: str) -> float:
    """The millimetres that a fault tells of `what`, 0 where it is not of that."""
    found = re.search(rf"the part stands (\d+) mm {what}", fault or "")
    return float(found[1]) if found else 0.0


@pytest.mark.parametrize("gap", [-0.15, -0.04, -0.002, 0.002, 0.05])
@pytest.mark.parametrize("side", [(0, 1), (0, -1), (1, 1), (1, -1)])
def test_a_part_in_the_base_is_told_by_its_depth(bare: Standing, gap: float, side: tuple[int, int]) -> None:
    """The plate's side `gap` away from the base's outline, from all four sides."""
    axis, sign = side
    middle = np.zeros(3)
    middle[axis] = sign * (BASE + (LENGTH, WIDTH)[axis] / 2 + gap)
    told = depth(bare.fault(middle - [0.0, -0.45, 0.0]), "inside the arm's base")
    assert told == pytest.approx(max(-1e3 * gap, 0.0), abs=1.0)


@pytest.mark.parametrize("over", [-0.003, 0.004, 0.12, 0.5])
@pytest.mark.parametrize(("axis", "end"), [(0, 0), (0, 1), (1, 0), (1, 1)])
def test_a_part_beside_the_table_is_told_by_its_overhang(bare: Standing, over: float, axis: int, end: int) -> None:
    middle = np.array([0.25, -0.45, 0.0])
    middle[axis] = TABLE[axis][end] + (1 if end else -1) * (over - (LENGTH, WIDTH)[axis] / 2)
    fault = bare.fault(middle - [0.0, -0.45, 0.0])
    assert depth(fault, "beyond the table's edge") == pytest.approx(max(1e3 * over, 0.0), abs=1.0)
    if over > 0:
        assert fault is not None
        assert f"{'xy'[axis]} = {1e3 * TABLE[axis][end]:.0f} mm" in fault


def test_a_part_below_the_table_is_told_by_its_depth(bare: Standing) -> None:
    assert bare.fault(np.array([0.0, 0.0, -0.0123])) == "the part lies 12.3 mm below the table's top"


def test_clamps_and_legs_are_looked_at_too() -> None:
    clamped = Standing(model=build_world(plate(clamps=4)).model)
    # The plate ends 60 mm before the edge and before the base; its clamps reach further.
    assert "what holds the part" in str(clamped.fault(np.array([0.0, -0.84 + 0.06 + WIDTH / 2 + 0.45, 0.0])))
    assert "clamp_" in str(clamped.fault(np.array([0.072, -BASE - 0.06 - WIDTH / 2 + 0.45, 0.0])))
    raised = Standing(model=build_world(plate(clearance=0.15)).model)
    assert "beyond the table's edge" in str(raised.fault(np.array([0.55, 0.0, 0.0])))
    # Nothing can be over the base either: there is the arm.
    assert "inside the arm's base" in str(raised.fault(np.array([0.0, 0.45, 0.0])))


@pytest.mark.parametrize(("x", "y"), [(0.1, 0.1), (0.0, 0.0), (0.55, -0.45), (-0.9, -0.2), (0.2, -0.8), (0.55, 0.15), (3.0, 3.0)])
@pytest.mark.parametrize("clamps", [0, 4])
def test_the_place_that_is_named_will_do(x: float, y: float, clamps: int) -> None:
    scene = plate(x, y, clamps, yaw=0.3)
    with pytest.raises(SceneError, match="pose of scene") as refused:
        build_world(scene)
    found = re.search(r'pose\.x = "(\S+) mm", pose\.y = "(\S+) mm"$', str(refused.value))
    assert found is not None
    there = replace(scene.pose, x=float(found[1]) / 1e3, y=float(found[2]) / 1e3)
    build_world(replace(scene, pose=there))


def test_a_part_that_hangs_in_the_air_is_told() -> None:
    hanging = replace(plate(clearance=0.035), fixture=FixtureConfig(clamps=0, stand=False))
    assert build_world(hanging).notes == ("the part hangs in the air, 35 mm above the table: nothing stands under it",)
    assert build_world(replace(hanging, fixture=FixtureConfig(clamps=0))).notes == ()


def test_a_part_larger_than_the_table_may_hang_over_and_is_told() -> None:
    world = build_world(plate(length=1.3))
    assert world.notes == ("the part is larger than the table (1200 x 1040 mm) and reaches 50 mm beyond its edge",)
    with pytest.raises(SceneError, match="beyond the table's edge"):
        build_world(plate(x=0.7, length=1.3))


def test_a_moved_cell_is_judged_as_a_scene_there() -> None:
    from weldsim.dryrun.cell import scene_cell

    cell = scene_cell(plate(clamps=2))
    for move in ([0.1, 0.55, 0.0], [0.0, 0.32, 0.0], [0.5, 0.0, 0.0], [0.0, -0.4, 0.0], [-0.2, 0.1, 0.0]):
        fault = cell.misplaced(np.array(move))
        halfway = cell.moved(np.array(move) / 2)
        assert halfway.misplaced(np.array(move) / 2) == fault
        assert _fault_of(plate(move[0], move[1] - 0.45, clamps=2)) == fault


def _fault_of(scene: SceneConfig) -> object:
    """What keeps a scene from being built."""
    try:
        build_world(scene)
    except SceneError as error:
        return error.data["fault"]
    return None
