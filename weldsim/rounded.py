"""Numbers of JSON files as people read them, without the digits that floating point leaves behind."""

from typing import Any

DECIMALS = 9  # a nanometre, a nanoradian, a nanosecond
FINE = 12  # of quaternions, whose length is to be 1, and of settings that are shown
SMALL = 1e-3  # below it as many digits as a value has there
FINER = ("quaternion_wxyz",)
EXACT = ("dh",)  # an arm's own figures are compared with a nominal arm's to the last digit


def rounded(value: Any, decimals: int = DECIMALS) -> Any:
    """JSON values with every float rounded to `decimals`; one below a thousandth has three significant digits fewer.

    So 0.1 + 0.2 is 0.3 and 7.562070403954914e-05 is 7.56207e-05. Quaternions keep 12 decimals, an arm's DH figures all.
    """
    if isinstance(value, dict):
        return {
            key: item if key in EXACT else rounded(item, max(decimals, FINE) if key in FINER else decimals)
            for key, item in value.items()
        }
    if isinstance(value, list | tuple):
        return [rounded(item, decimals) for item in value]
    if not isinstance(value, float):
        return value
    near = round(value, decimals) if abs(value) >= SMALL else float(f"{value:.{decimals - 3}g}")
    return float(near) + 0.0  # no negative zero
