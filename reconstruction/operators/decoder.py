"""From readings of displayed patterns to coefficients of an image, free of background.

A row of the decoder averages the readings of one pattern: y where the recorder formed the
difference, y+ - y- where both polarities were shown, and otherwise 2 (y - dark) - (all - dark) (or
its complement), with the all-on row at both polarities as the all-on and the dark reading. Patterns
without these two are compared with their mean (F. Ferri et al., Phys. Rev. Lett. 104, 253603
(2010)); of an orthogonal basis that is refused, for one more reading would do better.
"""

from dataclasses import dataclass
from functools import cached_property
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..base.errors import InputError
from .operator import MatrixOperator, MeasurementOperator, RowOperator
from .plan import PatternPlan
from .sparse import SparseRows

RANK = 1e-6
"""Directions that patterns excite by less than this share of the strongest are not measured."""
DC_FRACTION = 0.5
"""Share of the energy of a row that must be constant for it to tell the level of an image."""


@dataclass(frozen=True, eq=False)
class Decoder:
    """``matrix`` (K, M) takes readings to the coefficients of ``operator`` (K, N).

    ``index`` (K,): rows of the plan's basis that they rest on; of a dense basis all that were
    shown. ``shared`` (M,): readings that enter several coefficients of an orthogonal basis.
    """

    matrix: SparseRows | Floats
    operator: MeasurementOperator
    index: NDArray[np.int32]
    shared: Mask

    @property
    def level(self) -> bool:
        """Whether the mean level of an image is told."""
        return self.operator.level is not None

    def measured(self, usable: Mask) -> Mask:
        """Which coefficients (K,) of an orthogonal basis rest on ``usable`` (M,) readings alone."""
        if isinstance(self.matrix, SparseRows):
            return self.matrix.resting_on(usable)
        return np.ones(len(self.matrix), dtype=bool)

    def decode(self, signal: NDArray[Any]) -> NDArray[Any]:
        """Coefficients (..., K) of the readings (..., M) in their unit, real or complex."""
        flat = np.asarray(signal).reshape(-1, self.matrix.shape[1])
        return np.asarray((self.matrix @ flat.T).T).reshape(*np.shape(signal)[:-1], -1)

    def own_variance(self, variance: Floats) -> Floats:
        """Variance (..., K) of the coefficients from readings of ``variance`` (..., M) not shared.

        The covariance of all is S V S^T + diag(own), with S the columns of the shared readings
        and V = diag of their variance.
        """
        own = np.where(self.shared, 0.0, variance).reshape(-1, self.shared.size)
        return np.asarray((self._squared @ own.T).T).reshape(*variance.shape[:-1], -1)

    @cached_property
    def _squared(self) -> SparseRows | Floats:
        return self.matrix**2

    def shared_columns(self) -> Floats:
        """Columns (K, S) of the readings that many coefficients share."""
        (positions,) = self.shared.nonzero()
        units = np.zeros((self.shared.size, positions.size))
        units[positions, range(positions.size)] = 1
        return np.asarray(self.matrix @ units)


def decoder_for(plan: PatternPlan, usable: Mask | None = None) -> Decoder:
    """Decoder of a plan of which only ``usable`` (M,) readings count; all if None.

    Coefficients that rest on other readings are left out, which may leave none. Raises InputError
    where the plan does not tell the background.
    """
    usable = np.ones(plan.exposures, dtype=bool) if usable is None else usable
    if not plan.patterns.orthogonal:
        return _dense_decoder(plan, usable)
    matrix = _row_decoder(plan)
    complete = matrix.resting_on(usable)
    matrix, index = matrix.only(complete), plan.distinct[complete]
    shared = np.bincount(matrix.columns, minlength=plan.exposures) > 1
    return Decoder(matrix, RowOperator(plan.patterns, index), index, shared)


