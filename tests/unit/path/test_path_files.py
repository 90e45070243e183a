"""Path files: what is written is read back, the same bytes each time, and a damaged document is one-line bad input."""

import copy
import json
from pathlib import Path

import numpy as np
import pytest
from numpy import ndarray

from weldsim.curves import arc_length, tangents
from weldsim.errors import InputError, OutputError
from weldsim.frames import Transform, matrix_from_rotation_vector
from weldsim.mounts import X_FT
from weldsim.path.files import (
    check_document,
    path_document,
    path_text,
    read_path_json,
    torch_paths,
    write_path_csv,
    write_path_json,
)
from weldsim.records import Seam, Segment, TorchPath


def make_path(rng: np.random.Generator, n: int = 40) -> tuple[Seam, TorchPath]:
    """A random curve with random torch orientations, and an approach and a retract around its weld."""
    points = np.cumsum(rng.uniform(0.5e-3, 2e-3, (n, 3)), axis=0) + rng.uniform(-0.5, 0.5, 3)
    up = np.tile([0.0, 0.0, 1.0], (n, 1))
    s = arc_length(points)
    seam = Seam(
        points_B=points,
        s=s,
        tangents_B=tangents(points),
        normals_B=up,
        sigma=rng.uniform(1e-5, 1e-3, n),
        width=0.014,
        confidence=0.9,
    )
    segments = (Segment.APPROACH,) * 3 + (Segment.WELD,) * (n - 5) + (Segment.RETRACT,) * 2
    weld = np.array([segment == Segment.WELD for segment in segments])
    R: ndarray = matrix_from_rotation_vector(rng.normal(size=(n, 3)))
    path = TorchPath(X_BT=Transform("BT", R, points), s=s, speed=np.full(n, 6e-3), arc_on=weld, segments=segments)
    return seam, path


def make_document(seed: int = 0, timing: float = 0.1) -> dict:
    seam, path = make_path(np.random.default_rng(seed))
    return path_document((seam,), (path,), {"seam": timing}, {"file": "cloud.ply"}, "abc")


@pytest.mark.parametrize("seed", range(5))
def test_document_read_back_holds_the_weld_poses(tmp_path: Path, seed: int) -> None:
    seam, path = make_path(np.random.default_rng(seed))
    document = path_document((seam,), (path,), {"seam": 0.1}, {"file": 'a },{ "b".ply'}, "abc")
    back = read_path_json(write_path_json(tmp_path / "p.json", document))
    assert back == document
    (torch,) = torch_paths(back)
    assert np.abs(torch.X_BT.p - path.X_BT.p[path.weld]).max() < 1e-9
    assert np.abs(torch.X_BT.R - path.X_BT.R[path.weld]).max() < 1e-8
    assert np.abs(torch.s - (path.s[path.weld] - path.s[3])).max() < 1e-9
    assert torch.arc_on.all()
    assert np.abs(np.array(back["seams"][0]["points"]) - seam.points_B).max() < 1e-9


def test_bytes_depend_on_the_input_and_not_on_the_clock() -> None:
    a, b = make_document(timing=0.1), make_document(timing=0.7)
    assert path_text(a) != path_text(b)
    assert path_text(a, timing=False) == path_text(b, timing=False)
    assert path_text(make_document(1), timing=False) != path_text(a, timing=False)


def test_no_seams_is_a_document_too(tmp_path: Path) -> None:
    document = path_document((), (), {}, {}, "abc")
    back = read_path_json(write_path_json(tmp_path / "p.json", document))
    assert back["seams"] == []
    assert torch_paths(back) == ()


@pytest.mark.parametrize("tool", ["torch", "tool0"])
def test_csv_rows_are_ur_poses(tmp_path: Path, tool: str) -> None:
    document = make_document(3)
    text = write_path_csv(tmp_path / "p.csv", document, tool=tool).read_text()  # type: ignore[arg-type]
    head = [line for line in text.splitlines() if line.startswith("#")]
    assert ("set_tcp(p[0,0,0,0,0,0])" in head[1]) == (tool == "tool0")
    rows = np.array([[float(v) for v in line.split(",")[1:]] for line in text.splitlines()[len(head) + 1 :]])
    X = Transform.from_rotation_vector("BT" if tool == "torch" else "BF", rows[:, 4:], rows[:, 1:4])
    tip = X if tool == "torch" else X @ X_FT
    (torch,) = torch_paths(document)
    assert np.abs(tip.p - torch.X_BT.p).max() < 1e-8
    assert np.abs(tip.R - torch.X_BT.R).max() < 1e-8


