"""The film: frames of the right size, a bead where the arc burned, nothing left behind when it fails."""

from pathlib import Path

import cv2
import numpy as np
import pytest

from weldsim.errors import ConfigError, OutputError
from weldsim.execution.config import SimulationConfig
from weldsim.execution.simulated import SimulatedRobot
from weldsim.execution.video import VideoConfig, WeldVideo
from weldsim.scene.config import SceneConfig
from weldsim.scene.world import HOME, build_world

SMALL = VideoConfig(width=640, height=360, fps=25.0, speedup=4.0)


@pytest.mark.render
def test_film_is_written_and_the_bead_shows(tmp_path: Path) -> None:
    world, target = build_world(SceneConfig()), tmp_path / "weld.mp4"
    with WeldVideo(target, SMALL) as video:
        robot = SimulatedRobot(world.model, HOME, SimulationConfig(frame_period=video.frame_period), on_frame=video)
        with robot:
            before = video.picture(robot)
            robot.set_arc(True)
            for k in range(1, 101):
                robot.servo(HOME + np.array([0.001 * k, 0, 0, 0, 0, 0]), np.array([0.125, 0, 0, 0, 0, 0]))
            after = video.picture(robot)
        assert not target.exists()
    assert list(tmp_path.iterdir()) == [target]
    film = cv2.VideoCapture(str(target))
    assert film.get(cv2.CAP_PROP_FRAME_COUNT) == pytest.approx(0.8 / 0.16, abs=2)
    assert (film.get(cv2.CAP_PROP_FRAME_WIDTH), film.get(cv2.CAP_PROP_FRAME_HEIGHT)) == (640, 360)

    def glowing(picture: np.ndarray) -> int:
        red, _, blue = np.moveaxis(picture.astype(int), -1, 0)
        return int((red - blue > 70).sum())

    assert glowing(after) > glowing(before) + 10


def test_a_failed_film_leaves_nothing(tmp_path: Path) -> None:
    with pytest.raises(RuntimeError), WeldVideo(tmp_path / "weld.mp4", SMALL):
        raise RuntimeError
    assert not list(tmp_path.iterdir())
    with pytest.raises(OutputError, match="cannot write a video"), WeldVideo(tmp_path / "missing" / "weld.mp4", SMALL):
        pass


@pytest.mark.parametrize("bad", [{"width": 31}, {"height": 101}, {"fps": 0.0}])
def test_config_refuses_nonsense(bad: dict[str, float]) -> None:
    with pytest.raises(ConfigError, match="video"):
        VideoConfig(**bad)  # type: ignore[arg-type]


@pytest.mark.parametrize(
    ("speedup", "said"),
    [(6.0, "shown 6 x as fast"), (1.0, "shown at true speed"), (0.25, "shown 4 x as slow"), (2.5, "shown 2.5 x as fast")],
)
def test_a_film_says_its_time_scale(tmp_path: Path, speedup: float, said: str) -> None:
    film = WeldVideo(tmp_path / "weld.mp4", VideoConfig(speedup=speedup))
    assert film.pace == said
    assert film.frame_period == pytest.approx(speedup / film.config.fps)


@pytest.mark.render
def test_the_time_scale_is_written_into_the_picture(tmp_path: Path) -> None:
    world = build_world(SceneConfig())
    pictures = []
    for speedup in (1.0, 6.0):
        film = WeldVideo(tmp_path / "weld.mp4", VideoConfig(width=640, height=360, speedup=speedup, inset=False))
        robot = SimulatedRobot(world.model, HOME)
        with film, robot:
            pictures.append(film.picture(robot).astype(int))
    rows, columns = np.nonzero(np.abs(pictures[0] - pictures[1]).max(axis=2) > 60)
    assert len(rows) > 50
    assert 55 < rows.min() < rows.max() < 85  # the line below the clock, and nothing else
    assert columns.max() < 320
