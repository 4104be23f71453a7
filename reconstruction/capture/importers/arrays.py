"""Captures from arrays of bucket readings with a pattern plan or the patterns themselves."""

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Floats, usual_float_errors
from ...base.errors import InputError
from ...operators import Basis, PatternPlan, checked_shape, fwht, plan_of_rows
from ...operators.bases.dense import Dense
from ...operators.bases.hadamard import Hadamard
from ...operators.hadamard import power_of_two
from ..buckets import Buckets
from ..model import Capture, Optics, Provenance
from ..spots import Spots
from .about import checked_about

MAX_VALUES = 2**26
"""Maximum pixels of all patterns together, unless they are Hadamard patterns."""


@usual_float_errors
def plan_from_matrix(
    patterns: ArrayLike, shape: tuple[int, int]
) -> tuple[PatternPlan, NDArray[np.int8]]:
    """Plan from a matrix of exposed patterns.

    Raises InputError if the shape does not fit, or naming the first value out of bounds.

    Parameters
    ----------
    patterns : array, (M, N), (M, H, W) or (H, W, M)
        Pixels row-major, 0..1 for displayed light or -1..1 for signed values.
    shape : tuple of int
        Rows and columns of the image.

    Returns
    -------
    plan : PatternPlan
        Of Hadamard patterns if every row is one, else of a dense basis.
    sign : array of int8, (M,)
        Factor of each reading: -1 for signed Hadamard rows -h, else 1.
    """
    matrix = np.asarray(patterns, dtype=np.float64)
    height, width = shape = checked_shape(shape)
    matrix = _flat(matrix, shape)
    if matrix.ndim != 2 or not len(matrix) or matrix.shape[1] != height * width:
        raise InputError(
            f"the pattern matrix has shape {matrix.shape}, expected (M, {height * width}) for "
            f"{height} x {width} pixels"
        )
    good = np.abs(matrix) <= 1
    if not good.all():
        row, column = np.unravel_index(good.argmin(), matrix.shape)
        raise InputError(
            f"row {row} of the pattern matrix holds {matrix[row, column]:g}; allowed: 0..1 for "
            "displayed light, -1..1 for signed values"
        )
    displayed = bool(matrix.min() >= 0)
    rows = _hadamard_rows(2 * matrix - 1 if displayed else matrix, shape)
    if rows is None:
        transmittance = matrix if displayed else (1 + matrix) / 2
        basis: Basis = Dense(transmittance.reshape(-1, height, width))
        index, sign = np.arange(len(matrix), dtype=np.int32), np.ones(len(matrix), np.int8)
    else:
        basis = Hadamard(shape)
        index, sign = rows
    polarity = sign if displayed else np.zeros_like(sign)
    plan = PatternPlan(shape, index, polarity, patterns=basis)
    return plan, np.ones_like(sign) if displayed else sign


def _flat(patterns: Floats, shape: tuple[int, int]) -> Floats:
    """Patterns (M, N) of images (M, H, W), or (H, W, M) as MATLAB stacks them; others as they are.

    Raises InputError if it may be either.
    """
    if patterns.ndim != 3:
        return patterns
    first, last = patterns.shape[1:] == shape, patterns.shape[:2] == shape
    if first and last:
        raise InputError(
            f"the patterns have shape {patterns.shape}, which may be (M, H, W) or (H, W, M): give "
            "(M, H * W)"
        )
    if last:
        patterns = np.moveaxis(patterns, 2, 0)
    return patterns.reshape(len(patterns), -1) if first or last else patterns


def _hadamard_rows(
    signed: Floats, shape: tuple[int, int]
) -> tuple[NDArray[np.int32], NDArray[np.int8]] | None:
    """Index and sign of each row h or -h, None if any is not a Hadamard row."""
    if not all(power_of_two(side) for side in shape) or (np.abs(signed) != 1).any():
        return None
    spectrum = fwht(signed)
    index = np.abs(spectrum).argmax(axis=1)
    peak = spectrum[np.arange(len(index)), index]
    if (np.abs(peak) != signed.shape[1]).any():
        return None
    return index.astype(np.int32), np.sign(peak).astype(np.int8)


def plan_from_rows(
    rows: ArrayLike,
    shape: tuple[int, int],
    *,
    order: str = "natural",
    polarity: str | ArrayLike = "signed",
) -> PatternPlan:
    """Plan of Hadamard patterns by row number.

    Raises InputError if a number is fractional or out of range, or the polarity is invalid.

    Parameters
    ----------
    rows : array, (K,)
        Numbers from 0, counted in ``order``.
    shape : tuple of int
        Rows and columns of the image.
    order : str
        Named order.
    polarity : str or array, (K,)
        Name of a polarity sequence, or +1, -1 or 0 for each row, as in `PatternPlan`.
    """
    numbers = np.asarray(rows).ravel()
    if numbers.dtype.kind not in "iuf" or (numbers != np.floor(numbers)).any():
        raise InputError("the row numbers must be whole numbers")
    signs = polarity if isinstance(polarity, str) else np.asarray(polarity).ravel().tolist()
    return plan_of_rows(Hadamard(shape), numbers.astype(np.int64), signs, order)


