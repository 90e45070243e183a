"""`weldsim controller`."""

import signal
import sys
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Literal, get_args

import tyro

from weldsim.cli.options import SCENE_PREFIX, ConfigOptions
from weldsim.cli.quantities import PACE, SPELL, quantity
from weldsim.cli.show import print_json
from weldsim.controller.fault_names import FaultName
from weldsim.errors import InputError


@dataclass(frozen=True, kw_only=True)
class Controller(ConfigOptions):
    """Serve a virtual UR5 controller: dashboard 29999, scripts 30001 to 30003, RTDE 30004. Ends with Ctrl-C.

    `weldsim controller fault protective-stop` orders a fault from the one that is running, `weldsim controller status` asks for
    its state.
    """

    action: tyro.conf.Positional[Literal["serve", "fault", "status"]] = "serve"
    """Serve, order a fault, or ask for the state."""

    fault: tyro.conf.Positional[FaultName | None] = None
    """With fault: which. protective-stop, emergency-stop: arm stopped, program held or ended. stall: silent for --seconds while
    program and arm go on. link-drop: every client hung up on for --seconds. foreign-program: somebody else's program runs.
    local-control, remote-control: clients may only look, or act (e-Series). recover: program ended, stops lifted, brakes off."""

    profile: Literal["cb3", "e"] = "cb3"
    """CB3 3.15 at 125 Hz or e-Series 5.11 at 500 Hz."""

    scene: Annotated[str, tyro.conf.arg(metavar="SCENE")] = ""
    """What stands on the table, a name or a TOML file. A collision is a protective stop. By default the arm is alone: no table, no
    torch."""

    calibration: Path | None = None
    """Factory calibration of the arm, a controller's calibration.conf: what the arm tells of itself on port 30001, and how poses
    and joint angles belong together. A nominal UR5 by default."""

    speed: Annotated[float, quantity(PACE, "--speed")] = 1.0
    """Simulated seconds in a second."""

    host: str = "127.0.0.1"
    """Address to serve or to ask. The protocols know no password: an address that others can reach lets them move the arm."""

    seconds: Annotated[float, quantity(SPELL, "--seconds")] = 1.0
    """With fault stall and link-drop: how long."""

    low_when_stopped: tuple[int, ...] = (0,)
    """Digital outputs that are dropped when no program runs any longer, the arc's say."""

    unlock_delay: Annotated[float, quantity(SPELL, "--unlock-delay")] = 5.0
    """Seconds after a protective stop before the dashboard can unlock it, as on a real controller."""

    verbose: bool = False
    """Print the controller's log to stderr."""

    def __call__(self) -> int:
        """0."""
        if self.action == "fault" and self.fault is None:
            raise InputError(f"controller fault: which? one of {', '.join(get_args(FaultName))}")
        if self.action != "fault" and self.fault is not None:
            raise InputError(f"controller {self.action} {self.fault}: weldsim controller fault {self.fault} is meant?")
        self._refuse_idle_settings()
        return self._serve() if self.action == "serve" else self._ask()

    def _refuse_idle_settings(self) -> None:
        """Raises InputError for a setting that would change nothing here."""
        idle = [f"--set {text}" for text in self.set if not (self.scene and text.startswith(SCENE_PREFIX))]
        idle += [] if self.config is None else [f"--config {self.config}"]
        if idle:
            raise InputError(f"controller: {idle[0]} changes nothing here; --set takes scene.KEY=VALUE, together with --scene")

    def _serve(self) -> int:
        from weldsim.controller.calibration import Calibration, read_calibration
        from weldsim.controller.config import ControllerConfig
        from weldsim.controller.start import new_server
        from weldsim.execution.priority import hurry

        config = ControllerConfig(
            speed=self.speed,
            low_when_stopped=self.low_when_stopped,
            unlock_delay=self.unlock_delay,
            calibration=read_calibration(self.calibration) if self.calibration else Calibration(),
        )
        server = new_server(self.profile, self.scene_of(self.scene) if self.scene else None, config, self.host)
        if self.verbose:
            machine = server.machine
            machine.on_message = lambda text: print(f"{machine.t:9.3f}  {text}", file=sys.stderr, flush=True)
        if not self.host.startswith("127."):
            warning = f"weldsim: {self.host} may be reached from other machines, and whoever reaches it moves the arm"
            print(warning, file=sys.stderr, flush=True)
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, lambda *_: server.stop())
        if self.json:
            print_json({"profile": self.profile, "host": self.host, "scene": self.scene or None})
        else:
            print(
                f"virtual UR5 controller, profile {self.profile}, on {self.host}: dashboard 29999, script 30001-30003, RTDE 30004"
            )
        sys.stdout.flush()
        if self.speed <= 1:  # faster than that it may never sleep
            hurry()
        server.run()
        return 0

    def _ask(self) -> int:
        from weldsim.controller.ask import ask

        reply = ask(self.host, {"status": True} if self.action == "status" else {"fault": self.fault, "seconds": self.seconds})
        if self.json:
            print_json(reply)
        elif self.action == "fault":
            print(reply["done"])
        else:
            for key, value in reply.items():
                print(f"{key:14}  {value}")
        return 0
