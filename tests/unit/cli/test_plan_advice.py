"""Advice of `weldsim plan`, followed to the letter at the command line."""

import json
import re
import shlex
from pathlib import Path

import numpy as np
import pytest

from tests.cloud_files import png_bytes
from tests.clouds import Noise, groove_cloud
from tests.unit.cloud.test_extent import plate, room
from weldsim.cli import main
from weldsim.cloud.files import write_cloud


def refused(capsys: pytest.CaptureFixture[str], *words: object, code: int = 2) -> str:
    """What a command says that fails with that code, in one line."""
    assert main(["plan", *map(str, words)]) == code
    out, err = capsys.readouterr()
    assert out == ""
    assert err.count("\n") == 1
    return err


def test_options_that_crop_a_room_are_taken_as_they_are_printed(tmp_path: Path, capsys: pytest.CaptureFixture[str]) -> None:
    np.save(tmp_path / "room.npy", room(0.03, size=6.0))
    said = refused(capsys, tmp_path / "room.npy")
    options = re.search(r"\((--set .*?) keeps", said)
    assert options is not None
    assert "no seam found" in refused(capsys, tmp_path / "room.npy", *shlex.split(options[1]), code=1)  # read, and a bare plate


def test_a_unit_and_a_viewpoint_that_are_proposed_are_taken_as_they_are_printed(tmp_path: Path, capsys) -> None:
    np.save(tmp_path / "part.npy", plate() * 1e3)
    unit = re.search(r"pass (--units \w+)", refused(capsys, tmp_path / "part.npy"))
    assert unit is not None
    words = [tmp_path / "part.npy", *unit[1].split()]
    meant = re.search(r'"(-450 mm)" is meant', refused(capsys, *words, "--viewpoint", 0, -450, 420))
    assert meant is not None
    assert "no seam found" in refused(capsys, *words, "--viewpoint", 0, meant[1], "420 mm", code=1)


def test_a_depth_unit_that_is_proposed_is_taken_as_it_is_printed(tmp_path: Path, capsys) -> None:
    rng = np.random.default_rng(0)
    (tmp_path / "d.png").write_bytes(png_bytes((4000 + rng.integers(-3, 3, (96, 128))).astype(np.uint16)))  # 0.1 mm a count
    camera = {"width": 128, "height": 96, "fx": 120.0, "fy": 120.0, "cx": 63.5, "cy": 47.5}
    (tmp_path / "k.json").write_text(json.dumps(camera))
    (tmp_path / "pose.json").write_text(json.dumps({"position": [0, -0.45, 0.4], "quaternion_wxyz": [0, 1, 0, 0]}))
    words = [tmp_path / "d.png", "--intrinsics", tmp_path / "k.json", "--pose", tmp_path / "pose.json"]
    said = refused(capsys, *words)
    option = re.search(r'--depth-unit "([^"]+)"', said)
    assert option is not None
    assert "no seam found" in refused(capsys, *words, "--depth-unit", option[1], code=1)
    # Where the camera's file says another unit, neither is quietly taken.
    (tmp_path / "k.json").write_text(json.dumps(camera | {"depth_scale": 1e-4}))
    assert "no seam found" in refused(capsys, *words, "--depth-unit", option[1], code=1)
    said = refused(capsys, *words, "--depth-unit", "1 mm")
    assert "k.json: depth_scale is 0.0001 m a count, --depth-unit 0.001 m; leave that out, or correct the file" in said
    assert "no seam found" in refused(capsys, *words, code=1)


@pytest.mark.parametrize(("land", "noise"), [(12, "none"), (14, "none"), (14, "d415"), (16, "d415")])
def test_settings_for_a_narrow_part_find_its_groove(land: int, noise: Noise, tmp_path: Path, capsys) -> None:
    """A plate with so many mm beside its groove, on a table 20 mm below: without them nothing is found, with them all of it."""
    made = groove_cloud(np.random.default_rng(0), width=0.014, size=(0.24, 0.014 + 2 * land * 1e-3), noise=noise)
    write_cloud(tmp_path / "coupon.ply", made.cloud)
    said = refused(capsys, tmp_path / "coupon.ply", code=1)
    options = re.search(r"a groove is found with ((?:--set \S+=\"[^\"]+\" ?)+)", said.replace('mm":', 'mm" '))
    assert options is not None, said
    assert main(["plan", str(tmp_path / "coupon.ply"), *shlex.split(options[1]), "--json"]) == 0
    (seam,) = json.loads(capsys.readouterr().out)["seams"]
    assert seam["length"] == pytest.approx(0.24, abs=0.003)
    assert seam["width"] == pytest.approx(0.014, abs=0.001)


def test_no_settings_are_advised_where_they_find_nothing(tmp_path: Path, capsys) -> None:
    """A bare narrow plate: candidates are refused for their sides, and there is no groove."""
    made = groove_cloud(np.random.default_rng(0), width=0.0, size=(0.24, 0.05), noise="d415", clamps=2)
    write_cloud(tmp_path / "bare.ply", made.cloud)
    said = refused(capsys, tmp_path / "bare.ply", code=1)
    assert "on both sides" in said
    assert "a groove is found" not in said


@pytest.mark.parametrize(
    ("settings", "says"),
    [
        (["min_length=1"], "no groove shows that is 1000 mm long"),
        (["min_depth=20 mm"], "20 mm deep (seam.profile.min_depth)"),
        (["max_width=10 mm", "min_length=40 mm"], "over the 10 mm of seam.profile.max_width"),
    ],
)
def test_settings_that_keep_a_groove_from_being_found_are_told_and_without_them_it_is(settings, says, tmp_path, capsys) -> None:
    write_cloud(tmp_path / "a.ply", groove_cloud(np.random.default_rng(0), noise="d415").cloud)
    words = [word for text in settings for word in ("--set", f"seam.profile.{text}")]
    said = refused(capsys, tmp_path / "a.ply", *words, code=1)
    assert says in said
    names = [f"seam.profile.{text.partition('=')[0]}" for text in settings]
    assert set(re.search(r"with the defaults? of (.*) a seam is found", said)[1].split(" and ")) == set(names)  # type: ignore[index]
    assert main(["plan", str(tmp_path / "a.ply")]) == 0
