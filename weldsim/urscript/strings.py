"""Functions about texts."""

from math import isfinite
from typing import Any

from weldsim.urscript.errors import ScriptError
from weldsim.urscript.values import Pose, number, type_name


class StringFunctions:
    """Texts of values, parts of texts, and numbers out of them."""

    def to_str(self, val: Any) -> str:
        return to_text(val)

    def str_cat(self, op1: Any, op2: Any) -> str:
        return f"{to_text(op1)}{to_text(op2)}"

    def str_len(self, str: str) -> int:
        return len(_text(str))

    def str_empty(self, str: str) -> bool:
        return not _text(str)

    def str_at(self, src: str, index: int) -> str:
        """The character at index, counted from 0."""
        text, at = _text(src), int(number(index))
        if not 0 <= at < len(text):
            raise ScriptError(f"str_at: index {at} is not one of 0 to {len(text) - 1}")
        return text[at]

    def str_find(self, src: str, target: str, start_from: int = 0) -> int:
        """Where target begins in src, from start_from on; -1 where it does not occur."""
        return _text(src).find(_text(target), max(0, int(number(start_from))))

    def str_sub(self, src: str, index: int, len: int = -1) -> str:
        """`len` characters from index on, all by default."""
        text, at, size = _text(src), int(number(index)), int(number(len))
        if at < 0:
            raise ScriptError(f"str_sub: index {at} is below 0")
        return text[at:] if size < 0 else text[at : at + size]

    def to_num(self, str_number: str) -> float | int:
        """The number that a text says."""
        text = _text(str_number).strip()
        try:
            value = float(text)
        except ValueError:
            value = float("nan")
        if not isfinite(value):
            raise ScriptError(f"to_num: {text!r} is no number")
        return int(text) if text.lstrip("+-").isdigit() else value


def to_text(value: Any) -> str:
    """A value as `textmsg` writes it."""
    if isinstance(value, float):
        return f"{value:.6g}"
    if isinstance(value, list):
        inner = ", ".join(to_text(item) for item in value)
        return f"{'p' if type(value) is Pose else ''}[{inner}]"
    return str(value)


def _text(value: Any) -> str:
    if not isinstance(value, str):
        raise ScriptError(f"expected a text, not {type_name(value)}")
    return value
