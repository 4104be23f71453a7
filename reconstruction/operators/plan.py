"""Pattern plans: which pattern each exposure shows."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from functools import cached_property

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.arrays import Floats
from ..base.errors import InputError, nearest
from .bases import basis_of
from .bases.hadamard import Hadamard
from .basis import Basis
from .orders import pattern_order
from .polarities import POLARITIES, Exposures


@dataclass(frozen=True, eq=False)
class PatternPlan:
    """The sequence of displayed patterns.

    ``shape`` (H, W) of the patterns in virtual pixels. ``index`` (M,): row of the basis per
    exposure. ``polarity`` (M,): +1 shows (1 + h)/2 of a row h; -1 its complement (1 - h)/2; 0
    stands for the signed pattern h itself, a difference that the recorder has formed. ``order``
    names how ``index`` was ordered, for people. ``patterns``: the basis, of natural-order Hadamard
    rows where None. Raises InputError if the parts do not fit together.
    """

    shape: tuple[int, int]
    index: NDArray[np.int32]
    polarity: NDArray[np.int8]
    order: str = "custom"
    patterns: Basis = field(default=None)  # type: ignore[assignment]

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
        """Whether there is an image to find: a single pixel is none."""
        return self.pixels > 1

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
        """Number of distinct rows, K."""
        return self.distinct.size

    @property
    def sampling_ratio(self) -> float:
        """Patterns kept over pixels, K / N."""
        return self.sampled / self.pixels

    def only(self, exposures: NDArray[np.bool_]) -> "PatternPlan":
        """The plan of some of the exposures (M,)."""
        return PatternPlan(
            self.shape, self.index[exposures], self.polarity[exposures], self.order, self.patterns
        )


NO_PATTERN = PatternPlan((1, 1), np.zeros(1, np.int32), np.zeros(1, np.int8))
"""Of recordings without an image: one exposure of a dark pixel."""


def make_plan(
    shape: tuple[int, int],
    patterns: int | None = None,
    order: str | None = None,
    polarity: str = "differential",
    basis: str | Basis = "hadamard",
) -> PatternPlan:
    """Plan that shows the first ``patterns`` rows of a basis (all if None) in a named order.

    ``order``: a name in `ORDERS`, with a seed where it is drawn by chance, as "random:7"; the usual
    one of the basis if None, sequency-2d of Hadamard's. ``polarity``: differential shows each index
    twice, +1 then -1 (M = 2K); single-ended shows +1 only, and where the basis has an all-on row
    the projector's dark (M = K + 1); signed is one signed value per index (M = K). ``basis``: the
    name of one that a shape tells, with a seed where it is drawn, or one itself. Raises InputError.
    """
    rows_of = basis_of(basis, shape) if isinstance(basis, str) else basis
    rows = rows_of.rows
    retained = rows if patterns is None else patterns
    if not 1 <= retained <= rows:
        height, width = rows_of.shape
        raise InputError(
            f"patterns = {retained}: must lie in 1..{rows} for {height} x {width} pixels"
        )
    order = order or rows_of.usual_order
    index, sign = _exposures(rows_of, ordered_rows(rows_of, order)[:retained], polarity)
    return PatternPlan(shape, index, sign, order, rows_of)


def plan_of_rows(
    basis: Basis,
    index: ArrayLike,
    polarity: str | Sequence[int] = "differential",
    layout: str = "natural",
) -> PatternPlan:
    """Plan of rows that are told one by one, as the ``index`` numbers them in a ``layout``.

    A layout is an order: in "sequency", 3 is the row that this order shows fourth. ``polarity``:
    as for `make_plan`, or +1, -1 or 0 for each, which are then the exposures. Raises InputError.
    """
    numbers = np.asarray(index)
    rows = ordered_rows(basis, layout)
    if numbers.ndim != 1 or not numbers.size or numbers.dtype.kind not in "iu":
        raise InputError("index must be a list of whole numbers")
    outside = numbers[(numbers < 0) | (numbers >= basis.rows)]
    if outside.size:
        raise InputError(
            f"index {outside[0]} is outside 0..{basis.rows - 1}, the rows of this basis and shape"
        )
    if isinstance(polarity, str):
        return PatternPlan(basis.shape, *_exposures(basis, rows[numbers], polarity), patterns=basis)
    return PatternPlan(basis.shape, rows[numbers], np.asarray(polarity), patterns=basis)


def _exposures(basis: Basis, rows: NDArray[np.int64], polarity: str) -> Exposures:
    """Rows (K,) shown one after the other by a named polarity."""
    if polarity not in POLARITIES:
        raise InputError(f"unknown polarity {polarity!r}: {nearest(polarity, POLARITIES)}")
    return POLARITIES[polarity](rows, basis.level)


def ordered_rows(basis: Basis, order: str | None = None) -> NDArray[np.int64]:
    """All row numbers of a basis in a named order, its usual one if None.

    InputError for an unknown order, and for one that is none of all its rows.
    """
    order = order or basis.usual_order
    rows = np.asarray(pattern_order(order)(basis))
    if not np.array_equal(np.sort(rows.ravel()), np.arange(basis.rows)):
        raise InputError(
            f"pattern order {order!r} gave {rows.size} numbers; each of 0..{basis.rows - 1} is "
            "needed once"
        )
    return rows


def expose(plan: PatternPlan, image: ArrayLike) -> Floats:
    """Light that each displayed pattern collects, sum_u P_k(u) image(u): (..., H, W) -> (..., M).

    The image holds what each virtual pixel contributes when fully on.
    """
    pixels = np.asarray(image, dtype=np.float64)
    if pixels.shape[-2:] != plan.shape:
        raise ValueError(f"image {pixels.shape} does not end in the plan's shape {plan.shape}")
    flat = pixels.reshape(*pixels.shape[:-2], plan.pixels)
    level = plan.patterns.level
    if level is None:
        signed = plan.patterns.project(flat, plan.index)
        total = flat.sum(axis=-1, keepdims=True)
    else:  # summed as the rows are, so that a dark exposure is exactly 0
        sums = plan.patterns.project(flat, np.append(plan.index, np.int32(level)))
        signed, total = sums[..., :-1], sums[..., -1:]
    return np.where(plan.polarity == 0, signed, (total + plan.polarity * signed) / 2)


def illumination(plan: PatternPlan, k: int) -> NDArray[np.float32]:
    """The k-th displayed pattern, (H, W): 0..1, or -1..1 where the polarity is 0."""
    row = plan.patterns.row(int(plan.index[k]))
    polarity = int(plan.polarity[k])
    return (row if polarity == 0 else (1 + polarity * row) / 2).astype(np.float32)


def mean_illumination(plan: PatternPlan) -> Floats:
    """Mean of all displayed patterns, (H, W)."""
    weight = np.where(plan.polarity == 0, 1.0, plan.polarity / 2)
    displayed, position = np.unique(plan.index, return_inverse=True)
    rows = plan.patterns.combine(np.bincount(position, weight), displayed)
    steady = np.count_nonzero(plan.polarity) / 2
    return np.asarray((rows + steady) / plan.exposures).reshape(plan.shape)
