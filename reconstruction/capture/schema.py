"""Data classes as a file's schema: type annotations say how fields are stored."""

from collections.abc import Sequence
from dataclasses import fields, replace
from typing import Any, Literal, NamedTuple, TypeVar, get_args, get_type_hints

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError

FRAMES, TRUTHS = "frames", "truths"
"""Axes of readings and of their truth."""

LIMITS = {
    "1": (1e-18, 1e9),
    "count": (1e-15, 1e15),
    "electron": (1e-15, 1e15),
    "electron/count": (1e-12, 1e12),
    "electron/J": (1e-3, 1e24),
    "Hz": (1e-3, 1e10),
    "J": (1e-24, 1e6),
    "m": (1e-9, 1e7),
    "rad": (1e-9, 1e6),
    "s": (1e-18, 1e10),
}
"""Minimum of positive values and maximum magnitude, by unit. No instrument, and no time since 1970,
comes near them, and values between can be squared and divided."""

Part = TypeVar("Part")

_fields: dict[type, tuple[tuple[str, "Stored"], ...]] = {}


class Stored(NamedTuple):
    """Storage of a field: unit, axes (named or of fixed size), type, and allowed values.

    With ``one_for_all`` a single value may stand for all along the axis.
    """

    units: str
    axes: tuple[str | int, ...] = ()
    dtype: Literal["float64", "float32", "int64", "bool", "int32 or float64"] = "float64"
    sign: Literal["any", "not negative", "positive"] = "any"
    nan: bool = False
    one_for_all: bool = False

    @property
    def by_frame(self) -> bool:
        """Whether there is a value per frame, or per frame with a truth."""
        return bool(self.axes) and self.axes[0] in (FRAMES, TRUTHS)

    def type_of(self, value: NDArray[Any]) -> np.dtype[Any]:
        """Type in which these numbers are stored."""
        if self.dtype == "int32 or float64":
            return np.dtype(np.int32 if value.dtype.kind in "iu" else np.float64)
        return np.dtype(self.dtype)

    def converted(self, name: str, value: NDArray[Any]) -> NDArray[Any]:
        """Convert values to the stored type; raises InputError for values that are not allowed."""
        dtype = self.type_of(value)
        if value.dtype.kind not in ("iufb" if self.dtype == "bool" else "iuf"):
            raise InputError(f"{name} must hold numbers, found {value.dtype}")
        if not self.nan and not np.isfinite(value).all():
            raise InputError(f"{name} holds values that are not finite")
        if np.isinf(value).any():
            raise InputError(f"{name} holds infinite values; write nan for unknown values")
        if dtype.kind == "i" and value.size:
            limits = np.iinfo(dtype)
            if not (value.min() >= limits.min and value.max() <= limits.max):
                raise InputError(f"{name} holds integers beyond {8 * dtype.itemsize} bits")
        with np.errstate(over="ignore"):  # infinities fail the limits below
            converted = value.astype(dtype, copy=False)
        bad = converted <= 0 if self.sign == "positive" else converted < 0
        if self.sign != "any" and bad.any():
            raise InputError(f"{name} is {value[bad].flat[0]}, must be {self.sign}")
        if dtype.kind == "f":
            self._check_limits(name, converted)
        return converted

    def _check_limits(self, name: str, value: NDArray[Any]) -> None:
        minimum, maximum = LIMITS[self.units]
        if (result := value[np.abs(value) > maximum]).size:
            raise InputError(f"{name} is {result[0]:g}, must be within ±{maximum:g} {self.units}")
        if self.sign == "positive" and (result := value[value < minimum]).size:
            raise InputError(f"{name} is {result[0]:g}, must be at least {minimum:g} {self.units}")


def stored_fields(part: type) -> tuple[tuple[str, Stored], ...]:
    """Name and storage of each dataset of a part of the capture, a data class such as `Buckets`."""
    if part not in _fields:
        hints = get_type_hints(part, include_extras=True)
        names = (field.name for field in fields(part))
        _fields[part] = tuple((name, get_args(hints[name])[-1]) for name in names)
    return _fields[part]


def present_fields(part: object) -> tuple[tuple[str, "Stored"], ...]:
    """The `stored_fields` of a part that it has: one that is None is not stored."""
    return tuple(each for each in stored_fields(type(part)) if getattr(part, each[0]) is not None)


def readings_of(part: object) -> tuple[str, ...]:
    """Names of the fields of a part with a value per frame."""
    return tuple(name for name, stored in present_fields(part) if stored.by_frame)


def between(part: Part, start: int, stop: int) -> Part:
    """Restrict the readings of a part to frames ``start`` to ``stop``, exclusive."""
    cut = {name: getattr(part, name)[start:stop] for name in readings_of(part)}
    return replace(part, **cut)  # type: ignore[type-var]


def joined(parts: Sequence[Part]) -> Part:
    """Join the rows of parts that follow one another."""
    rows = {
        name: np.concatenate([getattr(part, name) for part in parts])
        for name in readings_of(parts[0])
    }
    return replace(parts[0], **rows)  # type: ignore[type-var]


def check_shape(name: str, shape: tuple[int, ...], stored: Stored, sizes: dict[str, int]) -> None:
    """Check the shape of a dataset; the first dataset with a named axis sets its size."""
    if stored.one_for_all and shape == ():
        return
    if len(shape) == len(stored.axes):
        for axis, size in zip(stored.axes, shape, strict=True):
            if isinstance(axis, str):
                sizes.setdefault(axis, size)
    expected = tuple(sizes.get(str(axis), axis) for axis in stored.axes)
    if shape != expected:
        axes = ", ".join(f"{axis} = {sizes.get(str(axis), axis)}" for axis in stored.axes)
        raise InputError(f"{name} has shape {shape}, expected ({axes or 'a scalar'})")
