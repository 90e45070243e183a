"""What is mounted on the flange, as a program or the installation has told the controller."""

from dataclasses import dataclass, field

import numpy as np

from weldsim.urscript.poses import Matrix


@dataclass(eq=False)
class Tool:
    """Active TCP and payload.

    Attributes:
        tcp: X_FT as a pose [m, rad].  tcp_matrix: the same as a matrix.
        payload: mass [kg].  cog: its centre in F [m].  inertia: Ixx Iyy Izz Ixy Ixz Iyz [kg m2].
    """

    tcp: list[float] = field(default_factory=lambda: [0.0] * 6)
    tcp_matrix: Matrix = field(default_factory=lambda: np.eye(4))
    payload: float = 0.0
    cog: list[float] = field(default_factory=lambda: [0.0] * 3)
    inertia: list[float] = field(default_factory=lambda: [0.0] * 6)
