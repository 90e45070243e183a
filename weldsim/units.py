"""Units at the text edge: "12 mm" in, SI out, and the reverse for people.

Only `config`, `cli`, `console` and `report` import this module; everything inside weldsim is SI.
"""

import math
import re

from weldsim.errors import ConfigError

_SCALES: dict[str, dict[str, float]] = {
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3, "um": 1e-6, "in": 0.0254, "ft": 0.3048},
    "rad": {"rad": 1.0, "deg": math.pi / 180, "°": math.pi / 180, "mrad": 1e-3},
    "s": {"s": 1.0, "ms": 1e-3, "min": 60.0},
    "m/s": {
        "m/s": 1.0,
        "mm/s": 1e-3,
        "cm/s": 1e-2,
        "m/min": 1 / 60,
        "cm/min": 1e-2 / 60,
        "mm/min": 1e-3 / 60,
        "in/s": 0.0254,
        "in/min": 0.0254 / 60,
    },
    "rad/m": {"rad/m": 1.0, "deg/mm": math.pi / 180 * 1e3, "deg/m": math.pi / 180},
    "rad/s": {"rad/s": 1.0, "deg/s": math.pi / 180},
    "px": {"px": 1.0},
}
DIMENSIONS = frozenset(_SCALES)
"""The SI units a quantity can be declared in."""

COMMON = {"m": ("mm", "cm"), "rad": ("deg",), "s": ("ms",), "m/s": ("mm/s", "mm/min"), "rad/m": ("deg/mm",), "rad/s": ("deg/s",)}
"""Units in which welders write these, the commonest first."""

EXAMPLES = {
    "m": "12 mm",
    "rad": "15 deg",
    "s": "5 s",
    "m/s": "8 mm/s",
    "rad/m": "1 deg/mm",
    "rad/s": "30 deg/s",
    "px": "2 px",
}
"""One quantity of each kind as people write it."""

_SPELT = {
    **dict.fromkeys(("metre", "metres", "meter", "meters"), "m"),
    **dict.fromkeys(("centimetre", "centimetres", "centimeter", "centimeters"), "cm"),
    **dict.fromkeys(("millimetre", "millimetres", "millimeter", "millimeters", "mms"), "mm"),
    **dict.fromkeys(("µm", "μm", "micron", "microns", "micrometre", "micrometres", "micrometer", "micrometers"), "um"),
    **dict.fromkeys(("inch", "inches"), "in"),
    **dict.fromkeys(("foot", "feet"), "ft"),
    **dict.fromkeys(("degree", "degrees", "degs"), "deg"),
    **dict.fromkeys(("radian", "radians", "rads"), "rad"),
    **dict.fromkeys(("sec", "secs", "second", "seconds"), "s"),
    **dict.fromkeys(("msec", "millisecond", "milliseconds"), "ms"),
    **dict.fromkeys(("minute", "minutes", "mins"), "min"),
    **dict.fromkeys(("pixel", "pixels"), "px"),
    "ipm": "in/min",
}
"""Other names of units."""

_UNIT = r"[A-Za-z/°µμ]*"
_NUMBER = r"[-+]?(?:\d+\.?\d*|\.\d+)(?:[eE][-+]?\d+)?"
_NUMBER_UNIT = re.compile(rf"\s*({_NUMBER})\s*({_UNIT})\s*")
_DECIMAL_COMMA = re.compile(rf"\s*([-+]?\d+),(\d+)\s*({_UNIT})\s*")
_ROW = re.compile(rf"{_NUMBER}(?:\s*(?:%|[A-Za-z°µμ]{_UNIT}))?")


def parse(value: object, dimension: str, *, where: str = "value") -> float:
    """The SI value of `value`, a bare SI number or text such as "12 mm".

    Args:
        value: a number (SI already) or text with a unit.
        dimension: the SI unit expected, a key of the scale table ("m", "rad", "m/s", ...).
        where: what to call the value in an error.
    Raises:
        ConfigError: text that is no number, an unknown unit, or a number that is not finite.
    """
    scales = _SCALES[dimension]
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        raise ConfigError(f"{where}: {value!r} is no quantity in {dimension}", value=value)
    if isinstance(value, str):
        match = _NUMBER_UNIT.fullmatch(_with_point(value, where))
        if match is None:
            example = EXAMPLES[dimension]
            raise ConfigError(f'{where}: {value!r} is no quantity; write a number with a unit, "{example}" say', value=value)
        unit = known_unit(match[2], dimension) or match[2] or dimension
        if unit not in scales:
            raise ConfigError(f"{where}: unit {unit!r} is not one of {', '.join(scales)}", value=value, allowed=list(scales))
        number = float(match[1]) * scales[unit]
    else:
        number = float(value)
    if not math.isfinite(number):
        raise ConfigError(f"{where}: {value!r} is not finite", value=value)
    return number


