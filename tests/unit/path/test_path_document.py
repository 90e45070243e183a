"""One path document word by word, and each place of it that may be wrong, named with what stands there."""

import copy
import json
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from weldsim.errors import InputError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.path.files import check_document, path_document, path_text, read_path_json, torch_paths, write_path_csv
from weldsim.records import Seam, Segment, TorchPath

HALF = np.sqrt(0.5)
LINE = np.array([[0.0, -0.5, 0.1], [0.03, -0.5, 0.1], [0.03, -0.46, 0.1]])
S = np.array([0.0, 0.03, 0.07])


def seam(**more: Any) -> Seam:
    return Seam(
        points_B=LINE,
        s=S,
        tangents_B=np.array([[1.0, 0.0, 0.0], [HALF, HALF, 0.0], [0.0, 1.0, 0.0]]),
        normals_B=np.tile([0.0, 0.0, 1.0], (3, 1)),
        sigma=np.array([1e-4, 2e-4, 3e-4]),
        width=0.0123456789012,
        confidence=0.75,
        gaps=((0.01, 0.02),),
        **more,
    )


def path() -> TorchPath:
    """10 mm of approach, then the seam with the torch upside down, turning a quarter about the wire at its corner."""
    p = np.concatenate([LINE[:1] + np.array([0.0, 0.0, 0.01]), LINE])
    R = matrix_from_rotation_vector(np.array([[np.pi, 0.0, 0.0]] * 3 + [[np.pi * HALF, np.pi * HALF, 0.0]]))
    return TorchPath(
        X_BT=Transform("BT", R, p),
        s=np.concatenate([[0.0], 0.01 + S]),
        speed=np.array([0.1, 6e-3, 7e-3, 9e-3]),
        arc_on=np.array([False, True, True, True]),
        segments=(Segment.APPROACH, *(Segment.WELD,) * 3),
    )


def document() -> dict[str, Any]:
    return path_document((seam(step=0.001),), (path(),), {"seam": 0.12345678}, {"file": "a.ply"}, "abc")


def test_a_document_word_by_word() -> None:
    poses = [
        {"s": 0.0, "position": [0.0, -0.5, 0.1], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]},
        {"s": 0.03, "position": [0.03, -0.5, 0.1], "quaternion_wxyz": [0.0, 1.0, 0.0, 0.0]},
        {"s": 0.07, "position": [0.03, -0.46, 0.1], "quaternion_wxyz": [0.0, 0.707106781, 0.707106781, 0.0]},
    ]
    assert document() == {
        "schema": "weldsim.path/1",
        "frame": "base",
        "units": {"length": "m", "angle": "rad"},
        "seams": [
            {
                "id": "seam-1",
                "joint": "groove",
                "reference": "opening",
                "closed": False,
                "length": 0.07,
                "width": 0.012345679,
                "step": 0.001,
                "confidence": 0.75,
                "speed": 0.007,
                "points": LINE.tolist(),
                "sigma": [1e-4, 2e-4, 3e-4],
                "gaps": [[0.01, 0.02]],
                "poses": poses,
            }
        ],
        "refused": [],
        "timing": {"seam": 0.123457},
        "input": {"file": "a.ply"},
        "config_digest": "abc",
    }


def test_a_level_joint_has_no_step_and_a_seam_without_sigma_none() -> None:
    bare = Seam(points_B=LINE, s=S, tangents_B=seam().tangents_B, normals_B=seam().normals_B)
    (entry,) = path_document((bare,), (path(),), {}, {}, "")["seams"]
    assert "step" not in entry
    assert entry["sigma"] == []
    assert entry["gaps"] == []


def test_seams_keep_their_numbers_and_those_without_a_path_their_reason() -> None:
    seams = (seam(), seam(), seam())
    made = path_document(seams, (path(), None, None), {}, {}, "", numbers=(2, 5, 7), refused={1: "too short"})
    assert [entry["id"] for entry in made["seams"]] == ["seam-2"]
    assert made["refused"] == [
        {"id": "seam-5", "length": 0.07, "reason": "too short"},
        {"id": "seam-7", "length": 0.07, "reason": "no path"},
    ]
    with pytest.raises(InputError, match="1 seam and 2 torch paths") as caught:
        path_document((seam(),), (path(), path()), {}, {}, "")
    assert caught.value.data == {"seams": 1}


def test_text_has_a_pose_a_line_and_says_the_same() -> None:
    lines = path_text(document()).splitlines()
    assert len(lines) == 6
    assert lines[2] == '{"s":0.0,"position":[0.0,-0.5,0.1],"quaternion_wxyz":[0.0,1.0,0.0,0.0]},'
    assert json.loads(path_text(document())) == document()
    assert json.loads(path_text(document(), timing=False)) == {**document(), "timing": {}}
    assert lines[0].startswith('{"schema":"weldsim.path/1","frame":"base","units":{"length":"m","angle":"rad"},"refused":[],')
    assert lines[1].startswith('"seams":[{"id":"seam-1","joint":"groove",')
    assert '"file":"Grün"' in path_text({**document(), "input": {"file": "Grün"}})
    assert '"id":"Naht ü"' in path_text(changed("seams.0.id", "Naht ü"))
    for place in ("seams.0.poses.1.s", "seams.0.length", "config_digest"):
        with pytest.raises(ValueError, match="not JSON compliant"):
            path_text(changed(place, float("nan")))


