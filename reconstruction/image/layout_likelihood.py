"""Likelihood of readings under the pattern plan of a layout and the power spectra of images.

The M readings of a frame are mapped, without change of volume, to K coefficients of rows and M - K
sums in which the rows cancel, which are equal but for noise and drift. The likelihood of the
readings is that of both: of the coefficients under the spectrum of images (`spectra`), of the sums
as Gaussian noise about a common mean.
"""

from functools import lru_cache
from math import log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import PatternPlan, RowOperator
from ..operators.bases.hadamard import Hadamard
from .spectra import USUAL_MODEL, Fit, fit, gaussian, spectra

MAX_FITTED, MAX_ROUGH = 4096, 1024
"""Coefficients in the final and in the rough fit; of more, a random subset, the same for each
order."""
MAX_FRAMES = 4
"""Maximum number of frames that are fitted."""
NEGATIVE = 20.0
"""Log odds against negative readings of light, which only a subtracted offset can cause."""


class Parts(NamedTuple):
    """Coefficients ``values`` (K,) of ``rows`` (K,), sums without rows, and the DC coefficient."""

    rows: NDArray[np.int32]
    values: Floats
    sums: Floats
    dc: float


def parts_of(plan: PatternPlan, readings: Floats) -> Parts:
    """Map readings (M,) of a frame to coefficients and sums, without change of volume."""
    both = _pairs(plan)
    if both is not None:
        plus, minus = both
        rows = plan.index[plus]
        sums = (readings[plus] + readings[minus]) / np.sqrt(2)
        values = (readings[plus] - readings[minus]) / np.sqrt(2)
        lit = rows == plan.patterns.dc_row
        dc = float(values[lit][0]) if lit.any() else np.nan
        return Parts(rows[~lit], values[~lit], sums - np.median(sums), dc)
    varying = plan.index != plan.patterns.dc_row
    rows, values = plan.index[varying], readings[varying]
    if not plan.polarity.any():
        return Parts(rows, values, np.empty(0), np.nan)
    expected = row_spectra(plan.shape).mean(axis=0)[rows]
    background = np.median(values[expected <= np.median(expected)])
    values, dc = values - background, readings[~varying] - background
    if dc.size == 2:  # all-on and dark: half their sum is the background plus noise
        rows = np.append(rows, rows[np.argmin(expected)])
        values = np.append(values, dc.sum() / np.sqrt(2))
    return Parts(rows, values, np.empty(0), float(dc @ plan.polarity[~varying]))


def _pairs(plan: PatternPlan) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Exposures of both polarities of every row; None unless each row has just these two."""
    plus, minus = (np.flatnonzero(plan.polarity == sign) for sign in (1, -1))
    if plus.size + minus.size < plan.exposures or plus.size != minus.size:
        return None
    rows = plan.index[plus]
    minus = minus[np.argsort(plan.index[minus])][np.argsort(np.argsort(rows))]
    return (plus, minus) if (rows == plan.index[minus]).all() else None


def fit_plan(plan: PatternPlan, readings: NDArray[Any], *, rough: bool = False) -> Fit | None:
    """Mean log likelihoods of some frames under a plan, None if it is not supported."""
    exposures = np.bincount(plan.index[plan.index != plan.patterns.dc_row])
    if exposures.max(initial=0) == 0 or (exposures.max() > 1 and _pairs(plan) is None):
        return None
    frames = np.unique(np.linspace(0, len(readings) - 1, MAX_FRAMES).astype(int))
    models = row_spectra(plan.shape)
    models, maximum = (models[[USUAL_MODEL]], MAX_ROUGH) if rough else (models, MAX_FITTED)
    fits = [
        _fit_frame(plan, readings[frame].astype(np.float64), models, maximum) for frame in frames
    ]
    return Fit(*np.mean(fits, axis=0))


def _fit_frame(plan: PatternPlan, readings: Floats, models: Floats, maximum: int) -> Fit:
    scale = float(np.abs(readings).max()) or 1.0
    rows, values, sums, dc = parts_of(plan, readings / scale)
    result = fit_some(values, models, rows, maximum)
    others = readings.size - values.size - sums.size  # DC may be anything
    penalty = others * log(2.0)
    if plan.polarity.any():  # the background is one more parameter
        penalty += log(readings.size) / 2 + NEGATIVE * (readings.min() < 0)
    if dc < 0:  # all-on is darker than all-off
        penalty += min(readings.size, dc**2 / (2 * np.mean(values**2) + np.finfo(float).tiny))
    common = gaussian(sums) - penalty
    return Fit(result.image + common, result.white + common)


def fit_some(values: Floats, models: Floats, rows: NDArray[Any], maximum: int = MAX_FITTED) -> Fit:
    """Fit of a subset of many values, scaled to all."""
    if values.size <= maximum:
        return fit(values, models[:, rows])
    some = np.random.default_rng(0).choice(values.size, maximum, replace=False)
    fraction = values.size / maximum
    return Fit(*(fraction * each for each in fit(values[some], models[:, rows[some]])))


def coarseness(readings: NDArray[Any], maximum: int = MAX_FITTED) -> float:
    """Factor by which log likelihoods are less certain, as a subset represents all readings."""
    return max(readings.shape[1] / maximum, 1.0)


@lru_cache(maxsize=4)
def row_spectra(shape: tuple[int, int]) -> Floats:
    """Variances (models, N) of all Hadamard rows in images, 0 for DC."""
    basis = Hadamard(shape)
    operator = RowOperator(basis, np.arange(basis.rows, dtype=np.int32))
    varying = spectra(operator)
    result = np.zeros((len(varying), basis.rows))
    result[:, operator.varying] = varying
    return result