def plan_from_factors(
    vertical: ArrayLike, horizontal: ArrayLike
) -> tuple[PatternPlan, NDArray[np.int8]]:
    """Plan of all products of vertical and horizontal patterns.

    Raises InputError as `plan_from_matrix`, and if the patterns exceed `MAX_VALUES` pixels.

    Parameters
    ----------
    vertical : array, (A, H)
        Patterns down the image.
    horizontal : array, (B, W)
        Patterns along the image.

    Returns
    -------
    plan : PatternPlan
        Reading a B + b is that of the product of a and b: readings are (A, B) in C order.
    sign : array of int8, (A * B,)
        As of `plan_from_matrix`.
    """
    tall, wide = (
        np.atleast_2d(np.asarray(each, dtype=np.float64)) for each in (vertical, horizontal)
    )
    shape = checked_shape((tall.shape[1], wide.shape[1]))
    given_height, given_width = (_hadamard_rows(each, (1, each.shape[1])) for each in (tall, wide))
    if given_height is not None and given_width is not None:
        (down, sign_down), (along, sign_along) = given_height, given_width
        index = np.add.outer(down * shape[1], along).ravel()
        sign = np.multiply.outer(sign_down, sign_along).ravel().astype(np.int8)
        return PatternPlan(shape, index, np.zeros_like(sign)), sign
    if tall.size * wide.size > MAX_VALUES:
        raise InputError(
            f"{len(tall) * len(wide)} products of patterns of {shape[0]} x {shape[1]} pixels are "
            f"more than the {MAX_VALUES // (shape[0] * shape[1])} that can be held"
        )
    return plan_from_matrix(np.kron(tall, wide), shape)


def frames_of_columns(table: NDArray[Any]) -> NDArray[Any]:
    """Transpose a table (M, frames); raises InputError if a column just counts the lines."""
    counting = (np.diff(table, axis=0) == 1).all(axis=0) & (len(table) > 1)
    if counting.any():
        raise InputError(
            f"column {counting.argmax()} counts the lines; name the column of the readings"
        )
    return table.T


def readings_of(counts: ArrayLike, exposures: int) -> NDArray[Any]:
    """Readings per frame from an array of any layout.

    Raises InputError if no axis has M readings.

    Parameters
    ----------
    counts : array, (M,), (frames, M), (M, frames) or any of M values in C order
        An ambiguous array is taken as (frames, M).
    exposures : int
        M.

    Returns
    -------
    array, (frames, M)
    """
    array = np.asarray(counts)
    if array.dtype.kind == "b":
        raise InputError("the readings are booleans, not numbers")
    if array.size == exposures:
        return array.reshape(1, -1)
    if array.ndim == 2 and array.shape[1] == exposures:
        return array
    if array.ndim == 2 and array.shape[0] == exposures:
        return frames_of_columns(array)
    raise InputError(
        f"the readings have shape {array.shape}; the pattern plan expects {exposures} per frame"
    )


@usual_float_errors
def capture_from_readings(
    readings: ArrayLike,
    plan: PatternPlan,
    untrusted: Iterable[int] = (),
    about: Mapping[str, float] = MappingProxyType({}),
    *,
    spots: Spots | None = None,
    optics: Optics | None = None,
) -> Capture:
    """Capture (source hardware) from bucket readings.

    Raises InputError if the number of readings is not the plan's, or the parts are inconsistent.

    Parameters
    ----------
    readings : array
        In a layout of `readings_of`.
    plan : PatternPlan
        The exposed patterns.
    untrusted : iterable of int
        Indices of readings to mark as saturated.
    about : mapping
        Detector properties by the names of `ABOUT`; unstated ones are marked as unknown.
    spots : Spots, optional
        Time-of-flight readings of as many frames, as from `spots_from_taps`.
    optics : Optics, optional
        The projector's angles of view.
    """
    counts = readings_of(readings, plan.exposures)
    saturated = np.zeros(counts.shape, dtype=bool)
    for index in untrusted:
        if not 0 <= index < plan.exposures:
            raise InputError(f"untrusted reading {index} is outside 0..{plan.exposures - 1}")
        saturated[:, index] = True
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=counts.astype(np.int64 if counts.dtype.kind in "iu" else np.float64),
            saturated=saturated,
            **checked_about(about),
        ),
        spots=spots,
        optics=optics,
        provenance=Provenance(
            source="hardware",
            software="reconstruction import",
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            instrument="",
        ),
    )
