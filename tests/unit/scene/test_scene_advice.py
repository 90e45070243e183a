"""What a refused scene is told to do, done: it can be built then."""

import re

import pytest

from weldsim.config import load_scene
from weldsim.errors import WeldsimError
from weldsim.scene.world import build_world


@pytest.mark.parametrize(
    ("scene", "settings", "says", "followed"),
    [
        ("straight", ["pose.z=-30 mm"], r"use ([\d.]+) mm or more", ["pose.z={} mm"]),
        ("cylinder", ["fixture.bolts=2"], r"use bolts = (0)", ["fixture.bolts={}"]),
        ("curve", ["centre_line.radius=5 mm"], r"use ([\d.]+) mm or more", ["centre_line.radius={} mm"]),
        (
            "curve",
            ["centre_line.shape=arc", "centre_line.radius=10 mm"],
            r"use a radius over ([\d.]+) mm",
            ["centre_line.shape=arc", "centre_line.radius={}.1 mm"],
        ),
        ("straight", ["groove.depth=25 mm"], r"make the groove shallower or (the plate) thicker", ["groove.depth=15 mm"]),
        (
            "straight",
            ["groove.depth=25 mm"],
            r"make the groove shallower or (the plate) thicker",
            ["groove.depth=25 mm", "plate.thickness=30 mm"],
        ),
        (
            "straight",
            ["plate.width=10 mm"],
            r"make the groove narrower, (the plate) wider",
            ["plate.width=150 mm"],
        ),
        ("straight", ["fixture.clamps=3"], r"is not one of 0, 2, (4)", ["fixture.clamps={}"]),
        ("straight", ["fixture.overlap=300 mm"], r"at most (\d+) mm", ["fixture.overlap={} mm"]),
        ("straight", ["groove.root_gap=20 mm"], r"must be 0 to the width (\d+) mm", ["groove.root_gap=2 mm"]),
        ("straight", ["views=[{standoff='50 mm'}]"], r"must be 100 to (2000) mm", ["views=[{{standoff='100 mm'}}]"]),
        ("straight", ["views=[]"], r"give (one) at least", ["views=[{{standoff='400 mm'}}]"]),
        ("y_branches", ["groove.width=60 mm"], r"make the plate larger, (the groove) narrower", ["groove.width=14 mm"]),
        ("cuboid", ["groove.depth=250 mm"], r"use less than ([\d.]+) mm", ["groove.depth=60 mm"]),
        (
            "straight",
            ["pose.y=0 mm"],
            r"pose\.x = \"(\S+ mm)\", pose\.y = \"(\S+ mm)\"$",
            ["pose.x={}", "pose.y={}"],
        ),
    ],
)
def test_the_advice_of_a_refused_scene_works(scene: str, settings: list[str], says: str, followed: list[str]) -> None:
    with pytest.raises(WeldsimError) as caught:
        build_world(load_scene(scene, settings))
    assert "\n" not in str(caught.value)
    told = re.search(says, str(caught.value))
    assert told, str(caught.value)
    values = iter(told.groups())
    assert build_world(load_scene(scene, [one.format(next(values)) if "{}" in one else one.format() for one in followed]))