def known_unit(word: str, dimension: str) -> str:
    """The unit of that dimension that a word is, in whatever case and spelling, "mm" for "Millimetres"; "" for none."""
    scales = _SCALES[dimension]
    if word in scales:
        return word
    plain = "/".join(_SPELT.get(part.lower(), part.lower()) for part in word.split("/"))
    return plain if plain in scales else ""


def is_unit(word: str) -> bool:
    """Whether a word is a unit of any kind."""
    return any(known_unit(word, dimension) for dimension in DIMENSIONS)


def row(text: str, count: int) -> list[str]:
    """The quantities of a row as people write them, text each: between semicolons, commas or blanks, in brackets or none.

    "20 mm, -35 mm", "20mm -35mm" and "1,5 deg; 2 deg" are two each. Where that gives another number than `count`, what stands
    between commas.
    """
    text = text.strip().strip("[](){}").strip()
    if ";" in text:
        return [part.strip() for part in text.split(";")]
    commas = [part.strip() for part in text.split(",")]
    wide = re.split(r",\s+", text)  # where the commas in the numbers are decimal ones
    blanks = _ROW.findall(text) if not re.sub(r"[\s,]", "", _ROW.sub("", text)) else []
    return next((parts for parts in (commas, wide, blanks) if len(parts) == count), commas)


def _with_point(text: str, where: str) -> str:
    """The text with a decimal comma as a point. Raises ConfigError where it may as well part thousands."""
    match = _DECIMAL_COMMA.fullmatch(text)
    if match is None:
        return text
    whole, part, unit = match.groups()
    if len(part) == 3 and whole.lstrip("+-") != "0":
        unit = f" {unit}".rstrip()
        raise ConfigError(f'{where}: {text.strip()!r} is "{whole}.{part}{unit}" or "{whole}{part}{unit}"? write which', value=text)
    return f"{whole}.{part} {unit}"


def meant(value: object, dimension: str, low: float, high: float) -> str:
    """What a bare number that lies outside low to high [SI] was meant as, '"90 deg" is meant?'; "" for text with a unit, or where
    no common unit brings it inside."""
    if isinstance(value, bool) or not isinstance(value, str | int | float):
        return ""
    match = _NUMBER_UNIT.fullmatch(str(value))
    if match is None or match[2]:
        return ""
    fitting = (unit for unit in COMMON.get(dimension, ()) if low <= float(match[1]) * _SCALES[dimension][unit] <= high)
    unit = next(fitting, None)
    return "" if unit is None else f'"{match[1]} {unit}" is meant?'


def percent(text: str) -> float | None:
    """The share that "30 %" is, 0.3; None for any other text."""
    match = _NUMBER_UNIT.fullmatch(text.strip().removesuffix("%"))
    return float(match[1]) / 100 if match is not None and not match[2] and text.strip().endswith("%") else None


def meant_percent(value: object, low: float, high: float) -> str:
    """What a bare number outside a share's range was meant as, '"30 %" is meant?'; "" where that lies outside too."""
    if isinstance(value, bool) or not isinstance(value, int | float) or not (high <= 2 < value and low <= value / 100 <= high):
        return ""
    return f'"{value:g} %" is meant?'


def written(value: float, dimension: str) -> tuple[str, str]:
    """The number and the unit with which welders write an SI value, to six digits; `parse` reads the two together."""
    unit = COMMON.get(dimension, (dimension,))[0]
    if dimension == "s" and abs(value) >= 1.0:
        unit = "s"
    return f"{value / _SCALES[dimension][unit]:.6g}", unit


def length_scale(unit: str) -> float:
    """Metres per `unit` of length. Raises ConfigError for an unknown one."""
    unit = known_unit(unit, "m") or unit
    if unit not in _SCALES["m"]:
        raise ConfigError(f"unit {unit!r} is not one of {', '.join(_SCALES['m'])}", value=unit, allowed=list(_SCALES["m"]))
    return _SCALES["m"][unit]


def to_mm(metres: float) -> float:
    """Millimetres."""
    return metres * 1e3


def to_deg(radians: float) -> float:
    """Degrees."""
    return math.degrees(radians)
