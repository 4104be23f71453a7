"""Pattern plans: the pattern that each exposure displays."""

from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats, usual_float_errors
from ..base.errors import InputError, nearest
from .bases import basis_of
from .bases.dense import Dense
from .bases.hadamard import Hadamard
from .basis import Basis
from .factors import checked_factors
from .orders import pattern_order
from .polarities import POLARITIES, Exposures


@dataclass(frozen=True, eq=False)
class PatternPlan:
    """Sequence of displayed patterns.

    Parameters
    ----------
    shape
        Rows H and columns W of the patterns, in virtual pixels.
    index
        Row of the basis (M,) that each exposure displays.
    polarity
        Polarity (M,): +1 displays (1 + h) / 2 of a row h, -1 its complement (1 - h) / 2; 0 stands
        for h itself, a difference formed by the recorder.
    order
        Name of the order of ``index``, for information only.
    patterns
        Basis of the rows; natural-order Hadamard by default.
    throughput
        Factor (rows,) on the light of each row of the basis and of its complement, relative to the
        mean, nan where unknown; 1 for all by default.

    Raises
    ------
    InputError
        If the parts do not fit together.
    """

    shape: tuple[int, int]
    index: NDArray[np.int32]
    polarity: NDArray[np.int8]
    order: str = "custom"
    patterns: Basis = field(default=None)  # type: ignore[assignment]
    throughput: Floats | None = None

    def __post_init__(self) -> None:
        patterns = Hadamard(self.shape) if self.patterns is None else self.patterns
        height, width = shape = patterns.shape
        index = np.asarray(self.index)
        polarity = np.asarray(self.polarity)
        if shape != tuple(self.shape):
            raise InputError(f"patterns of {shape} in a plan of shape {tuple(self.shape)}")
        if index.ndim != 1 or index.size == 0 or (index != np.floor(index)).any():
            raise InputError("pattern index must be a non-empty 1-D array of integers")
        if index.min() < 0 or index.max() >= patterns.rows:
            raise InputError(
                f"pattern index {index.max() if index.min() >= 0 else index.min()} is outside "
                f"0..{patterns.rows - 1} for {height} x {width} patterns"
            )
        if polarity.shape != index.shape or not np.isin(polarity, (-1, 0, 1)).all():
            raise InputError(
                f"pattern polarity must be -1, 0 or +1 for each of the {index.size} exposures"
            )
        if self.throughput is not None:
            checked = checked_factors(self.throughput, patterns.rows, "pattern throughput")
            object.__setattr__(self, "throughput", checked)
        object.__setattr__(self, "patterns", patterns)
        object.__setattr__(self, "shape", shape)
        object.__setattr__(self, "index", index.astype(np.int32))
        object.__setattr__(self, "polarity", polarity.astype(np.int8))

    @property
    def basis(self) -> str:
        """Name of the pattern basis."""
        return self.patterns.name

    @property
    def pixels(self) -> int:
        """Number of virtual pixels, N = H*W."""
        return self.shape[0] * self.shape[1]

    @property
    def shows_image(self) -> bool:
        """Whether there is an image to reconstruct, that is more than one pixel."""
        return self.pixels > 1

    @property
    def exposures(self) -> int:
        """Number of displayed patterns, M."""
        return self.index.size

    @cached_property
    def factors(self) -> Floats:
        """Throughput of each exposure (M,), 1 where it is unknown."""
        return self.factors_of(self.index)

    def factors_of(self, rows: NDArray[np.int32]) -> Floats:
        """Throughput of some rows of the basis, 1 where it is unknown."""
        if self.throughput is None:
            return np.ones(rows.size)
        return np.nan_to_num(self.throughput[rows], nan=1.0)

    @cached_property
    def distinct(self) -> NDArray[np.int32]:
        """The K distinct indices, in the order of their first exposure."""
        values, first = np.unique(self.index, return_index=True)
        return values[np.argsort(first)]

    @property
    def sampled(self) -> int:
        """Number of distinct rows, K."""
        return self.distinct.size

    @property
    def sampling_ratio(self) -> float:
        """Distinct rows over pixels, K / N."""
        return self.sampled / self.pixels

    def only(self, exposures: NDArray[np.bool_]) -> "PatternPlan":
        """Plan of the exposures selected by a mask (M,)."""
        return replace(self, index=self.index[exposures], polarity=self.polarity[exposures])


