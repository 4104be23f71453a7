"""Arrays of bucket readings, with a named pattern plan or the patterns themselves -> capture."""

from collections.abc import Iterable
from datetime import UTC, datetime

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...arrays import Floats
from ...errors import InputError
from ...operators import Basis, PatternPlan, checked_shape, fwht
from ...operators.bases.dense import Dense
from ...operators.bases.hadamard import Hadamard
from ...operators.hadamard import power_of_two
from ..buckets import Buckets
from ..model import Capture, Provenance


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
    known = _hadamard_rows(2 * matrix - 1 if displayed else matrix, shape)
    if known is None:
        transmittance = matrix if displayed else (1 + matrix) / 2
        basis: Basis = Dense(transmittance.reshape(-1, height, width))
        index, sign = np.arange(len(matrix), dtype=np.int32), np.ones(len(matrix), np.int8)
    else:
        basis = Hadamard(shape)
        index, sign = known
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


def capture_from_readings(
    readings: ArrayLike, plan: PatternPlan, untrusted: Iterable[int] = ()
) -> Capture:
    """Capture (source hardware, no time of flight) from readings (M,) or (frames, M).

    ``untrusted`` are positions of readings that must not be used, marked as saturated. What a count
    stands for, noise and times are marked as unknown. Raises InputError if the number of readings
    is not the plan's.
    """
    counts = np.asarray(readings)
    if counts.dtype.kind == "b":
        raise InputError("the readings are true/false values, not numbers")
    if counts.size == plan.exposures:
        counts = counts.reshape(1, -1)
    if counts.ndim != 2 or counts.shape[1] != plan.exposures:
        raise InputError(
            f"the readings have shape {counts.shape}; the pattern plan expects {plan.exposures} "
            "per frame"
        )
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
            exposure_time_s=np.nan,
            pattern_period_s=np.nan,
            electrons_per_count=np.nan,
            offset_counts=0.0,
            noise_electrons=np.nan,
            excess_noise_factor=1.0,
            dead_time_s=0.0,
        ),
        spots=None,
        optics=None,
        provenance=Provenance(
            source="hardware",
            software="reconstruction import",
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            instrument="",
        ),
    )