def _row_decoder(plan: PatternPlan) -> SparseRows:
    """The (K, M) matrix that turns M readings into K signed coefficients."""
    rows = {int(k): row for row, k in enumerate(plan.distinct)}
    displayed = {
        (k, p): np.flatnonzero((plan.index == k) & (plan.polarity == p))
        for k, p in set(zip(plan.index.tolist(), plan.polarity.tolist(), strict=True))
    }
    entries: list[tuple[int, NDArray[np.intp], float]] = []
    level = plan.patterns.level
    for k, row in rows.items():
        signed, plus, minus = ((k, p) in displayed for p in (0, 1, -1))
        if signed:
            entries.append((row, displayed[k, 0], 1.0))
        elif plus and minus:
            entries += [(row, displayed[k, 1], 1.0), (row, displayed[k, -1], -1.0)]
        elif (level, 1) in displayed and (level, -1) in displayed:
            sign = 1.0 if plus else -1.0
            entries += [
                (row, displayed[k, 1 if plus else -1], 2 * sign),
                (row, displayed[level, 1], -sign),
                (row, displayed[level, -1], -sign),
            ]
        else:
            raise InputError(
                f"the background cannot be removed from pattern index {k}: it is shown with one "
                "polarity only, and the plan lacks the all-on and the dark exposure (index "
                f"{level} with polarity +1 and -1)"
            )
    row_of = np.concatenate([np.full(at.size, row) for row, at, _ in entries])
    column_of = np.concatenate([at for _, at, _ in entries])
    value = np.concatenate([np.full(at.size, weight / at.size) for _, at, weight in entries])
    return SparseRows(row_of, column_of, value, (len(rows), plan.exposures))


def _dense_decoder(plan: PatternPlan, usable: Mask) -> Decoder:
    """Any patterns: readings that know no background, made orthonormal."""
    difference = _without_background(plan, usable)
    matrix, rows = _orthonormal(difference, difference @ _displayed(plan))
    operator = MatrixOperator(rows, plan.shape, np.linalg.norm(matrix, axis=1))
    index = np.unique(plan.index[usable]) if len(rows) else plan.index[:0]
    return Decoder(matrix, operator, index, np.zeros(plan.exposures, dtype=bool))


def _displayed(plan: PatternPlan) -> Floats:
    """What every exposure shows, (M, N)."""
    signed = plan.patterns.matrix(plan.index)
    polarity = plan.polarity[:, None]
    return np.where(polarity == 0, signed, (1 + polarity * signed) / 2)


def _without_background(plan: PatternPlan, usable: Mask) -> Floats:
    """Combinations (K, M) of usable readings in which what all have in common cancels.

    Differences of both polarities of a pattern; the others less the mean of the all-on and the dark
    reading, or where these are not known less their own.
    """
    rows = []
    alone = []
    half: Floats | None = None
    for k in plan.distinct:
        at = {p: usable & (plan.index == k) & (plan.polarity == p) for p in (0, 1, -1)}
        plus, minus = (at[p] / max(np.count_nonzero(at[p]), 1) for p in (1, -1))
        if at[0].any():
            rows.append(at[0] / np.count_nonzero(at[0]))
        elif at[1].any() and at[-1].any():
            rows.append(plus - minus)
            half = (plus + minus) / 2 if k == plan.patterns.level else half
        elif at[1].any() or at[-1].any():
            alone.append(plus + minus)
    if alone:
        rows += list(np.array(alone) - (np.mean(alone, axis=0) if half is None else half))
    return np.array(rows).reshape(-1, plan.exposures)


def _orthonormal(decoder: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Combine decoder (K, M) and rows (K, N) so that the rows are orthonormal.

    The first row alone sees a constant image; where it is not mostly constant itself it tells the
    level badly, and is left out. The others are turned so that white noise of the readings makes
    errors that are independent of each other.
    """
    left, strength, right = np.linalg.svd(rows, full_matrices=False)
    retained = strength > RANK * strength.max(initial=0.0)
    rows, decoder = right[retained], (left[:, retained] / strength[retained]).T @ decoder
    constant = rows.sum(axis=1) / np.sqrt(rows.shape[1])
    fraction = float(constant @ constant)
    first = int(fraction >= RANK)
    level, others = np.split(np.linalg.qr(constant[:, None], mode="complete").Q.T, [first])
    if fraction <= DC_FRACTION:
        level = level[:0]
    turn = np.linalg.svd(others @ decoder, full_matrices=False)[0].T @ others
    turn = np.concatenate([level, turn])
    return turn @ decoder, turn @ rows
