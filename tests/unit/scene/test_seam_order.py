"""Points of a seam file that are not in order are refused with the jump; every honest way of sampling a seam is taken."""

from pathlib import Path

import numpy as np
import pytest
from hypothesis import given
from hypothesis import strategies as st

from weldsim.errors import SceneError
from weldsim.scene.workpieces.seam_order import check_order

FILE = Path("seam.csv")


def line(n: int = 40, length: float = 0.2) -> np.ndarray:
    x = np.linspace(0, length, n)
    return np.stack([x, 0 * x, 0 * x], axis=1)


def arc(n: int = 90, turn: float = np.pi, radius: float = 0.1) -> np.ndarray:
    u = np.linspace(0, turn, n)
    return radius * np.stack([np.cos(u), np.sin(u), 0 * u], axis=1)


def wave(n: int = 120) -> np.ndarray:
    x = np.linspace(0, 0.25, n)
    return np.stack([x, 0.02 * np.sin(x / 0.03), 0 * x], axis=1)


def hairpin(apart: float = 0.02, n: int = 30) -> np.ndarray:
    there = line(n)
    bend = np.array([[0.2, apart / 2, 0]]) + apart / 2 * np.stack(
        [np.sin(u := np.linspace(0.2, np.pi - 0.2, 9)), -np.cos(u), 0 * u], axis=1
    )
    return np.concatenate([there, bend, there[::-1] + np.array([0, apart, 0])])


def box() -> np.ndarray:
    """Up a box's side, over its top and down again: corners of a right angle, few points."""
    return np.array([[0, 0, 0], [0, 0, 0.3], [0.4, 0, 0.3], [0.4, 0, 0.0]])


def slot() -> np.ndarray:
    """Round a slot: dense on its ends, nothing between them; it closes."""
    end = arc(40, radius=0.01)[:, [1, 0, 2]] * np.array([1, -1, 1]) + np.array([0.1, 0, 0])
    return np.concatenate([end, end * np.array([-1, -1, 1]), end[:1]])


def dense_and_sparse() -> np.ndarray:
    """A straight seam with many points about its middle."""
    x = np.concatenate([[0.0], np.linspace(0.09, 0.11, 60), [0.2]])
    return np.stack([x, 0 * x, 0 * x], axis=1)


GOOD = {
    "line": line(),
    "two points": line(2),
    "three points": line(3),
    "arc": arc(),
    "nearly a ring": arc(300, 1.9 * np.pi),
    "ring": arc(100, 2 * np.pi),
    "wave": wave(),
    "hairpin": hairpin(),
    "box": box(),
    "slot": slot(),
    "dense and sparse": dense_and_sparse(),
    "noisy and dense": line(400) + np.random.default_rng(0).normal(0, 1e-4, (400, 3)),
}


@pytest.mark.parametrize("name", GOOD)
def test_an_honest_line_is_taken_either_way(name: str) -> None:
    check_order(FILE, GOOD[name])
    check_order(FILE, GOOD[name][::-1])


def swapped(points: np.ndarray, i: int, j: int) -> np.ndarray:
    out = points.copy()
    out[[i, j]] = out[[j, i]]
    return out


def as_text(points: np.ndarray) -> np.ndarray:
    """Sorted as a file's names are: 0, 1, 10, 11, ... 2, 20."""
    return points[sorted(range(len(points)), key=str)]


BAD = {
    "shuffled": np.random.default_rng(1).permutation(line()),
    "shuffled arc": np.random.default_rng(2).permutation(arc()),
    "two neighbours": swapped(line(), 7, 8),
    "two far apart": swapped(arc(), 7, 60),
    "one at the end": np.concatenate([wave()[1:], wave()[:1]]),
    "halves": np.concatenate([line()[20:], line()[:20]]),
    "halves of an arc": np.concatenate([arc()[40:], arc()[:40]]),
    "a block moved": np.concatenate([arc()[:10], arc()[50:], arc()[10:50]]),
    "as text": as_text(arc()),
    "as text, line": as_text(line()),
    "by x": hairpin()[hairpin()[:, 0].argsort(kind="stable")],
    "a half backwards": np.concatenate([line()[:20], line()[20:][::-1]]),
}


@pytest.mark.parametrize("name", BAD)
def test_points_out_of_order_are_refused_with_the_jump(name: str) -> None:
    with pytest.raises(SceneError, match=r"not in order along the seam: point \d+ to \d+ jumps [\d.]+ mm") as refused:
        check_order(FILE, BAD[name])
    a, b = refused.value.data["points"]  # type: ignore[misc]
    assert b == a + 1 <= len(BAD[name])
    assert "\n" not in str(refused.value)


@given(st.permutations(range(25)))
def test_any_shuffle_of_a_line_is_seen(order: list[int]) -> None:
    points = line(25)[order]
    if order in (sorted(order), sorted(order, reverse=True)):
        return
    with pytest.raises(SceneError):
        check_order(FILE, points)


def test_sorting_them_as_the_message_says_is_enough() -> None:
    bad = BAD["shuffled"]
    with pytest.raises(SceneError, match="sort them"):
        check_order(FILE, bad)
    check_order(FILE, bad[bad[:, 0].argsort()])


@pytest.mark.parametrize("count", [2, 3])
def test_several_lines_in_one_file_are_told_and_one_of_them_is_taken(count: int) -> None:
    lines = [line() + np.array([0.0, 0.03 * k, 0.0]) for k in range(count)]
    with pytest.raises(
        SceneError, match=rf"its points make {count} lines, the second from point 41 on, .*; keep one line"
    ) as caught:
        check_order(Path("seam.csv"), np.vstack(lines))
    assert caught.value.data["points"] == (40, 41)
    check_order(Path("seam.csv"), lines[0])
