"""How the simulated arm's controller behaves, how a trajectory is run, and what no command and no arm may do."""

from dataclasses import dataclass, field

from weldsim.errors import ConfigError
from weldsim.execution.ur_config import UrConfig
from weldsim.quantity import Metre, MetrePerSecond, Radian, RadianPerSecond, Second, require_within

RANGES = {
    "settle": (0.0, 60.0),
    "blend": (1e-3, 10.0),
    "overlap": (0.0, 0.1),
}
GATE_RANGES = {
    "start_tolerance": (1e-6, 0.1),
    "joint_position": (0.0, 6.2831853072),
    "joint_speed": (1e-3, 6.2831853072),
    "joint_acceleration": (1e-3, 100.0),
    "joint_jerk": (1e-1, 1e4),
    "tip_speed": (1e-4, 0.25),
    "tracking": (1e-5, 0.5),
    "tracking_tip": (1e-5, 0.1),
    "lag": (0.0, 1.0),
    "stale": (1e-3, 10.0),
    "arc_lag": (0.0, 10.0),
    "memory": (0.1, 600.0),
}
CONTRACT_RANGES = {
    "calibration": (1e-6, 0.02),
    "own_position": (1e-6, 0.1),
    "frame_position": (1e-6, 0.1),
    "frame_rotation": (1e-6, 0.5),
    "tcp_position": (1e-6, 0.1),
    "tcp_rotation": (1e-6, 0.5),
    "payload": (1e-3, 5.0),
    "payload_cog": (1e-4, 0.5),
    "rest": (1e-6, 1.0),
}
SIMULATION_RANGES = {
    "period": (5e-4, 0.1),
    "timestep": (1e-5, 0.1),
    "velocity_lag": (0.0, 0.1),
    "payload_known": (0.0, 2.0),
    "stop_deceleration": (0.01, 1e4),
    "frame_period": (1e-3, 60.0),
}


@dataclass(frozen=True)
class SimulationConfig:
    """Settings of `SimulatedRobot`. Stiffness, damping and friction of the joints are in the arm's MJCF."""

    period: Second = 0.008
    """Command period: 8 ms on a CB3 controller, 2 ms on an e-Series."""
    timestep: Second = 0.001
    """Physics step; commands are interpolated to it, as a joint servo does."""
    velocity_lag: Second = 0.00045
    """What the servo's velocity feed-forward lacks; logs of a real UR5 show 0.4 ms (arm) to 0.6 ms (wrist)."""
    payload_known: float = 0.9
    """Share of the torch's and camera's weight that the controller's gravity feed-forward knows; the arm's own it knows."""
    stop_deceleration: float = 10.0
    """Joint deceleration of a stop [rad/s2]."""
    frame_period: Second = 0.04
    """Simulated time between two calls of the frame callback."""

    def __post_init__(self) -> None:
        require_within(self, SIMULATION_RANGES, "simulation")
        if self.timestep > min(self.period, 0.002):
            raise ConfigError(
                f"simulation.timestep = {self.timestep} s: at most {min(self.period, 0.002)} s, or the servos turn unstable",
                key="simulation.timestep",
            )


