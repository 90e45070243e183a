"""A factory calibration of the arm: what its DH figures differ by from those of its model."""

import math
import tomllib
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from jaxtyping import Float
from numpy import ndarray

from weldsim.errors import ConfigError
from weldsim.execution.primary_packet import FURTHEST
from weldsim.kinematics import DH

Six = tuple[float, float, float, float, float, float]
NONE: Six = (0.0, 0.0, 0.0, 0.0, 0.0, 0.0)
LIMITS = {"delta_theta": 2 * math.pi, "delta_a": 1.0, "delta_d": FURTHEST / 2, "delta_alpha": 0.1}  # [rad], [m]
STATUS = (0, 1, 2)


@dataclass(frozen=True)
class Calibration:
    """Corrections of the six joints, as a controller's `calibration.conf` has them; none by default.

    Attributes:
        delta_theta [rad], delta_a [m], delta_d [m], delta_alpha [rad]: to be added to the model's figures.
        calibration_status: 0 not initialised, 1 not linearised, 2 linearised.
    """

    delta_theta: Six = NONE
    delta_a: Six = NONE
    delta_d: Six = NONE
    delta_alpha: Six = NONE
    calibration_status: int = 0

    @property
    def dh(self) -> Float[ndarray, "6 4"]:
        """The arm's own figures, as `weldsim.kinematics.DH` has those of the model."""
        return DH + np.array([self.delta_theta, self.delta_a, self.delta_d, self.delta_alpha]).T


def read_calibration(path: Path) -> Calibration:
    """The `[mounting]` of a controller's `calibration.conf`, which reads as TOML; its further entries are passed over.

    Raises:
        ConfigError: no such file, or one without six numbers, within limits, for each correction; `data`: path, key.
    """
    try:
        table = tomllib.loads(path.read_text(encoding="utf-8")).get("mounting")
    except OSError as error:
        raise ConfigError(f"calibration {path}: {error.strerror or error}", path=str(path)) from None
    except (UnicodeDecodeError, tomllib.TOMLDecodeError) as error:
        raise ConfigError(f"calibration {path}: {error}; a controller's calibration.conf is meant", path=str(path)) from None
    if not isinstance(table, dict):
        raise ConfigError(f"calibration {path}: no table [mounting]; a controller's calibration.conf is meant", path=str(path))
    status = table.get("calibration_status", 2)
    if isinstance(status, bool) or status not in STATUS:
        raise ConfigError(f"calibration {path}: calibration_status = {status!r}, expected 0, 1 or 2", path=str(path))
    theta, a, d, alpha = (_six(table.get(key), key, path) for key in LIMITS)
    return Calibration(theta, a, d, alpha, int(status))


def _six(values: object, key: str, path: Path) -> Six:
    """Six numbers within their limit. Raises ConfigError."""
    limit = LIMITS[key]
    unit = "rad" if key in ("delta_theta", "delta_alpha") else "m"
    if not isinstance(values, list) or len(values) != 6 or not all(_within(x, limit) for x in values):
        raise ConfigError(
            f"calibration {path}: {key} = {values!r}, expected six numbers within +-{limit:.4g} {unit}", path=str(path), key=key
        )
    one, two, three, four, five, six = (float(x) for x in values)
    return one, two, three, four, five, six


def _within(x: object, limit: float) -> bool:
    return isinstance(x, int | float) and not isinstance(x, bool) and abs(x) <= limit
