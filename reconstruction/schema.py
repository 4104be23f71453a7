"""Data classes as a file's schema: how a field is stored is part of its type annotation."""

from collections.abc import Iterator
from dataclasses import fields
from typing import Any, Literal, NamedTuple, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from .errors import InputError


class Stored(NamedTuple):
    """How a field is stored: unit, axes (named or of fixed size), type, and what is allowed."""

    units: str
    axes: tuple[str | int, ...] = ()
    dtype: Literal["float64", "float32", "int64", "bool", "int32 or float64"] = "float64"
    sign: Literal["any", "not negative", "positive"] = "any"
    nan: bool = False

    def type_of(self, value: NDArray[Any]) -> np.dtype[Any]:
        """The type in which these numbers are kept."""
        if self.dtype == "int32 or float64":
            return np.dtype(np.int32 if value.dtype.kind in "iu" else np.float64)
        return np.dtype(self.dtype)


def stored_fields(part: type) -> Iterator[tuple[str, Stored]]:
    """The datasets of a part of the capture: name, and how it is stored."""
    hints = get_type_hints(part, include_extras=True)
    for field in fields(part):
        yield field.name, get_args(hints[field.name])[-1]


def check_value(name: str, value: NDArray[Any], stored: Stored, sizes: dict[str, int]) -> None:
    """Check shape and values of one dataset; the first to use a named axis sets its size."""
    if value.ndim == len(stored.axes):
        for axis, size in zip(stored.axes, value.shape, strict=True):
            if isinstance(axis, str):
                sizes.setdefault(axis, size)
    expected = tuple(sizes.get(str(axis), axis) for axis in stored.axes)
    if value.shape != expected:
        axes = ", ".join(f"{axis} = {sizes.get(str(axis), axis)}" for axis in stored.axes)
        raise InputError(f"{name} has shape {value.shape}, expected ({axes or 'a scalar'})")
    if not stored.nan and not np.isfinite(value).all():
        raise InputError(f"{name} holds values that are not finite")
    if value.dtype.kind in "iu" and stored.type_of(value) == np.int32:
        limits = np.iinfo(np.int32)
        if value.size and (value.min() < limits.min or value.max() > limits.max):
            raise InputError(f"{name} holds integers beyond 32 bits")
    bad = value <= 0 if stored.sign == "positive" else value < 0
    if stored.sign != "any" and bad.any():
        raise InputError(f"{name} is {value[bad].flat[0]}, must be {stored.sign}")
