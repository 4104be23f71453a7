"""Hadamard pattern plans: which pattern each exposure shows, and what its readings mean.

Row k of the natural-order (Sylvester) Hadamard matrix of size N = H*W, reshaped to (H, W), is the
outer product of row k // W of the size-H matrix and row k % W of the size-W matrix.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy import sparse

from .errors import InputError, nearest

#: Beyond the most pixels a shape is a mistake, and its arrays fill any memory.
MOST_PIXELS = 2**24
ORDERS = ("natural", "sequency", "sequency-2d")
POLARITIES = ("differential", "single-ended", "signed")

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class PatternPlan:
    """The sequence of displayed Hadamard patterns.

    ``shape`` (H, W) of the patterns in virtual pixels, both powers of two. ``index`` (M,): row of
    the natural-order Hadamard matrix per exposure. ``polarity`` (M,): +1 lights the pixels where
    h = +1, pattern (1 + h)/2; -1 its complement (1 - h)/2; 0 stands for the signed pattern h
    itself, a difference that the recorder has formed. ``order`` names how ``index`` was ordered,
    for people. Raises InputError if the parts do not fit together.
    """

    shape: tuple[int, int]
    index: NDArray[np.int32]
    polarity: NDArray[np.int8]
    order: str = "custom"

    def __post_init__(self) -> None:
        shape = checked_shape(self.shape)
        index = np.asarray(self.index)
        polarity = np.asarray(self.polarity)
        pixels = shape[0] * shape[1]
        if index.ndim != 1 or index.size == 0 or (index != np.floor(index)).any():
            raise InputError("pattern index must be a non-empty 1-D array of integers")
        if index.min() < 0 or index.max() >= pixels:
            raise InputError(
                f"pattern index {index.max() if index.min() >= 0 else index.min()} is outside "
                f"0..{pixels - 1} for {shape[0]} x {shape[1]} patterns"
            )
        if polarity.shape != index.shape or not np.isin(polarity, (-1, 0, 1)).all():
            raise InputError(
                f"pattern polarity must be -1, 0 or +1 for each of the {index.size} exposures"
            )
        object.__setattr__(self, "shape", shape)
        object.__setattr__(self, "index", index.astype(np.int32))
        object.__setattr__(self, "polarity", polarity.astype(np.int8))

    @property
    def basis(self) -> str:
        """Name of the pattern basis."""
        return "hadamard"

    @property
    def pixels(self) -> int:
        """Number of virtual pixels, N = H*W."""
        return self.shape[0] * self.shape[1]

    @property
    def exposures(self) -> int:
        """Number of displayed patterns, M."""
        return self.index.size

    @cached_property
    def distinct(self) -> NDArray[np.int32]:
        """The K distinct indices, in the order of their first exposure."""
        values, first = np.unique(self.index, return_index=True)
        return values[np.argsort(first)]

    @property
    def sampled(self) -> int:
        """Number of distinct Hadamard rows, K."""
        return self.distinct.size

    @property
    def sampling_ratio(self) -> float:
        """Patterns kept over pixels, K / N."""
        return self.sampled / self.pixels

    @cached_property
    def decoder(self) -> sparse.csr_array:
        """The (K, M) matrix that turns M readings into K Walsh-Hadamard coefficients.

        A row averages the readings of one index: y where the recorder formed the difference,
        y+ - y- where both polarities were shown, and otherwise 2 (y - dark) - (all - dark) (or its
        complement), with index 0 at both polarities as the all-on and the dark reading. Raises
        InputError where an index has one polarity only and these two readings are missing.
        """
        rows = {int(k): row for row, k in enumerate(self.distinct)}
        shown = {
            (k, p): np.flatnonzero((self.index == k) & (self.polarity == p))
            for k, p in set(zip(self.index.tolist(), self.polarity.tolist(), strict=True))
        }
        entries: list[tuple[int, NDArray[np.intp], float]] = []
        for k, row in rows.items():
            signed, plus, minus = ((k, p) in shown for p in (0, 1, -1))
            if signed:
                entries.append((row, shown[k, 0], 1.0))
            elif plus and minus:
                entries += [(row, shown[k, 1], 1.0), (row, shown[k, -1], -1.0)]
            elif (0, 1) in shown and (0, -1) in shown:
                sign = 1.0 if plus else -1.0
                entries += [
                    (row, shown[k, 1 if plus else -1], 2 * sign),
                    (row, shown[0, 1], -sign),
                    (row, shown[0, -1], -sign),
                ]
            else:
                raise InputError(
                    f"the background cannot be removed from pattern index {k}: it is shown with "
                    "one polarity only, and the plan lacks the all-on and the dark exposure "
                    "(index 0 with polarity +1 and -1)"
                )
        row_of = np.concatenate([np.full(at.size, row) for row, at, _ in entries])
        column_of = np.concatenate([at for _, at, _ in entries])
        value = np.concatenate([np.full(at.size, weight / at.size) for _, at, weight in entries])
        return sparse.csr_array((value, (row_of, column_of)), shape=(len(rows), self.exposures))


def make_plan(
    shape: tuple[int, int],
    patterns: int | None = None,
    order: str = "sequency-2d",
    polarity: str = "differential",
) -> PatternPlan:
    """Plan that shows the first ``patterns`` Hadamard rows (all N if None) in a named order.

    ``order``: natural, sequency (sign changes of the row of length N) or sequency-2d (smallest
    sum of vertical and horizontal spatial frequency first); each begins with row 0, all on.
    ``polarity``: differential shows each index twice, +1 then -1 (M = 2K); single-ended shows +1
    only, and the projector's dark (M = K + 1); signed is one signed value per index (M = K).
    Raises InputError.
    """
    shape = checked_shape(shape)
    pixels = shape[0] * shape[1]
    kept = pixels if patterns is None else patterns
    if not 1 <= kept <= pixels:
        raise InputError(
            f"patterns = {kept}: must lie in 1..{pixels} for {shape[0]} x {shape[1]} pixels"
        )
    rows = ordered_rows(shape, order)[:kept]
    if polarity == "differential":
        index, sign = np.repeat(rows, 2), np.tile([1, -1], kept)
    elif polarity == "single-ended":
        index, sign = np.append(rows, 0), np.append(np.ones(kept), -1)
    elif polarity == "signed":
        index, sign = rows, np.zeros(kept)
    else:
        raise InputError(f"unknown polarity {polarity!r}: {nearest(polarity, POLARITIES)}")
    return PatternPlan(shape, index.astype(np.int32), sign.astype(np.int8), order)


def ordered_rows(shape: tuple[int, int], order: str) -> NDArray[np.int64]:
    """All N natural-order row numbers in a named order, (N,)."""
    height, width = shape
    if order == "natural":
        return np.arange(height * width)
    if order == "sequency":
        return np.argsort(sequency(height * width))
    if order == "sequency-2d":
        # A row with s sign changes over n pixels oscillates with s / 2n cycles per pixel.
        vertical, horizontal = sequency(height) / height, sequency(width) / width
        return np.argsort(np.add.outer(vertical, horizontal).ravel(), kind="stable")
    raise InputError(f"unknown pattern order {order!r}: {nearest(order, ORDERS)}")


def sequency(size: int) -> NDArray[np.int64]:
    """Sign changes along each row of the natural-order Hadamard matrix of this size, (size,)."""
    changes = np.zeros(size, dtype=np.int64)
    bits = size.bit_length() - 1
    rows = np.arange(size)
    binary = np.zeros(size, dtype=np.int64)
    for bit in range(bits):  # the row number, bit-reversed, is the Gray code of the sequency
        binary ^= (rows >> bit) & 1
        changes |= binary << (bits - 1 - bit)
    return changes


def fwht(x: ArrayLike, axis: int = -1) -> NDArray[Any]:
    """Unnormalised fast Walsh-Hadamard transform in natural order along one axis, real or complex.

    The length of the axis must be a power of two (ValueError otherwise).
    """
    values = np.moveaxis(np.asarray(x), axis, -1)
    values = values.astype(np.result_type(values, np.float64))
    size = values.shape[-1]
    if not _power_of_two(size):
        raise ValueError(f"length {size} is not a power of two")
    half = 1
    while half < size:
        pairs = values.reshape(*values.shape[:-1], -1, 2, half)
        first, second = pairs[..., 0, :], pairs[..., 1, :]
        values = np.stack([first + second, first - second], axis=-2).reshape(values.shape)
        half *= 2
    return np.moveaxis(values, -1, axis)


def expose(plan: PatternPlan, image: ArrayLike) -> Floats:
    """Light that each displayed pattern collects, sum_u P_k(u) image(u): (..., H, W) -> (..., M).

    The image holds what each virtual pixel contributes when fully on.
    """
    pixels = np.asarray(image, dtype=np.float64)
    if pixels.shape[-2:] != plan.shape:
        raise ValueError(f"image {pixels.shape} does not end in the plan's shape {plan.shape}")
    coefficients = fwht(pixels.reshape(*pixels.shape[:-2], plan.pixels))
    total = coefficients[..., :1]
    signed = coefficients[..., plan.index]
    return np.where(plan.polarity == 0, signed, (total + plan.polarity * signed) / 2)


def illumination(plan: PatternPlan, k: int) -> NDArray[np.float32]:
    """The k-th displayed pattern, (H, W): 0..1, or -1..1 where the polarity is 0."""
    unit = np.zeros(plan.pixels)
    unit[plan.index[k]] = 1
    row = fwht(unit).reshape(plan.shape)
    polarity = int(plan.polarity[k])
    return (row if polarity == 0 else (1 + polarity * row) / 2).astype(np.float32)


def mean_illumination(plan: PatternPlan) -> NDArray[np.float64]:
    """Mean of all displayed patterns, (H, W)."""
    weight = np.where(plan.polarity == 0, 1.0, plan.polarity / 2)
    rows = np.bincount(plan.index, weight, minlength=plan.pixels)
    steady = np.count_nonzero(plan.polarity) / 2
    return ((fwht(rows) + steady) / plan.exposures).reshape(plan.shape)


def signed_coefficients(
    plan: PatternPlan, readings: ArrayLike
) -> tuple[NDArray[np.int32], NDArray[Any]]:
    """Walsh-Hadamard coefficients sum_u h_k(u) image(u) of bucket readings (..., M).

    Returns the distinct indices (K,) and the coefficients (..., K), in the readings' unit, free
    of background (see ``PatternPlan.decoder``). Raises InputError where the plan cannot remove it.
    """
    values = np.asarray(readings, dtype=np.float64)
    flat = values.reshape(-1, plan.exposures)
    coefficients = (plan.decoder @ flat.T).T
    return plan.distinct, coefficients.reshape(*values.shape[:-1], plan.sampled)


def checked_shape(shape: tuple[int, int]) -> tuple[int, int]:
    """Rows and columns of a pattern; InputError where there can be no such patterns."""
    height, width = (int(side) for side in shape)
    if not (_power_of_two(height) and _power_of_two(width)):
        raise InputError(f"pattern shape {height} x {width}: both sides must be powers of two")
    if height * width > MOST_PIXELS:
        raise InputError(f"pattern shape {height} x {width}: at most {MOST_PIXELS} pixels")
    return height, width


def _power_of_two(size: int) -> bool:
    return size > 0 and size & (size - 1) == 0