def _set(path: str, value: object):
    def change(document: dict) -> None:
        *keys, last = [int(k) if k.isdigit() else k for k in path.split(".")]
        for key in keys:
            document = document[key]
        document[last] = value  # type: ignore[index]

    return change


def _scale(factor: float):
    def change(document: dict) -> None:
        for seam in document["seams"]:
            seam["points"] = (np.array(seam["points"]) * factor).tolist()
            for pose in seam["poses"]:
                pose["position"] = [v * factor for v in pose["position"]]

    return change


DAMAGE = {
    "schema": (_set("schema", "weldsim.path/2"), "schema"),
    "frame": (_set("frame", "camera"), "frame"),
    "units": (_set("units", {"length": "mm", "angle": "deg"}), "units"),
    "seams": (_set("seams", None), "seams"),
    "nan": (_set("seams.0.poses.3.position", [0.1, float("nan"), 0.0]), "not finite"),
    "infinite": (_set("seams.0.points.3", [0.1, float("inf"), 0.0]), "not finite"),
    "quaternion": (_set("seams.0.poses.3.quaternion_wxyz", [1.0, 0.1, 0.0, 0.0]), r"poses\[3\]: quaternion length"),
    "short quaternion": (_set("seams.0.poses.3.quaternion_wxyz", [1.0, 0.0, 0.0]), "4 numbers"),
    "text": (_set("seams.0.poses.3.position", ["0.1", "x", "0"]), "3 numbers"),
    "missing": (_set("seams.0.poses.3", {}), "3 numbers"),
    "one pose": (lambda d: d["seams"][0].update(poses=d["seams"][0]["poses"][:1]), "needs two"),
    "one point": (lambda d: d["seams"][0].update(points=d["seams"][0]["points"][:1]), "needs two"),
    "millimetres": (_scale(1e3), "millimetres"),
    "backwards": (lambda d: d["seams"][0]["poses"].reverse(), "decreases"),
    "speed": (_set("seams.0.speed", -1.0), "not positive"),
}


@pytest.mark.parametrize("name", DAMAGE)
def test_damage_is_named_in_one_line(tmp_path: Path, name: str) -> None:
    change, message = DAMAGE[name]
    document = copy.deepcopy(make_document())
    change(document)
    file = tmp_path / "p.json"
    file.write_text(json.dumps(document))
    with pytest.raises(InputError, match=message) as error:
        read_path_json(file)
    assert "\n" not in str(error.value)
    assert "p.json" in str(error.value)


def test_any_cut_or_flipped_byte_is_bad_input_or_still_valid(tmp_path: Path) -> None:
    rng = np.random.default_rng(5)
    text = path_text(make_document()).encode()
    file = tmp_path / "p.json"
    for _ in range(150):
        data = bytearray(text[: rng.integers(1, len(text))] if rng.random() < 0.3 else text)
        for i in rng.integers(0, len(data), 3):
            data[i] = rng.integers(0, 256)
        file.write_bytes(bytes(data))
        try:
            check_document(read_path_json(file))
        except InputError as error:
            assert len(str(error).splitlines()) == 1  # noqa: PT017


def test_missing_file_and_unwritable_folder_are_bad_input(tmp_path: Path) -> None:
    with pytest.raises(InputError, match="cannot be read"):
        read_path_json(tmp_path / "none.json")
    with pytest.raises(OutputError, match="cannot be written"):
        write_path_json(tmp_path / "none" / "p.json", make_document())
    with pytest.raises(OutputError, match="folder"):
        write_path_json(tmp_path, make_document())
    assert list(tmp_path.iterdir()) == []


def test_seams_without_paths_are_refused() -> None:
    seam, path = make_path(np.random.default_rng(0))
    with pytest.raises(InputError, match="needs one"):
        path_document((seam,), (path, path), {}, {}, "")
