"""How far one figure of a motion is from its limit."""

from dataclasses import dataclass
from typing import Any


@dataclass(frozen=True, kw_only=True)
class Margin:
    """The worst of one figure on the way.

    Attributes:
        figure: what it is.  value, limit: in `unit`.  least: whether the limit is one from below.
        t: when [s], None where that means nothing.  of: which joint or bodies.
        beyond: whether the figure is only known to lie beyond the value.
    """

    figure: str
    value: float
    limit: float
    unit: str
    least: bool
    t: float | None = None
    of: str = ""
    beyond: bool = False

    @property
    def said(self) -> tuple[str, str]:
        """Value and limit in words."""
        value = f"{'over ' if self.beyond else ''}{self.value:.3g} {self.unit}"
        return value, f"{'>=' if self.least else '<='} {self.limit:.3g} {self.unit}"

    @property
    def when(self) -> str:
        """The time in words, empty where it means nothing."""
        return "" if self.t is None else f"{self.t:.1f} s"


def margin_json(margin: Margin) -> dict[str, Any]:
    """One margin as JSON values, in its own unit."""
    return {
        "figure": margin.figure,
        "value": round(margin.value, 6),
        "limit": round(margin.limit, 6),
        "unit": margin.unit,
        "at_least": margin.least,
        "of": margin.of or None,
        "t": None if margin.t is None else round(margin.t, 3),
        "beyond": margin.beyond,
    }
