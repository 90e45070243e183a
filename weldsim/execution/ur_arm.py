"""The DH figures that a UR controller has of its own arm, factory calibration included, read once from its primary interface.

Kinematics info holds complete figures: those of the model with the calibration's corrections added. The page that describes it
does not say so; the comment in the manufacturer's client library does, its simulator sends a2 = -0.425 m there and no zeros, and
figures that owners of two UR5s published (ROS driver issue 457: as sent; ros-industrial/universal_robot issue 357: corrections
from calibration.conf, to be added) put the flange within 3.4 mm of the nominal arm's that way, though some d are hundreds of
metres. They are taken whole, and welds are planned with them. Should a controller send bare corrections after all, they make an
arm that is metres off, and the contract refuses it; it refuses other figures, too, than the controller's own pose is made with.
Sub-package 6, 'Configuration data', has DH figures too, in the simulator the same ones; by its name they are the model's, and it
is not read.

Verified over sockets against our own virtual controller, never on a real one.
"""

import socket
import time
from dataclasses import dataclass

from jaxtyping import Float
from numpy import ndarray

from weldsim.execution.primary_packet import ROBOT_STATE, KinematicsInfo, MessageReader, PrimaryError, kinematics_in
from weldsim.execution.rtde_talk import LinkError
from weldsim.execution.ur_ports import PRIMARY, PRIMARY_READ_ONLY

PATIENCE = 0.5  # [s] in all: the first of ten states a second is due after 0.1
RECEIVE_SIZE = 65536
STATUS = {0: "not calibrated", 1: "calibrated, not linearised", 2: "calibrated"}


@dataclass(frozen=True, eq=False)
class ArmTold:
    """What a controller tells of its arm.

    Attributes:
        dh: (6, 4) as `RobotFacts` has it, or None.  note: how good it is, or why there is none, in one word: "closed" (nobody
            listens, or hangs up), "silent" (nothing of the arm in time), "garbled" (bytes that cannot be).
    """

    dh: Float[ndarray, "6 4"] | None
    note: str


def tell_arm(host: str, seconds: float = PATIENCE) -> ArmTold:
    """What the controller tells within that time [s]; it need not, and nothing is raised where it does not."""
    try:
        found = read_arm(host, seconds)
    except LinkError as error:
        return ArmTold(None, str(error.data["reason"]))
    return ArmTold(found.dh, STATUS.get(found.status, f"calibration status {found.status}"))


def read_arm(host: str, seconds: float = PATIENCE) -> KinematicsInfo:
    """The first kinematics info that comes within that time [s]. Nothing is sent, so that nothing can be started.

    Raises:
        LinkError: none comes; `data`: reason, in one word.
    """
    end = time.monotonic() + seconds
    with _connected(host, end) as sock:
        reader = MessageReader()
        while (left := end - time.monotonic()) > 0:
            try:
                sock.settimeout(left)
                data = sock.recv(RECEIVE_SIZE)
            except TimeoutError:
                break
            except OSError as error:
                raise LinkError(f"primary interface: {error.strerror or error}", reason="closed") from None
            if not data:
                raise LinkError("primary interface: the controller hung up", reason="closed")
            try:
                for kind, contents in reader.feed(data):
                    if kind == ROBOT_STATE and (found := kinematics_in(contents)) is not None:
                        return found
            except PrimaryError as error:
                raise LinkError(f"primary interface: {error}", reason="garbled") from None
    raise LinkError(f"primary interface: nothing of the arm within {seconds:g} s", reason="silent")


def _connected(host: str, end: float) -> socket.socket:
    """A connection by that time; newer software may serve the read-only port alone."""
    reason = "silent"
    for port in (PRIMARY, PRIMARY_READ_ONLY):
        left = end - time.monotonic()
        if left <= 0:
            break
        try:
            return socket.create_connection((host, port), left)
        except TimeoutError:
            reason = "silent"
        except OSError:
            reason = "closed"
    raise LinkError(f"{host} ports {PRIMARY}, {PRIMARY_READ_ONLY}: {reason}", reason=reason)