def test_text_of_several_seams_is_read_back_and_holds_each_pose_once() -> None:
    two = path_document((seam(), seam()), (path(), path()), {}, {}, "abc")
    text = path_text(two)
    assert json.loads(text) == two
    assert text.count('"poses":') == 2
    assert text.count('"position":') == 6


def test_nought_has_no_sign(tmp_path: Path) -> None:
    """Less than half a nanometre is rounded to nought, whose sign differs between machines."""
    moved = replace(path(), X_BT=Transform("BT", path().X_BT.R, path().X_BT.p - np.array([4e-10, 0.0, 0.1])))
    made = path_document((seam(),), (moved,), {}, {}, "abc")
    assert made["seams"][0]["poses"][0]["position"] == [0.0, -0.5, 0.0]
    assert "-0.0" not in path_text(made)
    made["seams"][0]["poses"][0]["position"][0] = -4e-10
    row = write_path_csv(tmp_path / "p.csv", made).read_text().splitlines()[3]
    assert row.startswith("seam-1,0.000000000,0.000000000,-0.500000000,0.000000000,")


def test_whole_numbers_in_a_file_are_metres_too() -> None:
    whole = changed("seams.0.poses", [{"s": i, "position": [i, 0, 0], "quaternion_wxyz": [1, 0, 0, 0]} for i in (0, 1)])
    check_document(whole)
    (torch,) = torch_paths(whole)
    assert {values.dtype for values in (torch.s, torch.X_BT.p, torch.X_BT.R)} == {np.dtype(float)}
    np.testing.assert_array_equal(torch.X_BT.p, [[0.0, 0.0, 0.0], [1.0, 0.0, 0.0]])


def test_what_is_read_back_is_a_weld_at_the_seams_speed(tmp_path: Path) -> None:
    file = tmp_path / "p.json"
    file.write_text("\ufeff" + path_text(document()), encoding="utf-8")
    (torch,) = torch_paths(read_path_json(file))
    np.testing.assert_allclose(torch.X_BT.p, LINE)
    np.testing.assert_allclose(torch.s, S)
    np.testing.assert_array_equal(torch.speed, [0.007] * 3)
    assert torch.segments == (Segment.WELD,) * 3
    assert torch.arc_on.all()
    other = document()
    del other["seams"][0]["speed"]
    assert torch_paths(other)[0].speed.tolist() == [6e-3] * 3
    assert torch_paths(other, speed=0.004)[0].speed.tolist() == [0.004] * 3


def test_csv_line_by_line(tmp_path: Path) -> None:
    lines = write_path_csv(tmp_path / "p.csv", document()).read_text().splitlines()
    assert "poses of the torch tip (TCP) in the UR controller's base" in lines[0]
    assert lines[1] == "# run with set_tcp(p[0.000000,0.048000,0.227000,-0.849975,0.000000,0.000000])"
    assert lines[2] == "seam,s,x,y,z,rx,ry,rz"
    assert lines[4] == "seam-1,0.030000000,0.030000000,-0.500000000,0.100000000,3.141592654,0.000000000,0.000000000"
    assert lines[5].split(",")[5:] == ["2.221441469", "2.221441469", "0.000000000"]
    bare = write_path_csv(tmp_path / "q.csv", document(), tool="tool0").read_text().splitlines()
    assert "tool0 (bare flange)" in bare[0]
    assert bare[1] == "# run with set_tcp(p[0,0,0,0,0,0])"


def changed(place: str, value: Any) -> dict[str, Any]:
    """The document with a value at a place such as seams.0.id; "missing" takes it away."""
    made = copy.deepcopy(document())
    inner: Any = made
    *keys, last = [int(key) if key.isdigit() else key for key in place.split(".")]
    for key in keys:
        inner = inner[key]
    if value == "missing":
        del inner[last]
    else:
        inner[last] = value
    return made


def poses(*s: float, apart: float = 0.001, y: float = 0.0) -> list[dict[str, Any]]:
    """Poses along x, a millimetre or more apart, at some arc lengths [m]."""
    return [{"s": at, "position": [apart * i, y, 0.0], "quaternion_wxyz": [1.0, 0.0, 0.0, 0.0]} for i, at in enumerate(s)]


