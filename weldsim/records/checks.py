"""The checks that records run on themselves when they are built; each raises `RecordError` naming the record and the field."""

from typing import Any

import numpy as np
from numpy import ndarray

from weldsim.counted import counted
from weldsim.errors import RecordError
from weldsim.frames import read_only

MILLIMETRE_SPAN = 5.0  # [m] a cloud or path wider than this was surely written in millimetres


def store(record: object, name: str, value: Any, *, shape: tuple[int | str, ...], dtype: Any = float, nan: bool = False) -> None:
    """Freeze `value` into field `name` after checking shape (str = any size) and finiteness."""
    array = read_only(np.asarray(value, dtype))
    where = f"{type(record).__name__}.{name}"
    if array.ndim != len(shape) or any(isinstance(want, int) and got != want for got, want in zip(array.shape, shape, strict=True)):
        raise RecordError(f"{where}: shape {array.shape}, expected ({', '.join(map(str, shape))})", field=name)
    if not nan and array.dtype.kind == "f" and not np.isfinite(array).all():
        bad = int((~np.isfinite(array)).sum())
        raise RecordError(f"{where}: {counted(bad, 'value')} {'is' if bad == 1 else 'are'} not finite", field=name)
    object.__setattr__(record, name, array)


def require(condition: bool, record: object, name: str, message: str) -> None:
    """Raise `RecordError` about field `name` of `record` unless `condition` holds."""
    if not condition:
        raise RecordError(f"{type(record).__name__}.{name}: {message}", field=name)


def check_metres(record: object, name: str, points: ndarray) -> None:
    """Require points that span no more than MILLIMETRE_SPAN along any axis."""
    if len(points):
        with np.errstate(over="ignore"):
            span = max(float(column.max() - column.min()) for column in points.T)  # by column: reducing along axis 0 is slow
        require(span <= MILLIMETRE_SPAN, record, name, f"spans {span:.4g} m (limit {MILLIMETRE_SPAN:g} m): looks like millimetres")


def check_unit(record: object, name: str, vectors: ndarray) -> None:
    """Require unit vectors along the last axis, to 1e-6."""
    require(bool(np.allclose(np.linalg.norm(vectors, axis=-1), 1.0, atol=1e-6)), record, name, "not unit vectors")


def check_increasing(record: object, name: str, values: ndarray) -> None:
    """Require strictly increasing values."""
    require(bool((np.diff(values) > 0).all()), record, name, "not strictly increasing")
