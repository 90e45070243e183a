"""What stands in the files that weldsim writes."""

import csv

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from weldsim.curves import arc_length, tangents
from weldsim.errors import OutputError
from weldsim.frames import Transform
from weldsim.mounts import X_FT
from weldsim.output import write_whole
from weldsim.path.files import path_document, path_text, write_path_csv
from weldsim.records import Seam, Segment, TorchPath


@pytest.fixture(scope="module")
def path() -> TorchPath:
    rotations = Rotation.random(5, random_state=3).as_matrix()
    positions = np.linspace([0.1, -0.4, 0.02], [0.2, -0.5, 0.03], 5)
    return TorchPath(
        X_BT=Transform("BT", rotations, positions),
        s=arc_length(positions),
        speed=np.full(5, 6e-3),
        arc_on=np.ones(5, bool),
        segments=(Segment.WELD,) * 5,
    )


@pytest.fixture(scope="module")
def document(path: TorchPath) -> dict:
    line = path.X_BT.p
    normals = np.tile([0.0, 0.0, 1.0], (5, 1))
    seam = Seam(points_B=line, s=arc_length(line), tangents_B=tangents(line), normals_B=normals, width=0.014)
    return path_document((seam,), (path,), {"seam": 0.1}, {"file": "cloud.ply"}, "digest")


def test_path_json_is_in_metres_and_the_base_with_quaternions_wxyz(document, path):
    assert document["schema"] == "weldsim.path/1"
    assert document["frame"] == "base"
    assert document["units"] == {"length": "m", "angle": "rad"}
    poses = document["seams"][0]["poses"]
    np.testing.assert_allclose([pose["position"] for pose in poses], path.X_BT.p, atol=1e-9)
    wxyz = np.array([pose["quaternion_wxyz"] for pose in poses])
    np.testing.assert_allclose(Rotation.from_quat(np.roll(wxyz, -1, axis=1)).as_matrix(), path.X_BT.R, atol=1e-8)


def test_path_csv_holds_ur_poses(document, path, tmp_path):
    def table(tool: str) -> np.ndarray:
        with write_path_csv(tmp_path / f"{tool}.csv", document, tool=tool).open() as file:
            rows = csv.DictReader(line for line in file if not line.startswith("#"))
            return np.array([[float(row[key]) for key in ("x", "y", "z", "rx", "ry", "rz")] for row in rows])

    for tool, X in (("torch", path.X_BT), ("tool0", path.X_BT @ X_FT.inverse())):
        poses = table(tool)
        np.testing.assert_allclose(poses[:, :3], X.p, atol=1e-8)
        np.testing.assert_allclose(Rotation.from_rotvec(poses[:, 3:]).as_matrix(), X.R, atol=1e-8)


def test_the_same_inputs_give_the_same_bytes_of_path(document):
    later = {**document, "timing": {"seam": 0.7}}
    assert path_text(document, timing=False) == path_text(later, timing=False)
    assert path_text(document) != path_text(later)


def test_files_appear_whole_or_not_at_all(tmp_path, monkeypatch):
    target = tmp_path / "path.json"
    write_whole(target, "first")

    def fail(*_: object) -> None:
        raise OSError(28, "No space left on device")

    monkeypatch.setattr("os.replace", fail)
    with pytest.raises(OutputError):
        write_whole(target, "second")
    assert target.read_text() == "first"
    assert [path.name for path in tmp_path.iterdir()] == ["path.json"]
