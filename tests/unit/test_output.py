"""Files appear whole or not at all, links are written through, and nothing that is no file is replaced by one."""

import os
from pathlib import Path

import pytest

from weldsim.cli.outputs import check_outputs
from weldsim.errors import OutputError
from weldsim.output import write_whole


def test_a_file_is_made_and_replaced_and_nothing_else_left(tmp_path: Path) -> None:
    for content in ("first", b"second"):
        assert write_whole(tmp_path / "a.json", content) == tmp_path / "a.json"
    assert (tmp_path / "a.json").read_bytes() == b"second"
    assert [path.name for path in tmp_path.iterdir()] == ["a.json"]


def test_a_link_is_written_through(tmp_path: Path) -> None:
    (tmp_path / "folder").mkdir()
    link = tmp_path / "link.json"
    link.symlink_to(tmp_path / "folder" / "real.json")
    check_outputs([link])
    write_whole(link, "content")
    assert link.is_symlink()
    assert (tmp_path / "folder" / "real.json").read_text() == "content"


def test_devices_pipes_and_folders_are_refused_and_stay_what_they_are(tmp_path: Path) -> None:
    os.mkfifo(tmp_path / "pipe")
    for place in ("/dev/null", "/dev/stdout", "/dev/fd/1", "/proc/self/fd/1", tmp_path / "pipe"):
        for attempt in (lambda place=place: write_whole(place, "x"), lambda place=place: check_outputs([Path(place)])):
            with pytest.raises(OutputError, match="no regular file"):
                attempt()
    assert Path("/dev/null").is_char_device()
    assert (tmp_path / "pipe").is_fifo()
    with pytest.raises(OutputError, match="is a folder"):
        write_whole(tmp_path, "x")
    with pytest.raises(OutputError, match="cannot be written"):
        write_whole(tmp_path / "missing" / "a.json", "x")


def test_an_interrupted_write_leaves_nothing(tmp_path: Path, monkeypatch: pytest.MonkeyPatch) -> None:
    def interrupted(*_: object) -> None:
        raise KeyboardInterrupt

    monkeypatch.setattr("weldsim.output.os.replace", interrupted)
    with pytest.raises(KeyboardInterrupt):
        write_whole(tmp_path / "a.json", "x")
    assert list(tmp_path.iterdir()) == []
