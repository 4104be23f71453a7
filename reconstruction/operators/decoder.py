"""Decoding: from readings of exposed patterns to background-free coefficients of an image.

A row of the decoder averages the readings of one pattern. It uses y where the recorder has formed
the difference, y+ - y- where both polarities were exposed, and otherwise 2 (y - dark) - (all -
dark) or its complement; the all-on and the dark reading are those of the DC row at both polarities.
Where the throughput t of patterns is known, y - dark is divided by it.
Dense patterns without these two are compared with their mean (F. Ferri et al., Phys. Rev. Lett.
104, 253603 (2010)). For an orthogonal basis this is refused, as one more exposure is better.
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
"""Smallest singular value of the patterns that counts as measured, relative to the largest."""
DC_FRACTION = 0.5
"""Minimum constant fraction of the energy of a row that measures the DC coefficient."""


@dataclass(frozen=True, eq=False)
class Decoder:
    """Linear map from the readings of a plan to the coefficients of an operator.

    Parameters
    ----------
    matrix
        Weights (K, M) of the readings.
    operator
        `MeasurementOperator` (K, N) that the coefficients belong to.
    index
        Rows (K,) of the plan's basis that the coefficients rest on; for a dense basis, all exposed.
    shared
        Readings (M,) that enter several coefficients of an orthogonal basis.
    """

    matrix: SparseRows | Floats
    operator: MeasurementOperator
    index: NDArray[np.int32]
    shared: Mask

    @property
    def has_dc(self) -> bool:
        """Whether the DC coefficient is measured."""
        return self.operator.dc_row is not None

    def measured(self, usable: Mask) -> Mask:
        """Mask (K,) of orthogonal coefficients that rest on ``usable`` (M,) readings alone."""
        if isinstance(self.matrix, SparseRows):
            return self.matrix.resting_on(usable)
        return np.ones(len(self.matrix), dtype=bool)

    def decode(self, signal: NDArray[Any]) -> NDArray[Any]:
        """Coefficients (..., K) of readings (..., M), in the same unit, real or complex."""
        flat = np.asarray(signal).reshape(-1, self.matrix.shape[1])
        return np.asarray((self.matrix @ flat.T).T).reshape(*np.shape(signal)[:-1], -1)

    def own_variance(self, variance: Floats) -> Floats:
        """Variance (..., K) of the coefficients due to the readings that are not shared.

        ``variance`` (..., M) is that of the readings. The full covariance is S V S^T + diag(own),
        with S the columns of the shared readings and V the diagonal matrix of their variances.
        """
        own = np.where(self.shared, 0.0, variance).reshape(-1, self.shared.size)
        return np.asarray((self._squared @ own.T).T).reshape(*variance.shape[:-1], -1)

    @cached_property
    def _squared(self) -> SparseRows | Floats:
        return self.matrix**2

    def shared_columns(self) -> Floats:
        """Columns (K, S) of the shared readings."""
        (readings,) = self.shared.nonzero()
        units = np.zeros((self.shared.size, readings.size))
        units[readings, range(readings.size)] = 1
        return np.asarray(self.matrix @ units)


def decoder_for(plan: PatternPlan, usable: Mask | None = None) -> Decoder:
    """Create the decoder of a plan.

    Parameters
    ----------
    plan
        Plan of M exposures.
    usable
        Mask (M,) of the readings to use, all by default. Coefficients that rest on other readings
        are omitted, possibly all of them.

    Raises
    ------
    InputError
        If the plan does not determine the background.
    """
    usable = np.ones(plan.exposures, dtype=bool) if usable is None else usable
    if not plan.patterns.orthogonal:
        return _dense_decoder(plan, usable)
    matrix = _row_decoder(plan)
    complete = matrix.resting_on(usable)
    matrix, index = matrix.only(complete), plan.distinct[complete]
    shared = np.bincount(matrix.columns, minlength=plan.exposures) > 1
    operator = RowOperator(plan.patterns, index)
    if plan.throughput is not None:  # photon noise, the root of the light, over the throughput
        operator.usual_noise = plan.factors_of(index) ** -0.5
    return Decoder(matrix, operator, index, shared)


def _row_decoder(plan: PatternPlan) -> SparseRows:
    """Matrix (K, M) that turns readings into signed coefficients."""
    rows = {int(k): row for row, k in enumerate(plan.distinct)}
    exposures = {
        (k, p): np.flatnonzero((plan.index == k) & (plan.polarity == p))
        for k, p in set(zip(plan.index.tolist(), plan.polarity.tolist(), strict=True))
    }
    entries: list[tuple[int, NDArray[np.intp], float]] = []
    dc_row = plan.patterns.dc_row
    gain = dict(zip(plan.index.tolist(), (1 / plan.factors).tolist(), strict=True))
    for k, row in rows.items():
        signed, plus, minus = ((k, p) in exposures for p in (0, 1, -1))
        if signed:
            entries.append((row, exposures[k, 0], gain[k]))
        elif plus and minus:
            entries += [(row, exposures[k, 1], gain[k]), (row, exposures[k, -1], -gain[k])]
        elif (dc_row, 1) in exposures and (dc_row, -1) in exposures:
            sign, of_all = (1.0 if plus else -1.0), gain[int(dc_row or 0)]
            entries += [
                (row, exposures[k, 1 if plus else -1], 2 * sign * gain[k]),
                (row, exposures[dc_row, 1], -sign * of_all),
                (row, exposures[dc_row, -1], -sign * (2 * gain[k] - of_all)),
            ]
        else:
            raise InputError(
                f"the background cannot be removed from pattern index {k}: it is exposed with one "
                "polarity only, and the plan lacks the all-on and the dark exposure (index "
                f"{dc_row} with polarity +1 and -1)"
            )
    row_of = np.concatenate([np.full(at.size, row) for row, at, _ in entries])
    column_of = np.concatenate([at for _, at, _ in entries])
    value = np.concatenate([np.full(at.size, weight / at.size) for _, at, weight in entries])
    return SparseRows(row_of, column_of, value, (len(rows), plan.exposures))


def _dense_decoder(plan: PatternPlan, usable: Mask) -> Decoder:
    """Orthonormalised decoder of any patterns, free of background."""
    difference = _without_background(plan, usable)
    matrix, rows = _orthonormal(difference, difference @ _exposed_patterns(plan))
    operator = MatrixOperator(rows, plan.shape, np.linalg.norm(matrix, axis=1))
    index = np.unique(plan.index[usable]) if len(rows) else plan.index[:0]
    return Decoder(matrix, operator, index, np.zeros(plan.exposures, dtype=bool))


def _exposed_patterns(plan: PatternPlan) -> Floats:
    """Displayed pattern of every exposure times its throughput, (M, N)."""
    signed = plan.patterns.matrix(plan.index)
    polarity = plan.polarity[:, None]
    displayed = np.where(polarity == 0, signed, (1 + polarity * signed) / 2)
    return np.asarray(plan.factors[:, None] * displayed)


def _without_background(plan: PatternPlan, usable: Mask) -> Floats:
    """Combinations (K, M) of usable readings in which the common background cancels."""
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
            half = (plus + minus) / 2 if k == plan.patterns.dc_row else half
        elif at[1].any() or at[-1].any():
            alone.append(plus + minus)
    if alone:
        rows += list(np.array(alone) - (np.mean(alone, axis=0) if half is None else half))
    return np.array(rows).reshape(-1, plan.exposures)


def _orthonormal(decoder: Floats, rows: Floats) -> tuple[Floats, Floats]:
    """Combine decoder (K, M) and rows (K, N) to orthonormal rows, of which the first may see DC."""
    left, strength, right = np.linalg.svd(rows, full_matrices=False)
    retained = strength > RANK * strength.max(initial=0.0)
    rows, decoder = right[retained], (left[:, retained] / strength[retained]).T @ decoder
    constant = rows.sum(axis=1) / np.sqrt(rows.shape[1])
    fraction = float(constant @ constant)
    first = int(fraction >= RANK)
    dc, others = np.split(np.linalg.qr(constant[:, None], mode="complete").Q.T, [first])
    if fraction <= DC_FRACTION:
        dc = dc[:0]
    turn = np.linalg.svd(others @ decoder, full_matrices=False)[0].T @ others
    turn = np.concatenate([dc, turn])
    return turn @ decoder, turn @ rows