@dataclass(frozen=True)
class GateConfig:
    """What `SafetyGate` holds every command and the arm itself to. Speeds and more are differences of what is sent, divided by
    the robot's own period; a sampled motion never exceeds in them what the motion itself keeps to."""

    start_tolerance: Radian = 0.0087
    """Greatest distance of any joint from a motion's first point (0.5 deg): otherwise nothing moves."""
    joint_position: Radian = 6.2831853072
    """Greatest angle of any joint, both ways."""
    joint_speed: RadianPerSecond = 3.1415926536
    """Greatest joint speed, the published limit; plans keep below `motion.joint_speed_limit`."""
    joint_acceleration: float = 11.0
    """Greatest joint acceleration [rad/s2]; plans keep below `motion.joint_acceleration_limit`, a tenth lower."""
    joint_jerk: float = 400.0
    """Greatest joint jerk [rad/s3]; plans keep below `motion.joint_jerk_limit`, an eighth lower."""
    tip_speed: MetrePerSecond = 0.25
    """Greatest speed of the torch tip, in the air too; it cannot be raised."""
    box_low: tuple[Metre, Metre, Metre] = (-1.1, -1.1, -0.005)
    """Corner of the box in the base that the torch tip stays in: least x, y, z. The table top is at z = 0."""
    box_high: tuple[Metre, Metre, Metre] = (1.1, 1.1, 1.3)
    """Greatest x, y, z of that box."""
    tracking: Radian = 0.02
    """Greatest distance of any joint from the way it was sent lately."""
    tracking_tip: Metre = 0.001
    """Greatest distance of the torch tip from the way it was sent lately, on welds."""
    lag: Second = 0.2
    """How far back `lately` reaches: an arm that streams its targets trails them by a few periods."""
    stale: Second = 0.1
    """Greatest time for which what the robot reports may carry the same time stamp."""
    arc_lag: Second = 0.1
    """Time in which the arc output must have gone off when it was told to."""
    memory: Second = 20.0
    """How much of the past the black box keeps."""

    def __post_init__(self) -> None:
        require_within(self, GATE_RANGES, "execution.gate")
        for axis, low, high in zip("xyz", self.box_low, self.box_high, strict=True):
            if not -3.0 <= low < high <= 3.0:
                raise ConfigError(
                    f"execution.gate.box_low, box_high: {axis} from {low:g} to {high:g} m: less than more, within 3 m, is needed",
                    key="execution.gate.box_low",
                )


@dataclass(frozen=True)
class ContractConfig:
    """How closely a robot must be what the plan takes it for, before it moves."""

    calibration: Metre = 0.02
    """Greatest distance of the flange, in any of many postures, between the controller's own DH figures, factory calibration
    included, and a nominal UR5's. The plan is made with the arm's own figures; further off it is another arm. Two UR5s whose
    figures are published are 3.0 and 3.3 mm off."""
    frame_position: Metre = 0.005
    """Greatest distance of the reported torch tip from where a nominal arm has it, where the robot tells no other figures."""
    own_position: Metre = 0.0005
    """Greatest distance of the reported torch tip from where the DH figures that the robot tells have it."""
    frame_rotation: Radian = 0.0175
    """Greatest angle between the reported torch and where those kinematics put it (1 deg)."""
    tcp_position: Metre = 0.0001
    """Greatest distance of the controller's tool centre point from our mount."""
    tcp_rotation: Radian = 0.00175
    """Greatest angle between the controller's tool frame and our mount (0.1 deg)."""
    payload: float = 0.1
    """Greatest difference of the controller's payload from the torch's mass [kg]."""
    payload_cog: Metre = 0.02
    """Greatest distance between the controller's centre of gravity and the torch's."""
    rest: RadianPerSecond = 0.01
    """Greatest speed of a joint that stands still."""

    def __post_init__(self) -> None:
        require_within(self, CONTRACT_RANGES, "execution.contract")


@dataclass(frozen=True)
class ExecutionConfig:
    """Settings of `execute`."""

    settle: Second = 0.2
    """Time the last point is held, so that the log ends with the arm at rest."""
    blend: Second = 0.5
    """Time in which a trajectory takes over from where the arm really stands."""
    overlap: Metre = 0.005
    """Length of seam that is welded once more where a stopped weld is gone on with (`weldsim execute --from`)."""
    gate: GateConfig = field(default_factory=GateConfig)
    """What no command and no arm may do."""
    contract: ContractConfig = field(default_factory=ContractConfig)
    """How closely the robot must be what the plan takes it for."""
    simulation: SimulationConfig = field(default_factory=SimulationConfig)
    """How the simulated arm behaves."""
    ur: UrConfig = field(default_factory=UrConfig)
    """How a UR arm is reached and driven."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "execution")