NO_PATTERN = PatternPlan((1, 1), np.zeros(1, np.int32), np.zeros(1, np.int8))
"""Plan of recordings without an image: one exposure of a dark pixel."""


@usual_float_errors
def make_plan(
    shape: tuple[int, int],
    patterns: int | None = None,
    order: str | None = None,
    polarity: str = "differential",
    basis: str | Basis = "hadamard",
) -> PatternPlan:
    """Plan that displays the first rows of a basis in a named order.

    Parameters
    ----------
    shape
        Rows H and columns W of the patterns, in virtual pixels.
    patterns
        Number K of rows, all by default.
    order
        Name in `ORDERS`, with a seed if it is random: ``"random:7"``. By default the usual order of
        the basis, sequency-2d for Hadamard.
    polarity
        Name in `POLARITIES`. differential displays each row with +1, then -1 (M = 2K); single-ended
        with +1 only, plus a dark exposure if the basis has a DC row (M = K + 1); signed stands for
        one signed value per row (M = K).
    basis
        A basis, or the name of one, with a seed if it is random.

    Raises
    ------
    InputError
        If a name is unknown or a number out of range.
    """
    rows_of = basis_of(basis, shape) if isinstance(basis, str) else basis
    rows = rows_of.rows
    count = rows if patterns is None else patterns
    if not 1 <= count <= rows:
        height, width = rows_of.shape
        raise InputError(f"patterns = {count}: must lie in 1..{rows} for {height} x {width} pixels")
    order = order or rows_of.usual_order
    index, sign = _exposures(rows_of, ordered_rows(rows_of, order)[:count], polarity)
    return PatternPlan(shape, index, sign, order, rows_of)


def plan_of_rows(
    basis: Basis,
    index: ArrayLike,
    polarity: str | Sequence[int] = "differential",
    layout: str = "natural",
) -> PatternPlan:
    """Plan of individually listed rows.

    Parameters
    ----------
    basis
        Basis of the rows.
    index
        Row numbers (K,), counted in ``layout``.
    polarity
        As for `make_plan`, or +1, -1 or 0 for each entry of ``index``, which then lists the
        exposures.
    layout
        Name of the order that ``index`` counts in: in "sequency", 3 is the fourth row of that
        order.

    Raises
    ------
    InputError
        If a name is unknown or an index out of range.
    """
    numbers = np.asarray(index)
    rows = ordered_rows(basis, layout)
    if numbers.ndim != 1 or not numbers.size or numbers.dtype.kind not in "iu":
        raise InputError("index must be a non-empty list of whole numbers")
    outside = numbers[(numbers < 0) | (numbers >= basis.rows)]
    if outside.size:
        raise InputError(
            f"index {outside[0]} is outside 0..{basis.rows - 1}, the rows of this basis and shape"
        )
    if isinstance(polarity, str):
        return PatternPlan(basis.shape, *_exposures(basis, rows[numbers], polarity), patterns=basis)
    return PatternPlan(basis.shape, rows[numbers], np.asarray(polarity), patterns=basis)


def _exposures(basis: Basis, rows: NDArray[np.int64], polarity: str) -> Exposures:
    """Exposures of rows (K,) with a named polarity."""
    if polarity not in POLARITIES:
        raise InputError(f"unknown polarity {polarity!r}: {nearest(polarity, POLARITIES)}")
    return POLARITIES[polarity](rows, basis.dc_row)


def ordered_rows(basis: Basis, order: str | None = None) -> NDArray[np.int64]:
    """All row indices of a basis in a named order, by default its usual one.

    Raises
    ------
    InputError
        If the order is unknown, or does not list each row of this basis once.
    """
    order = order or basis.usual_order
    rows = np.asarray(pattern_order(order)(basis))
    if not np.array_equal(np.sort(rows.ravel()), np.arange(basis.rows)):
        raise InputError(
            f"pattern order {order!r} returned {rows.size} numbers; must return each of "
            f"0..{basis.rows - 1} once"
        )
    return rows


