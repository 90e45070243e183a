"""The simulated arm: joint position servos under gravity and friction, in the MuJoCo world, in lock step with commands.

The servo follows an interpolated command with velocity feed-forward and gravity compensation; inertia, Coulomb friction,
a share of the torch's weight and a small lag are left to the feedback, so the tracking error is that of a real arm.
The torch pose is read from the physics.
"""

import copy
from collections import deque
from collections.abc import Callable
from typing import final

import mujoco
import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import ExecutionError
from weldsim.execution.config import SimulationConfig
from weldsim.execution.robot import Robot
from weldsim.frames import Transform
from weldsim.kinematics import DH, JOINT_NAMES
from weldsim.mounts import PAYLOAD, PAYLOAD_COG, X_FT
from weldsim.records import Event, RobotFacts, RobotState

HOLD = 10  # periods at the end of a stop
PASSED = 2000  # states kept for `passed_over`
BASE_BODY, FLANGE_BODY, TORCH_SITE = "ur5_base", "wrist_3_link", "torch_tip"

FrameCallback = Callable[["SimulatedRobot"], None]
"""Called every `frame_period` of simulated time, with the robot to be drawn."""


@final
class SimulatedRobot(Robot):
    """A UR5 of the twin.

    Attributes:
        model: its own copy of the world's model.  data: the state of the world.
        t: simulated time [s].
    """

    def __init__(
        self,
        model: mujoco.MjModel,
        q_start: Float[ndarray, "6"],
        config: SimulationConfig | None = None,
        on_frame: FrameCallback | None = None,
    ) -> None:
        """Args: model of a world with the arm; q_start [rad], where it rests; on_frame, to record pictures."""
        self.name = "simulated UR5"
        self.config = config or SimulationConfig()
        self.period = self.config.period
        self._on_frame = on_frame
        self._prepare(model)
        self._reset(q_start)
        self._connected, self._arc, self._mode = False, False, "idle"

    def _prepare(self, model: mujoco.MjModel) -> None:
        self.model = copy.copy(model)
        self._steps = max(1, round(self.config.period / self.config.timestep))
        self.model.opt.timestep = self.config.period / self._steps
        self.model.opt.integrator = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
        joints = [self.model.joint(name) for name in JOINT_NAMES]
        self._qpos = np.array([joint.qposadr[0] for joint in joints])
        self._dof = np.array([joint.dofadr[0] for joint in joints])
        self._ctrl = np.array([self.model.actuator(name).id for name in JOINT_NAMES])
        stiffness = self.model.actuator_gainprm[self._ctrl, 0]
        damping = -self.model.actuator_biasprm[self._ctrl, 2]
        # A position servo's damping acts on the joint's own speed; this lead turns it into damping of the speed error.
        self._lead = damping / stiffness - self.config.velocity_lag
        self._base, flange = self.model.body(BASE_BODY).id, self.model.body(FLANGE_BODY).id
        self._site = self.model.site(TORCH_SITE).id
        arm = self._below(self._base)
        tool = self._below(flange) & (np.arange(self.model.nbody) != flange)
        self.model.body_gravcomp[arm] = 1.0
        self.model.body_gravcomp[tool] = self.config.payload_known
        self._arm_geom = arm[self.model.geom_bodyid]

    def _below(self, root: int) -> ndarray:
        """Mask of the bodies that hang on `root`, itself included (a parent's index is less than its child's)."""
        mask = np.zeros(self.model.nbody, bool)
        mask[root] = True
        for body in range(root + 1, self.model.nbody):
            mask[body] = mask[self.model.body_parentid[body]]
        return mask

    def _reset(self, q_start: Float[ndarray, "6"]) -> None:
        self.data = mujoco.MjData(self.model)
        self.data.qpos[self._qpos] = q_start
        self.data.ctrl[self._ctrl] = q_start
        mujoco.mj_forward(self.model, self.data)
        self._q_ref, self._qd_ref = np.array(q_start, float), np.zeros(6)
        self._touching: set[tuple[str, str]] = set()
        self._events: list[Event] = []
        self._passed: deque[tuple[RobotState, bool]] = deque(maxlen=PASSED)
        self._next_frame = self.config.frame_period
        self.t = 0.0
        base_R, base_p = self.data.xmat[self._base].reshape(3, 3), self.data.xpos[self._base]
        self._X_BW = Transform("WB", base_R, base_p).inverse()
        self._look_for_contact()

    def connect(self) -> None:
        self._connected, self._mode = True, "running"

    def disconnect(self) -> None:
        if self._connected:
            self.stop()
        self._connected, self._mode = False, "idle"

    def facts(self) -> RobotFacts:
        """What this arm's controller believes: the nominal arm and mount, however the twin's cell really is."""
        if not self._connected:
            raise ExecutionError(f"{self.name}: asked for facts before connect()", rule="connection", t=self.t)
        return RobotFacts(
            model="UR5",
            series="simulated",
            version=mujoco.__version__,
            serial="",  # there is no arm to number
            dh=DH,
            X_FT=X_FT,
            payload_kg=PAYLOAD,
            payload_cog=PAYLOAD_COG,
            remote_control=True,
            safety="normal",
            mode=self._mode,
            program_running=False,
        )

    def state(self) -> RobotState:
        data = self.data
        X_WT = Transform("WT", data.site_xmat[self._site].reshape(3, 3), data.site_xpos[self._site])
        return RobotState(t=self.t, q=data.qpos[self._qpos], qd=data.qvel[self._dof], X_BT=self._X_BW @ X_WT, mode=self._mode)

    def torque(self) -> Float[ndarray, "6"]:
        return np.array(self.data.qfrc_actuator[self._dof])

    def set_arc(self, on: bool) -> None:
        self._arc = bool(on)

    @property
    def arc(self) -> bool:
        return self._arc

    def passed_over(self) -> tuple[tuple[RobotState, bool], ...]:
        """The way to rest of a stop."""
        passed = tuple(pair for pair in self._passed if pair[0].t < self.t)
        self._passed.clear()
        return passed

    def events(self) -> tuple[Event, ...]:
        happened, self._events = tuple(self._events), []
        return happened

    def servo(self, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> Float[ndarray, "6"]:
        if not self._connected:
            raise ExecutionError(f"{self.name}: commanded before connect()", rule="connection", t=self.t)
        self._advance(np.array(q, float), np.array(qd, float))
        return self._q_ref.copy()

    def stop(self) -> None:
        self._arc = False
        speed = float(np.abs(self._qd_ref).max())
        n = int(np.ceil(speed / self.config.stop_deceleration / self.period))
        for k in [*range(n, 0, -1), *[1] * HOLD]:
            qd = self._qd_ref * (k - 1) / k
            self._advance(self._q_ref + (self._qd_ref + qd) / 2 * self.period, qd)
            self._passed.append((self.state(), False))

    def _advance(self, q: Float[ndarray, "6"], qd: Float[ndarray, "6"]) -> None:
        """One period of physics, the reference running from the last command to (q, qd) on a cubic."""
        h, n = self.period, self._steps
        u = (np.arange(n) / n)[:, None]  # a step is driven by the reference of its beginning
        q0, v0, q1, v1 = self._q_ref, self._qd_ref * h, q, qd * h
        # Cubic Hermite basis and its derivative.
        ref = (1 + 2 * u) * (1 - u) ** 2 * q0 + u * (1 - u) ** 2 * v0 + u**2 * (3 - 2 * u) * q1 + u**2 * (u - 1) * v1
        rate = 6 * u * (1 - u) * (q1 - q0) + (1 - u) * (1 - 3 * u) * v0 + u * (3 * u - 2) * v1
        command = ref + rate * (self._lead / h)
        data, model = self.data, self.model
        for row in command:
            data.ctrl[self._ctrl] = row
            mujoco.mj_step(model, data)
        # mj_step leaves positions one step ahead of everything derived from them.
        mujoco.mj_kinematics(model, data)
        self._q_ref, self._qd_ref = q, qd
        self.t += h
        self._look_for_contact()
        if self._on_frame is not None and self.t + 1e-9 >= self._next_frame:
            self._next_frame += self.config.frame_period
            self._on_frame(self)

    def _look_for_contact(self) -> None:
        """An event for each pair of bodies that the arm has begun to touch."""
        touching: set[tuple[str, str]] = set()
        for k in range(self.data.ncon):
            geoms = self.data.contact.geom[k]
            if self._arm_geom[geoms].any() and self.data.contact.dist[k] < 0:
                bodies = sorted(self.model.body(self.model.geom_bodyid[g]).name or "world" for g in geoms)
                pair = (bodies[0], bodies[1])
                if pair not in touching and pair not in self._touching:
                    depth = -1e3 * float(self.data.contact.dist[k])
                    said = f"{depth:.2f}" if depth >= 0.005 else "under 0.01"
                    self._events.append(Event(t=self.t, kind="contact", text=f"{pair[0]} touches {pair[1]} ({said} mm deep)"))
                touching.add(pair)
        self._touching = touching