WRONG = [
    ("schema", "other/1", r"schema 'other/1', expected 'weldsim\.path/1'"),
    ("schema", "missing", "schema None"),
    ("frame", "tool", "frame 'tool', expected 'base'"),
    ("units", {"length": "m", "angle": "deg"}, "units must be m and rad"),
    ("seams", {}, "seams is no list"),
    ("seams.0", 3, r"seams\[0\]: is no object"),
    ("seams.0.id", 7, r"seams\[0\]: id 7 is no text"),
    ("seams.0.speed", 0.0, r"seams\[0\]: speed 0\.0 m/s is not positive"),
    ("seams.0.speed", True, "speed True"),
    ("seams.0.speed", "fast", "speed 'fast'"),
    ("seams.0.speed", float("inf"), "speed inf"),
    ("seams.0.points", "missing", r"seams\[0\]\.points: must be a list of 3 numbers each"),
    ("seams.0.points", [[0.0, 0.0], [1.0, 0.0]], r"points: must be a list of 3 numbers each"),
    ("seams.0.points", [[0.0, 0.0, 0.0]], r"seams\[0\]: 1 point; a seam needs two"),
    ("seams.0.points", [[0.0, 0.0, 0.0], [6.0, 0.0, 0.0]], r"points: spans 6 m \(limit 5 m\): looks like millimetres"),
    ("seams.0.sigma", [[0.0]], r"sigma: must be a list of numbers"),
    ("seams.0.sigma", [0.0, float("nan")], r"sigma: 1 value is not finite"),
    ("seams.0.sigma", 0.1, r"sigma: must be a list of numbers"),
    ("seams.0.sigma", ["little"], r"sigma: must be a list of numbers"),
    ("seams.0.gaps", [0.1, 0.2], r"gaps: must be a list of 2 numbers each"),
    ("seams.0.gaps", [[0.1, 0.2], [0.3]], r"gaps: must be a list of 2 numbers each"),
    ("seams.0.poses", {}, "poses is no list of objects"),
    ("seams.0.poses", [1, 2], "poses is no list of objects"),
    ("seams.0.poses", poses(0.0), "1 pose; a path needs two"),
    ("seams.0.poses.1.position", [0.0, 0.0], r"position: must be a list of 3 numbers each"),
    ("seams.0.poses.1.position", [0.0, 6.0, 0.0], r"position: spans 6\.5 m"),
    ("seams.0.poses.1.quaternion_wxyz", "missing", r"quaternion_wxyz: must be a list of 4 numbers each"),
    ("seams.0.poses.1.quaternion_wxyz", [0.0, 1.0 + 2e-6, 0.0, 0.0], r"poses\[1\]: quaternion length is off 1 by 2e-06"),
    ("seams.0.poses.1.s", "missing", r"s: must be a list of numbers"),
    ("seams.0.poses.1.s", 0.08, "s decreases along the poses"),
    ("seams.0.poses", [{**pose, "position": [0.0, 0.0, 0.0]} for pose in poses(0.0, 0.1)], "all 2 poses are in one place"),
    ("seams.0.poses", poses(0.0, 0.0021), r"s goes over 0\.0021 m, the positions over 0\.001 m \(limit 2 times\)"),
    ("seams.0.poses", poses(0.0, 0.00049), r"s goes over 0\.00049 m"),
]


@pytest.mark.parametrize(("place", "value", "told"), WRONG, ids=[f"{w[0]}-{i}" for i, w in enumerate(WRONG)])
def test_what_is_wrong_is_named_with_its_place(place: str, value: Any, told: str) -> None:
    with pytest.raises(InputError, match=told) as caught:
        check_document(changed(place, value), where="p.json")
    assert str(caught.value).startswith("p.json: ")
    assert str(caught.value.data["where"]).startswith("p.json")


@pytest.mark.parametrize(
    ("place", "value"),
    [
        *((f"seams.0.{name}", "missing") for name in ("sigma", "gaps", "speed")),
        ("seams.0.speed", 1),
        ("seams.0.points", [[0, 0, 0], [5, 0, 0]]),
        ("seams.0.poses.1.quaternion_wxyz", [0.0, 1.0 - 0.9e-6, 0.0, 0.0]),
        ("seams.0.poses", poses(0.0, 0.0, 0.002)),
        ("seams.0.poses", poses(1.0, 1.0019)),
        ("seams.0.poses", poses(0.0, 0.00051)),
        *(("seams.0.poses", poses(0.0, told, apart=2.0**-4)) for told in (2.0**-3, 2.0**-5)),  # twice and half the way exactly
        ("seams.0.poses", poses(0.0, 0.001, y=7.0)),  # far away, as of a robot on a gantry
    ],
)
def test_what_is_at_its_limit_or_left_out_is_well(place: str, value: Any) -> None:
    check_document(changed(place, value))


def test_what_is_no_document_is_said_so() -> None:
    with pytest.raises(InputError, match=r"^path document: holds no JSON object"):
        check_document([document()])


def test_what_cannot_be_read_is_told_with_its_file(tmp_path: Path) -> None:
    file = tmp_path / "p.json"
    for text, told in (
        (None, r"p\.json: cannot be read \(No such file or directory\)$"),
        ("{", "is no JSON"),
        ("[" * 100_000, "is no JSON"),
    ):
        if text is not None:
            file.write_text(text)
        with pytest.raises(InputError, match=told) as caught:
            read_path_json(file)
        assert caught.value.data == {"path": str(file)}
