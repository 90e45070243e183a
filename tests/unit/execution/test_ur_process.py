"""The process that commands a UR controller, once it has been killed: it says so, whatever is asked of it."""

import os
import socket
from collections.abc import Iterator

import pytest

from tests.controllers import free_address
from weldsim.execution.ur_config import UrConfig
from weldsim.execution.ur_link import client_settings
from weldsim.execution.ur_ports import DASHBOARD, RTDE
from weldsim.execution.ur_process import ClientError, ClientProcess


@pytest.fixture
def process() -> Iterator[ClientProcess]:
    """One that waits for a controller that accepts and says nothing: it ends by being killed alone, however late that comes."""
    host = free_address()
    with socket.create_server((host, DASHBOARD)), socket.create_server((host, RTDE)):
        process = ClientProcess(client_settings(UrConfig(host=host), 0.008), 0.1)
        yield process
        process.kill()


def test_a_killed_process_answers_with_one_error_alone(process: ClientProcess) -> None:
    process.kill()
    assert not os.path.exists(f"/proc/{process.pid}")
    for ask in (
        lambda: process.wait_ready(0.0),
        lambda: process.wait_ready(0.1),
        lambda: process.servo([0.0] * 6, False),
        process.stop,
        process.pump,
    ):
        with pytest.raises(ClientError):
            ask()
    assert not process.alive
    assert not process.close(0.1)
    assert not process.stopped(1)
    process.check()
    process.kill()


def test_a_kill_that_was_interrupted_is_finished_by_the_next(process: ClientProcess, monkeypatch: pytest.MonkeyPatch) -> None:
    with monkeypatch.context() as patch:

        def interrupted(timeout: float | None = None) -> int:
            raise KeyboardInterrupt

        patch.setattr(process._process, "wait", interrupted)
        with pytest.raises(KeyboardInterrupt):
            process.kill()
    process.kill()
    with pytest.raises(ClientError, match="signal 9"):
        process.pump()
