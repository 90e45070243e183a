"""Order a fault from a running virtual controller, or ask for its state."""

import json
import socket
from collections.abc import Mapping
from typing import Any

from weldsim.errors import InputError
from weldsim.execution.ur_ports import FAULTS

PATIENCE = 5.0  # [s]


def ask(host: str, request: Mapping[str, object]) -> dict[str, Any]:
    """The reply of the controller at `host` to {"fault": NAME, "seconds": T} or {"status": True}.

    Raises:
        InputError: nobody there, or a request that it refuses.
    """
    try:
        with socket.create_connection((host, FAULTS), timeout=PATIENCE) as sock, sock.makefile("rwb") as stream:
            stream.write(json.dumps(dict(request)).encode() + b"\n")
            stream.flush()
            line = stream.readline()
    except OSError as error:
        raise InputError(
            f"no virtual controller answers at {host} port {FAULTS}: {error.strerror or error}; start one with weldsim controller",
            host=host,
        ) from None
    reply = json.loads(line) if line else {"error": "the controller hung up"}
    if "error" in reply:
        raise InputError(reply["error"])
    return reply
