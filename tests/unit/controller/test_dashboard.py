"""The dashboard, line by line."""

import pytest

from tests.controllers import new_machine
from weldsim.controller.config import ControllerConfig
from weldsim.controller.dashboard import BANNER, LOCAL, Dashboard, DashboardSession
from weldsim.controller.machine import Machine
from weldsim.execution.ur_modes import RobotMode

LOOP = "def job():\n while True:\n  sync()\n end\nend"


@pytest.fixture
def machine() -> Machine:
    return new_machine("e", ControllerConfig(unlock_delay=0.1))


def wait(machine: Machine, seconds: float) -> None:
    for _ in range(round(seconds / machine.profile.period)):
        machine.tick()


def test_program_is_started_paused_and_stopped(machine):
    say = Dashboard(machine).answer
    assert say("running") == "Program running: false"
    assert say("play") == "Failed to execute: play"
    assert say("stop") == "Stopped"
    assert machine.upload(LOOP)
    assert (say("running"), say("programState")) == ("Program running: true", "PLAYING job")
    assert (say("pause"), say("programState")) == ("Pausing program", "PAUSED job")
    assert say("pause") == "Failed to execute: pause"
    assert (say("play"), say("programState")) == ("Starting program", "PLAYING job")
    assert (say("stop"), say("programState")) == ("Stopped", "STOPPED <unnamed>")


def test_exact_words(machine):
    say = Dashboard(machine).answer
    assert say("robotmode") == "Robotmode: RUNNING"
    assert say("safetymode") == "Safetymode: NORMAL"
    assert say("PolyscopeVersion").startswith("URSoftware 5.11.")
    assert say("get serial number").isdigit()
    assert say("get robot model") == "UR5"
    assert say("is in remote control") == "true"
    assert say("get loaded program") == "No program loaded"
    assert say("load weld.urp") == "Loading program: weld.urp"
    assert say("get loaded program") == "Loaded program: weld.urp"
    assert (say("popup hello"), machine.popup) == ("showing popup", "hello")
    assert (say("close popup"), machine.popup) == ("closing popup", "")
    assert say("addToLog mark") == "Added log message"
    assert machine.log[-1][1] == "mark"
    assert say("dance") == "could not understand: 'dance'"
    assert Dashboard(new_machine("cb3")).answer("is in remote control") == "could not understand: 'is in remote control'"


def test_each_series_knows_its_own_commands():
    cb3, e = (Dashboard(new_machine(series)).answer for series in ("cb3", "e"))
    for say in (cb3, e):
        assert say("saveLog") == "Log saved to disk"
        assert say("generate flight report") == "Flight Report generated with id: 1"
        assert say("generate flight report controller") == "Flight Report generated with id: 2"
        assert say("generate support file /programs").startswith("Completed successfully: /programs/")
        assert say("generate noise") == "could not understand: 'generate noise'"
    assert (cb3("version"), e("version")) == ("3.15.8.106339", "5.11.1.108318")
    assert (cb3("setUserRole locked"), cb3("getUserRole")) == ("Setting user role: LOCKED", "LOCKED")
    assert (e("set operational mode automatic"), e("get operational mode")) == ("Operational mode 'automatic' is set", "AUTOMATIC")
    assert e("clear operational mode") == "No longer controlling the operational mode. Current operational mode: 'NONE'."
    for say, command in ((e, "setUserRole locked"), (e, "getUserRole"), (cb3, "get operational mode")):
        assert say(command) == f"could not understand: '{command}'"


def test_power_and_brakes(machine):
    say = Dashboard(machine).answer
    assert (say("power off"), machine.robot_mode) == ("Powering off", RobotMode.POWER_OFF)
    assert not machine.upload(LOOP)
    assert (say("power on"), machine.robot_mode) == ("Powering on", RobotMode.IDLE)
    assert (say("brake release"), machine.robot_mode) == ("Brake releasing", RobotMode.RUNNING)
    machine.emergency_stop()
    assert say("power on") == "Failed to execute: power on"
    assert say("safetymode") == "Safetymode: ROBOT_EMERGENCY_STOP"


def test_protective_stop_is_unlocked_after_its_delay(machine):
    say = Dashboard(machine).answer
    assert machine.upload(LOOP)
    machine.protective_stop("test")
    assert say("programState") == "PAUSED job"
    assert say("unlock protective stop").startswith("Cannot unlock protective stop until")
    assert say("play") == "Failed to execute: play"
    assert not machine.upload(LOOP)
    wait(machine, 0.2)
    assert say("unlock protective stop") == "Protective stop releasing"
    assert say("play") == "Starting program"


def test_local_control_only_answers_questions(machine):
    say = Dashboard(machine).answer
    machine.remote = False
    assert say("robotmode") == "Robotmode: RUNNING"
    for command in ("stop", "play", "power off", "load x.urp"):
        assert say(command) == LOCAL
    assert machine.robot_mode is RobotMode.RUNNING
    assert not machine.upload(LOOP)


def test_lines_are_answered_in_whatever_pieces_they_come(machine):
    session = DashboardSession(Dashboard(machine))
    assert session.greeting() == BANNER
    assert session.received(b"robot") == b""
    assert session.received(b"mode\nsafetymode\n") == b"Robotmode: RUNNING\nSafetymode: NORMAL\n"
    assert session.received(b"quit\nrobotmode\n") == b"Disconnected\n"
    assert session.finished
