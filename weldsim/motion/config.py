"""What motion planning may choose: lead-in and lead-out, limits of the arm and of the tip, tolerances of the plan."""

from dataclasses import dataclass

from weldsim.quantity import Metre, MetrePerSecond, Radian, RadianPerMetre, RadianPerSecond, Second, require_within

# Beyond these a plan takes for ever, or has more samples than memory, without being of use to any arm.
RANGES = {
    "period": (5e-4, 0.1),
    "approach": (0.0, 1.0),
    "lead_speed": (1e-4, 5.0),
    "air_speed": (1e-4, 5.0),
    "tip_acceleration": (1e-3, 1e3),
    "tip_jerk": (1e-2, 1e6),
    "joint_speed": (1e-3, 10.0),
    "joint_acceleration": (1e-3, 1e3),
    "joint_jerk": (1e-2, 1e5),
    "joint_speed_limit": (1e-3, 100.0),
    "joint_acceleration_limit": (1e-3, 1e4),
    "joint_jerk_limit": (1e-1, 1e6),
    "limit_margin": (0.0, 3.0),
    "grid": (5e-5, 0.1),
    "spline_tolerance": (1e-8, 0.01),
    "position_tolerance": (1e-8, 0.01),
    "axis_tolerance": (1e-8, 1.0),
    "joint_rate": (1.0, 1e5),
    "rolls": (1, 3600),
    "candidates": (1, 1000),
    "pieces": (1, 100),
    "floor": (-2.0, 2.0),
    "clearance": (0.0, 1.0),
    "least_speed": (0.0, 1.0),
}


@dataclass(frozen=True)
class MotionConfig:
    """Settings of `plan_motion`. The welding speed is not here: it belongs to the path."""

    period: Second = 0.008
    """Sampling period of the joint trajectory; a CB3 controller streams at 125 Hz."""
    approach: Metre = 0.05
    """Straight lead-in along the wire before the weld, and lead-out after it, where the path brings none of its own."""
    lead_speed: MetrePerSecond = 0.10
    """Greatest tip speed on the lead-in and lead-out."""
    air_speed: MetrePerSecond = 0.24
    """Greatest tip speed of an air move; the safety gate stops the arm at 0.25 m/s."""
    tip_acceleration: float = 0.5
    """Greatest tip acceleration along any straight or welded piece [m/s2]; 8 mm/s is reached within 0.5 mm."""
    tip_jerk: float = 20.0
    """Greatest tip jerk along any straight or welded piece [m/s3]."""
    joint_speed: RadianPerSecond = 1.05
    """Greatest joint speed of an air move, the 60 deg/s that UR controllers use by default."""
    joint_acceleration: float = 1.4
    """Greatest joint acceleration of an air move [rad/s2], the 80 deg/s2 that UR controllers use by default."""
    joint_jerk: float = 15.0
    """Greatest joint jerk of an air move [rad/s3]."""
    joint_speed_limit: RadianPerSecond = 3.0
    """Joint speed that no sample may exceed (published limit 180 deg/s): a weld slows down before it is reached."""
    joint_acceleration_limit: float = 10.0
    """Joint acceleration that no sample may exceed [rad/s2]: a weld slows down before it is reached."""
    joint_jerk_limit: float = 350.0
    """Joint jerk that no sample may exceed [rad/s3]: ramps are softened and a weld slows down before it is reached. The maker
    publishes none; in logs of a real UR5 the targets of its own controller reach 357."""
    limit_margin: Radian = 0.1
    """Distance kept from each joint's end stop."""
    grid: Metre = 0.002
    """First spacing of the poses that differential kinematics solves; halved where the joint spline strays."""
    spline_tolerance: Metre = 0.00002
    """Greatest distance of the joint spline's tip from the path between the solved poses."""
    position_tolerance: Metre = 0.00001
    """Greatest distance of a solved pose from the path."""
    axis_tolerance: Radian = 0.00087
    """Greatest angle between the wire and the path's wire axis at a solved pose (0.05 deg)."""
    joint_rate: RadianPerMetre = 60.0
    """Greatest change of any joint per length of path: more is a branch flip or a singularity."""
    rolls: int = 36
    """How many rotations about the wire are tried at each place."""
    candidates: int = 8
    """How many ways to hold the arm are followed before the path is called infeasible."""
    pieces: int = 4
    """Into how many pieces a weld may be cut, the arc off in between, where no single sweep of the arm covers it; 1: never."""
    floor: Metre = 0.0
    """Height of the table top in the base frame."""
    clearance: Metre = 0.08
    """Distance kept between the arm's centre lines and the table, and between the torch and the arm."""
    least_speed: float = 0.5
    """Share of the asked welding speed below which a dry run calls a weld that joint limits make slower a failure; any slowing
    is told."""
    return_home: bool = True
    """Whether the arm goes back to where it started."""

    def __post_init__(self) -> None:
        require_within(self, RANGES, "motion")