def expose(plan: PatternPlan, image: ArrayLike) -> Floats:
    """Light collected under each displayed pattern P_k, t_k sum_u P_k(u) image(u).

    t_k is the pattern's throughput.

    Parameters
    ----------
    plan
        Plan of M exposures.
    image
        Light (..., H, W) that each virtual pixel contributes when it is fully on.

    Returns
    -------
    ndarray
        Light (..., M), in the unit of ``image``.
    """
    pixels = np.asarray(image, dtype=np.float64)
    if pixels.shape[-2:] != plan.shape:
        raise ValueError(f"image {pixels.shape} does not end in the plan's shape {plan.shape}")
    flat = pixels.reshape(*pixels.shape[:-2], plan.pixels)
    dc_row = plan.patterns.dc_row
    if dc_row is None:
        signed = plan.patterns.project(flat, plan.index)
        total = flat.sum(axis=-1, keepdims=True)
    else:  # summed like the rows, so that a dark exposure is exactly 0
        sums = plan.patterns.project(flat, np.append(plan.index, np.int32(dc_row)))
        signed, total = sums[..., :-1], sums[..., -1:]
    light = np.where(plan.polarity == 0, signed, (total + plan.polarity * signed) / 2)
    return light if plan.throughput is None else light * plan.factors


def illumination(plan: PatternPlan, k: int) -> NDArray[np.float32]:
    """Displayed pattern of exposure k, (H, W): 0..1, or -1..1 if its polarity is 0."""
    row = plan.patterns.row(int(plan.index[k]))
    polarity = int(plan.polarity[k])
    return (row if polarity == 0 else (1 + polarity * row) / 2).astype(np.float32)


def mean_illumination(plan: PatternPlan) -> Floats:
    """Mean of all displayed patterns, (H, W), weighted by their throughput."""
    weight = plan.factors * np.where(plan.polarity == 0, 1.0, plan.polarity / 2)
    index, inverse = np.unique(plan.index, return_inverse=True)
    rows = plan.patterns.combine(np.bincount(inverse, weight), index)
    steady = plan.factors[plan.polarity != 0].sum() / 2
    return np.asarray((rows + steady) / plan.exposures).reshape(plan.shape)


def transposed(plan: PatternPlan) -> PatternPlan:
    """Exchange rows and columns of all patterns of a plan.

    A plan of W x H pixels numbered row by row becomes one of H x W pixels numbered column by
    column, as MATLAB does.

    Raises
    ------
    InputError
        If the basis is neither Hadamard nor dense.
    """
    height, width = plan.shape
    if isinstance(plan.patterns, Hadamard):
        down, along = np.divmod(plan.index, width)
        index = along * height + down
        factors = plan.throughput
        if factors is not None:
            factors = factors.reshape(plan.shape).T.ravel()
        return PatternPlan((width, height), index, plan.polarity, plan.order, throughput=factors)
    if isinstance(plan.patterns, Dense):
        basis = Dense(plan.patterns.patterns.transpose(0, 2, 1))
        return replace(plan, shape=basis.shape, patterns=basis)
    raise InputError(f"patterns of the basis {plan.basis!r} cannot be transposed")


def interleaved(whole: PatternPlan, frames: int, common: int) -> tuple[PatternPlan, ...]:
    """Distribute the patterns of a plan over successive frames.

    Each frame displays the common patterns and every C-th of the others, frame t starting with the
    t-th, so that it covers all frequencies. The common patterns reveal motion and keep a single
    frame useful; the others add up as long as the scene holds still.

    Parameters
    ----------
    whole
        Plan to distribute.
    frames
        Number C of frames.
    common
        Number of leading rows, the DC row first, that every frame displays.

    Raises
    ------
    InputError
        If the remaining rows cannot be distributed evenly.
    """
    dc_row = whole.patterns.dc_row
    rows = whole.distinct[np.argsort(whole.distinct != dc_row, kind="stable")]
    if not 0 <= common <= rows.size or (rows.size - common) % frames:
        raise InputError(
            f"{rows.size} patterns, {common} of them common, cannot be distributed evenly over "
            f"{frames} frames"
        )
    return tuple(
        whole.only(np.isin(whole.index, np.append(rows[:common], rows[common + t :: frames])))
        for t in range(frames)
    )
