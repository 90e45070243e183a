"""What tells one UR5 controller from another: series, version, control frequency, and how it names itself."""

from dataclasses import dataclass
from typing import Literal

Series = Literal["cb3", "e"]


@dataclass(frozen=True, kw_only=True)
class Profile:
    """A controller generation.

    Attributes:
        series: "cb3" or "e".
        version: major, minor, bugfix and build, as the RTDE version request reports them.
        frequency: control and greatest RTDE frequency [Hz].
        model: answer to the dashboard's `get robot model`.
        serial: answer to `get serial number`.
        software: answer to `PolyscopeVersion`.
        remote_control: whether it knows local and remote control; where not, it always obeys.
    """

    series: Series
    version: tuple[int, int, int, int]
    frequency: float
    model: str
    serial: str
    software: str
    remote_control: bool

    @property
    def period(self) -> float:
        """Control period [s]."""
        return 1.0 / self.frequency


PROFILES: dict[Series, Profile] = {
    "cb3": Profile(
        series="cb3",
        version=(3, 15, 8, 106339),
        frequency=125.0,
        model="UR5",
        serial="2013350001",
        software="URSoftware 3.15.8.106339 (Nov 23 2021)",
        remote_control=False,
    ),
    "e": Profile(
        series="e",
        version=(5, 11, 1, 108318),
        frequency=500.0,
        model="UR5",
        serial="20185500001",
        software="URSoftware 5.11.1.108318 (Nov 02 2021)",
        remote_control=True,
    ),
}
