"""The robot as the runner sees it, simulated or real: what it reports, one command a period, an arc output, a stop."""

from abc import ABC, abstractmethod
from types import TracebackType

from jaxtyping import Float
from numpy import ndarray

from weldsim.records import Event, RobotFacts, RobotState


class Robot(ABC):
    """An arm with a torch.

    Implementations are final; behaviour is added by wrapping one Robot in another (a safety gate, a recorder).
    A `with` block connects and disconnects; leaving it always drops the arc.
    """

    name: str
    period: float
    """Time between commands [s]."""

    @abstractmethod
    def connect(self) -> None:
        """Make the robot ready to be commanded. Raises ExecutionError, saying what is missing."""

    @abstractmethod
    def disconnect(self) -> None:
        """Drop the arc, come to rest and let go; harmless when not connected."""

    @abstractmethod
    def state(self) -> RobotState:
        """What the robot reports now, never what was asked of it."""

    @abstractmethod
    def facts(self) -> RobotFacts:
        """What the controller says about itself, read anew; the robot must be connected. Raises ExecutionError."""

    @abstractmethod
    def servo(self, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> Float[ndarray, "6"]:
        """Move towards q [rad], to be passed at speed qd [rad/s] one period from now; returns when that time has come.

        Returns:
            What was really sent: q, unless a wrapper changed it.
        Raises:
            ExecutionError: the robot has stopped or refuses the command; `data`: rule, value, limit, t.
        """

    @abstractmethod
    def set_arc(self, on: bool) -> None:
        """Switch the arc output; takes effect with the next command."""

    @property
    @abstractmethod
    def arc(self) -> bool:
        """Whether the arc output is on, as the robot reports it."""

    @abstractmethod
    def stop(self) -> None:
        """Drop the arc first, then bring all joints to rest as fast as the robot may; returns at rest."""

    def torque(self) -> Float[ndarray, "6"] | None:
        """Joint torques [Nm] as the robot reports them, or None."""
        return None

    def passed_over(self) -> tuple[tuple[RobotState, bool], ...]:
        """What was reported since the last call before the newest state, and the arc output with each, in order.

        Empty where every state was looked at in time; a robot keeps its own time, and who commands it may be late.
        """
        return ()

    def events(self) -> tuple[Event, ...]:
        """What happened since the last call, in order."""
        return ()

    def __enter__(self) -> "Robot":
        self.connect()
        return self

    def __exit__(self, kind: type[BaseException] | None, error: BaseException | None, trace: TracebackType | None) -> None:
        self.disconnect()
