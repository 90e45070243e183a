"""Functions about numbers and lists."""

import math
import random as chance
from typing import Any

from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import number


class NumberFunctions:
    """Arithmetic beyond the operators; angles in radians."""

    def __init__(self) -> None:
        self._chance = chance.Random(0)

    def sin(self, f: float) -> float:
        return math.sin(number(f))

    def cos(self, f: float) -> float:
        return math.cos(number(f))

    def tan(self, f: float) -> float:
        return math.tan(number(f))

    def asin(self, f: float) -> float:
        return math.asin(number(f))

    def acos(self, f: float) -> float:
        return math.acos(number(f))

    def atan(self, f: float) -> float:
        return math.atan(number(f))

    def atan2(self, x: float, y: float) -> float:
        """Angle of the point (y, x), as URScript names its arguments: atan2(sine, cosine)."""
        return math.atan2(number(x), number(y))

    def sqrt(self, f: float) -> float:
        return math.sqrt(number(f))

    def pow(self, base: float, exponent: float) -> float:
        return number(base) ** number(exponent)

    def log(self, b: float, f: float) -> float:
        """Logarithm of f to base b."""
        return math.log(number(f), number(b))

    def d2r(self, d: float) -> float:
        return math.radians(number(d))

    def r2d(self, r: float) -> float:
        return math.degrees(number(r))

    def ceil(self, f: float) -> int:
        return math.ceil(number(f))

    def floor(self, f: float) -> int:
        return math.floor(number(f))

    def random(self) -> float:
        """Uniform from 0 to 1; the same sequence after every start."""
        return self._chance.random()

    def length(self, v: Any) -> int:
        return self.get_list_length(v)

    def get_list_length(self, v: Any) -> int:
        if not isinstance(v, list | str):
            raise ScriptError("get_list_length: expected a list")
        return len(v)

    def size(self, v: Any) -> Any:
        """The length of a list or text; rows and columns of a matrix."""
        rows = _rows(v)
        return self.get_list_length(v) if rows is None else [len(rows), len(rows[0])]

    def transpose(self, m: Any) -> list[list[float]]:
        """The matrix with its rows as columns."""
        if (rows := _rows(m)) is None:
            raise ScriptError("transpose: expected a matrix [[1, 2], [3, 4]]")
        return [list(column) for column in zip(*rows, strict=True)]

    def integer_to_binary_list(self, x: int) -> list[bool]:
        """The 32 bits of x, the least significant first."""
        return [bool(int(number(x)) >> k & 1) for k in range(32)]

    def binary_list_to_integer(self, v: Any) -> int:
        """The inverse of `integer_to_binary_list`."""
        return sum(1 << k for k, bit in enumerate(v) if bit)


def _rows(value: Any) -> list[list[float]] | None:
    """The rows of a matrix, all of one length; None of anything else."""
    if not isinstance(value, list) or not value or not all(isinstance(row, list) and row for row in value):
        return None
    return value if len({len(row) for row in value}) == 1 else None
