"""Arrays of bucket readings, with a named pattern plan or the patterns themselves -> capture."""

from collections.abc import Iterable, Mapping
from datetime import UTC, datetime
from types import MappingProxyType
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Floats
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
"""Pixels of all patterns together that are neither Hadamard's nor few."""


def plan_from_matrix(
    patterns: ArrayLike, shape: tuple[int, int]
) -> tuple[PatternPlan, NDArray[np.int8]]:
    """Plan from a matrix (M, N) of displayed patterns, pixels row-major, and each reading's sign.

    Values are 0..1 for displayed light, or -1..1 for signed values. Where every row is a Hadamard
    row the plan is one of these; then a signed row -h gives the sign -1, with which its reading
    must be multiplied. Any others are a dense basis, and all signs +1. Raises InputError for
    another shape, and naming the first value that is something else.
    """
    matrix = np.asarray(patterns, dtype=np.float64)
    height, width = shape = checked_shape(shape)
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
    given = _hadamard_rows(2 * matrix - 1 if displayed else matrix, shape)
    if given is None:
        transmittance = matrix if displayed else (1 + matrix) / 2
        basis: Basis = Dense(transmittance.reshape(-1, height, width))
        index, sign = np.arange(len(matrix), dtype=np.int32), np.ones(len(matrix), np.int8)
    else:
        basis = Hadamard(shape)
        index, sign = given
    polarity = sign if displayed else np.zeros_like(sign)
    plan = PatternPlan(shape, index, polarity, patterns=basis)
    return plan, np.ones_like(sign) if displayed else sign


def _hadamard_rows(
    signed: Floats, shape: tuple[int, int]
) -> tuple[NDArray[np.int32], NDArray[np.int8]] | None:
    """Number and sign of each row h or -h, None where one of them is something else."""
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
    """Plan of Hadamard patterns by their row numbers, from 0.

    The numbers count in a named ``order``: number k is the k-th pattern of it. ``polarity`` is the
    name of a sequence in which both polarities of the ``rows`` (K,) were shown, or one of +1, -1
    and 0 for each, as in `PatternPlan`. Raises InputError for numbers that are not whole or
    outside, and for other polarities.
    """
    numbers = np.asarray(rows).ravel()
    if numbers.dtype.kind not in "iuf" or (numbers != np.floor(numbers)).any():
        raise InputError("the row numbers must be whole numbers")
    signs = polarity if isinstance(polarity, str) else np.asarray(polarity).ravel().tolist()
    return plan_of_rows(Hadamard(shape), numbers.astype(np.int64), signs, order)


def plan_from_factors(
    vertical: ArrayLike, horizontal: ArrayLike
) -> tuple[PatternPlan, NDArray[np.int8]]:
    """Plan of all products of A patterns (A, H) down the image with B patterns (B, W) along it.

    Reading a B + b is that of the product of a and b: readings are (A, B) in C order. Returns each
    reading's sign too, as `plan_from_matrix`. Raises InputError as that, and for more patterns than
    can be held.
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
    """Readings (frames, M) of a table (M, frames); InputError where a column counts the lines."""
    counting = (np.diff(table, axis=0) == 1).all(axis=0) & (len(table) > 1)
    if counting.any():
        raise InputError(
            f"column {counting.argmax()} of the readings counts their lines: name the column of "
            "the readings"
        )
    return table.T


def readings_of(counts: ArrayLike, exposures: int) -> NDArray[Any]:
    """Readings (frames, M) from an array of any layout: (M,), (frames, M), (M, frames), or M
    numbers of one frame in C order.

    An array that may be both is taken as (frames, M). Raises InputError where none of it has M.
    """
    array = np.asarray(counts)
    if array.dtype.kind == "b":
        raise InputError("the readings are true/false values, not numbers")
    if array.size == exposures:
        return array.reshape(1, -1)
    if array.ndim == 2 and array.shape[1] == exposures:
        return array
    if array.ndim == 2 and array.shape[0] == exposures:
        return frames_of_columns(array)
    raise InputError(
        f"the readings have shape {array.shape}; the pattern plan expects {exposures} per frame"
    )


def capture_from_readings(
    readings: ArrayLike,
    plan: PatternPlan,
    untrusted: Iterable[int] = (),
    about: Mapping[str, float] = MappingProxyType({}),
    *,
    spots: Spots | None = None,
    optics: Optics | None = None,
) -> Capture:
    """Capture (source hardware) from readings in a layout of `readings_of`.

    ``untrusted`` are positions of readings that must not be used, marked as saturated. ``about``
    tells by name what is known of the detector (`ABOUT`): what a count stands for, noise and times
    are else marked as unknown. ``spots`` are time-of-flight readings of as many frames, as of
    `spots_from_taps`, ``optics`` the projector's angles of view. Raises InputError if the number of
    readings is not the plan's, or parts do not fit together.
    """
    counts = readings_of(readings, plan.exposures)
    saturated = np.zeros(counts.shape, dtype=bool)
    for position in untrusted:
        if not 0 <= position < plan.exposures:
            raise InputError(f"untrusted reading {position} is outside 0..{plan.exposures - 1}")
        saturated[:, position] = True
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
