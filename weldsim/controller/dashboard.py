"""The dashboard server, port 29999: one line asked, one line answered.

Words from UR's dashboard server guide; which series knows which command, and the answers about operational modes, reports and
logs, as the manufacturer's Universal_Robots_Client_Library expects them.
"""

from collections.abc import Callable

from weldsim.controller.machine import Machine
from weldsim.execution.ur_modes import RobotMode, RuntimeState

BANNER = b"Connected: Universal Robots Dashboard Server\n"
MAX_LINE = 65536
REPORTS = ("controller", "software", "system")
ROLES = ("programmer", "operator", "none", "locked", "restricted")
LOCAL = "Command is not allowed due to safety reasons."  # what an e-Series in local control says
_LOCAL_TOO = frozenset(
    [
        "robotmode",
        "running",
        "programState",
        "safetymode",
        "safetystatus",
        "PolyscopeVersion",
        "version",
        "get loaded program",
        "isProgramSaved",
        "quit",
        "is in remote control",
        "get serial number",
        "get robot model",
        "getUserRole",
        "get operational mode",
        "help",
    ]
)
"""What may be asked in local control."""


class Dashboard:
    """Answers from and to one machine."""

    def __init__(self, machine: Machine) -> None:
        self._machine = machine
        self._role, self._mode, self._reports = "PROGRAMMER", "NONE", 0
        plain: dict[str, Callable[[], str]] = {
            "play": self._play,
            "stop": self._stop,
            "pause": lambda: "Pausing program" if machine.pause() else "Failed to execute: pause",
            "running": lambda: f"Program running: {str(machine.runtime is RuntimeState.PLAYING).lower()}",
            "robotmode": lambda: f"Robotmode: {machine.robot_mode.name}",
            "safetymode": lambda: f"Safetymode: {machine.safety_mode.name}",
            "safetystatus": lambda: f"Safetystatus: {machine.safety_mode.name}",
            "programState": self._program_state,
            "get loaded program": lambda: f"Loaded program: {machine.loaded}" if machine.loaded else "No program loaded",
            "isProgramSaved": lambda: f"true {machine.loaded or '<unnamed>'}",
            "close popup": self._close_popup,
            "close safety popup": lambda: "closing safety popup",
            "power on": lambda: self._power(RobotMode.IDLE, "Powering on", "power on"),
            "power off": lambda: self._power(RobotMode.POWER_OFF, "Powering off", "power off"),
            "brake release": lambda: self._power(RobotMode.RUNNING, "Brake releasing", "brake release"),
            "unlock protective stop": self._unlock,
            "restart safety": self._restart_safety,
            "PolyscopeVersion": lambda: machine.profile.software,
            "version": lambda: machine.profile.software.split()[1],
            "get serial number": lambda: machine.profile.serial,
            "get robot model": lambda: machine.profile.model,
            "shutdown": self._shut_down,
            "saveLog": lambda: "Log saved to disk",
        }
        if machine.profile.remote_control:
            plain |= {
                "is in remote control": lambda: str(machine.remote).lower(),
                "get operational mode": lambda: self._mode,
                "clear operational mode": self._clear_mode,
            }
        else:
            plain["getUserRole"] = lambda: self._role
        self._plain = plain
        self._with_text: dict[str, Callable[[str], str]] = {
            "load": self._load,
            "popup": self._popup,
            "addToLog": self._add_to_log,
            "generate": self._generate,
        }
        if machine.profile.remote_control:
            self._with_text["set"] = self._set_mode
        else:
            self._with_text["setUserRole"] = self._set_role

    def answer(self, line: str) -> str:
        """The reply to one line, without newlines."""
        line = line.strip()
        command = next((known for known in self._plain if known.lower() == line.lower()), None)
        word, _, text = line.partition(" ")
        takes_text = next((known for known in self._with_text if known.lower() == word.lower()), None)
        if command is None and takes_text is None:
            return f"could not understand: '{line}'"
        if self._machine.profile.remote_control and not self._machine.remote and command not in _LOCAL_TOO:
            return LOCAL
        return self._plain[command]() if command else self._with_text[takes_text or ""](text.strip())

    def _play(self) -> str:
        return "Starting program" if self._machine.play() else "Failed to execute: play"

    def _stop(self) -> str:
        self._machine.stop_program()
        return "Stopped"

    def _program_state(self) -> str:
        state = {RuntimeState.PLAYING: "PLAYING", RuntimeState.PAUSED: "PAUSED"}.get(self._machine.runtime, "STOPPED")
        return f"{state} {self._machine.program_name or self._machine.loaded or '<unnamed>'}"

    def _load(self, name: str) -> str:
        kind, _, file = name.partition(" ")
        if kind == "installation":
            return f"Loading installation: {file.strip()}" if file.strip() else "Failed to load installation"
        if not name.endswith(".urp"):
            return f"File not found: {name}"
        self._machine.stop_program()
        self._machine.loaded = name
        return f"Loading program: {name}"

    def _popup(self, text: str) -> str:
        self._machine.popup = text
        self._machine.say(f"popup: {text}")
        return "showing popup"

    def _close_popup(self) -> str:
        self._machine.popup = ""
        return "closing popup"

    def _add_to_log(self, text: str) -> str:
        if not text:
            return "No log message to add"
        self._machine.say(text)
        return "Added log message"

    def _generate(self, text: str) -> str:
        """A flight report or a support file: both said to be there, neither is written."""
        words = text.split()
        if words[:2] == ["flight", "report"] and (words[2:] or ["system"])[0] in REPORTS and len(words) <= 3:
            self._reports += 1
            return f"Flight Report generated with id: {self._reports}"
        if words[:2] == ["support", "file"] and len(words) == 3:
            return f"Completed successfully: {words[2].rstrip('/')}/ur_{self._machine.profile.serial}.zip"
        return f"could not understand: 'generate {text}'"

    def _set_role(self, role: str) -> str:
        if role.lower() not in ROLES:
            return f"Failed setting user role: {role}"
        self._role = role.upper()
        return f"Setting user role: {self._role}"

    def _set_mode(self, text: str) -> str:
        words = text.split()
        if words[:2] != ["operational", "mode"] or len(words) != 3 or words[2] not in ("manual", "automatic"):
            return f"could not understand: 'set {text}'"
        self._mode = words[2].upper()
        return f"Operational mode '{words[2]}' is set"

    def _clear_mode(self) -> str:
        self._mode = "NONE"
        return "No longer controlling the operational mode. Current operational mode: 'NONE'."

    def _power(self, mode: RobotMode, done: str, name: str) -> str:
        return done if self._machine.power(mode) else f"Failed to execute: {name}"

    def _unlock(self) -> str:
        if self._machine.unlock():
            return "Protective stop releasing"
        return (
            f"Cannot unlock protective stop until {self._machine.config.unlock_delay:g}s after occurrence."
            " Always inspect cause of protective stop before unlocking"
        )

    def _restart_safety(self) -> str:
        self._machine.release()
        self._machine.power(RobotMode.POWER_OFF)
        return "Restarting safety"

    def _shut_down(self) -> str:
        self._machine.power(RobotMode.POWER_OFF)
        return "Shutting down"


class DashboardSession:
    """One client of the dashboard. `finished` once it has said quit."""

    def __init__(self, dashboard: Dashboard) -> None:
        self._dashboard, self._rest = dashboard, b""
        self.finished = False

    def greeting(self) -> bytes:
        return BANNER

    def ended(self) -> None:
        self._rest = b""

    def received(self, data: bytes) -> bytes:
        """The replies to every line that is complete."""
        *lines, self._rest = (self._rest + data).split(b"\n")
        if len(self._rest) > MAX_LINE:
            self.finished = True
        out: list[str] = []
        for line in lines:
            text = line.decode(errors="replace").strip()
            if text.lower() in ("quit", "exit"):
                self.finished = True
                out.append("Disconnected")
                break
            out.append(self._dashboard.answer(text))
        return "".join(f"{reply}\n" for reply in out).encode()
