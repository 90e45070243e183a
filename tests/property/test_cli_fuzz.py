"""The command under fire: files of garbage and words of nonsense end in exit 2 and one line, and nothing is written."""

import contextlib
import io
import os
import tempfile
from pathlib import Path

import numpy as np
from hypothesis import example, given, settings
from hypothesis import strategies as st

from tests.cloud_files import npy_bytes, npz_bytes, ply_bytes, text_bytes, xyz_columns
from weldsim.cli import main

FEW = settings(max_examples=60)
POINTS = np.random.default_rng(1).uniform([-0.1, 0.4, 0.0], [0.2, 0.7, 0.05], (40, 3))  # too few to plan on
VALID = [
    *(ply_bytes(xyz_columns(POINTS, "f4"), kind) for kind in ("<", ">", "ascii")),
    *(text_bytes(POINTS, " ", "# x y z\n"), npy_bytes(POINTS), npz_bytes(points=POINTS)),
]
INTRINSICS = b'{"width": 8, "height": 6, "fx": 10, "fy": 10, "cx": 4, "cy": 3}'


def outcome(words: list[str], files: dict[str, bytes]) -> tuple[int, str, str, set[str]]:
    """Exit code, stdout, stderr, and the names of files that were not there before."""
    here = os.getcwd()
    with tempfile.TemporaryDirectory() as folder:
        for name, content in files.items():
            Path(folder, name).write_bytes(content)
        out, err = io.StringIO(), io.StringIO()
        try:
            os.chdir(folder)
            with contextlib.redirect_stdout(out), contextlib.redirect_stderr(err):
                code = main(words)
        finally:
            os.chdir(here)
        return code, out.getvalue(), err.getvalue(), set(os.listdir(folder)) - set(files)


def refused(words: list[str], files: dict[str, bytes]) -> None:
    code, out, err, new = outcome(words, files)
    assert code == 2, (code, err)
    assert out == ""
    assert err.startswith("weldsim: ")
    assert err.count("\n") == 1
    assert "internal error" not in err
    assert new == set()


OUTPUTS = ["--out", "path.json", "--csv", "path.csv", "--report", "report"]


@FEW
@given(st.binary(max_size=400))
@example(b"")
@example(b"ply\n")
@example(b"\x89PNG\r\n\x1a\n")
@example(b"PK\x03\x04")
@example(b"nan nan nan\n" * 200)
@example(b"0 0 0\n" * 200)
@example(b"1e308 -1e308 1e308\n-1e308 0 0\n" * 100)
def test_files_of_garbage_are_refused(content):
    refused(["plan", "cloud", *OUTPUTS], {"cloud": content})


@FEW
@given(st.sampled_from(VALID), st.lists(st.tuples(st.integers(0, 3000), st.integers(0, 255)), max_size=6), st.integers(1, 5000))
def test_damaged_clouds_are_refused(valid, changes, end):
    data = bytearray(valid[:end])
    for at, value in changes:
        data[at % len(data)] = value
    refused(["plan", "cloud", *OUTPUTS], {"cloud": bytes(data)})


@FEW
@given(st.binary(max_size=200), st.sampled_from([INTRINSICS, b"", b"{}", b'{"width": -1}']), st.binary(max_size=60))
def test_depth_images_of_garbage_are_refused(image, intrinsics, pose):
    words = ["plan", "depth.png", "--intrinsics", "k.json", "--pose", "pose.json", *OUTPUTS]
    refused(words, {"depth.png": image, "k.json": intrinsics, "pose.json": pose})


@FEW
@given(st.binary(max_size=200).filter(lambda data: data.strip() != b"" and not data.lstrip().startswith(b"#")))
def test_settings_of_garbage_are_refused(content):
    refused(["plan", "cloud", "--config", "cell.toml", *OUTPUTS], {"cloud": b"0 0 0\n", "cell.toml": content})


@FEW
@given(st.binary(max_size=300))
def test_scenes_of_garbage_are_refused(content):
    # An empty file is a scene of defaults: it is refused for its seed, as every scene here.
    refused(["run", "scene.toml", "--seed", "-1"], {"scene.toml": content})
    refused(["scan", "scene.toml", "--out", "scan.stl"], {"scene.toml": content})


OPTIONS = (
    "--out --csv --set --config --seam --near --viewpoint --units mm --method thesis 1 -1 --report --json --pose --intrinsics"
    " --depth-unit --seed --video = a=b seam.method=best --"
)
WORDS = st.one_of(st.text(max_size=12).filter(lambda word: "\0" not in word), st.sampled_from(OPTIONS.split()))


@FEW
@given(st.sampled_from([[], ["plan"], ["plan", "cloud"], ["scan"], ["frob"], ["run", "no-such"]]), st.lists(WORDS, max_size=5))
def test_words_of_nonsense_are_refused(start, words):
    if {"-h", "--help", "--version"} & set(words):
        return
    code, out, err, new = outcome([*start, *words], {"cloud": b"0 0 0\n"})
    if any(word in ("scenes", "doctor", "scan") for word in words):
        return  # a command after all
    assert code == 2, (code, err)
    assert (out == "") or "--json" in words
    assert err.count("\n") == 1
    assert "internal error" not in err
    assert new == set()
