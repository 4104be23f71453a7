"""Recognition of the layout of readings, by the power spectrum of images.

A layout is a named order of Hadamard rows and a named sequence of polarities. For each layout, the
M readings are mapped, without change of volume, to K coefficients of rows and M - K sums in which
the rows cancel, which are equal but for noise and drift. The likelihood of the readings is that of
both: of the coefficients under the spectrum of images (`spectra`), of the sums as Gaussian noise
about a common mean.

An image cannot be distinguished from its mirror images by its spectrum, nor a square one from its
transpose.
"""

from collections.abc import Iterator
from functools import lru_cache
from math import log
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError, nearest
from ..operators import ORDERS, POLARITIES, PatternPlan, RowOperator, ordered_rows, transposed
from ..operators.bases.hadamard import Hadamard
from .spectra import USUAL_MODEL, Fit, fit, gaussian, heavy_tails, spectra
from .transforms import other_spectra

MAX_FITTED, MAX_ROUGH = 4096, 1024
"""Coefficients in the final and in the rough fit; of more, a random subset, the same for each
order."""
MAX_FRAMES = 4
"""Maximum number of frames that are fitted."""
MAX_REFINED = 14
"""Layouts, the most probable under the usual spectrum, that are fitted with all spectra."""
TEMPERATURE, WORTH = 2.0, 400
"""Differences of log likelihood of M readings are divided by TEMPERATURE (1 + M / WORTH) before
they become probabilities: coefficients of one image are less independent than the model assumes,
and no spectrum is exactly that of a model, so that the information saturates (J. W. Miller, D. B.
Dunson, J. Am. Stat. Assoc. 114, 1113 (2019)). Fitted to the mean log probability of the true
layout, for scenes that tools/drawn_images.py generates for training."""
NEGATIVE = 20.0
"""Log odds against negative readings of light, which only a subtracted offset can cause."""
MIN_GAIN = 6.0
"""Log likelihood that the spectrum of images must gain over a white one to identify a layout;
coefficients in random order gain up to 4."""
MIN_MARGIN = 30.0
"""Margin of log likelihood by which another layout contradicts the plan, and by which heavy tails
must exceed Gaussian noise."""
MIN_SPREAD = 2000.0
"""Expected gain of the usual spectrum above which its absence is significant: a thousand rows of
all frequencies. A few low ones vary little, and the other way round in a texture."""
OTHER_TRANSFORM = 12.0
"""Margin of coefficients of another transform over the most probable layout."""

AXIS_ORDERS = ("natural", "dyadic", "sequency")
"""Orders of the rows along one axis."""

WITHOUT_DARK = "single-ended without dark"
"""Sequence of polarities that leaves the background undetermined, but is found in recordings."""
SEQUENCES = POLARITIES | {
    WITHOUT_DARK: lambda rows, _: (rows.astype(np.int32), np.ones(len(rows), np.int8))
}


class Layout(NamedTuple):
    """Named order and sequence of polarities, whether pixels go by columns, and the plan."""

    order: str
    polarity: str
    transposed: bool
    plan: PatternPlan

    def __str__(self) -> str:
        turned = ", transposed" if self.transposed else ""
        return f"order {self.order}, polarity {self.polarity}{turned}"


class Candidate(NamedTuple):
    """Layout, its probability, log likelihood, and gain over a white spectrum."""

    layout: Layout
    probability: float
    likelihood: float
    gain: float


def candidate_layouts(
    shape: tuple[int, int], exposures: int, polarity: str | None = None
) -> Iterator[Layout]:
    """Generate all distinct layouts of a recording.

    Parameters
    ----------
    shape
        Rows H and columns W of the image.
    exposures
        Number of readings M per frame.
    polarity
        Sequence of polarities, if it is known.
    """
    seen = set()
    sequences = list(SEQUENCES) if polarity is None else [polarity]
    for turned in (False, True) if shape[0] != shape[1] else (False,):
        basis = Hadamard(shape[::-1] if turned else shape)
        for order, _ in ORDERS.loadable():
            try:
                rows = ordered_rows(basis, order)
            except Exception:  # for other patterns, seeded, or from a faulty package
                continue
            for name in sequences:
                count = _rows_of(exposures, name)
                if not 1 < count <= len(rows):
                    continue
                index, sign = SEQUENCES[name](rows[:count], 0)
                plan = PatternPlan(basis.shape, index, sign, order, basis)
                plan = transposed(plan) if turned else plan
                if (key := (plan.index.tobytes(), sign.tobytes())) not in seen:
                    seen.add(key)
                    yield Layout(order, name, turned, plan)


def _rows_of(exposures: int, polarity: str) -> int:
    """Number of rows exposed by this number of exposures, or 0."""
    for rows in (exposures, exposures - 1, exposures // 2):
        if rows > 0 and len(SEQUENCES[polarity](np.arange(rows), 0)[0]) == exposures:
            return rows
    return 0


def recognise(
    readings: NDArray[Any], shape: tuple[int, int], polarity: str | None = None
) -> list[Candidate]:
    """Rank the known layouts of a recording.

    Parameters
    ----------
    readings
        Readings (frames, M).
    shape
        Rows H and columns W of the image.
    polarity
        Sequence of polarities, if it is known.

    Returns
    -------
    list of Candidate
        Most probable layout first.

    Raises
    ------
    InputError
        If the polarity is unknown, the shape has no Hadamard patterns, no layout has M readings or
        explains them better than chance, or they look like coefficients of another transform.
    """
    if polarity is not None and polarity not in SEQUENCES:
        raise InputError(f"unknown polarity {polarity!r}: {nearest(polarity, POLARITIES)}")
    result = _ranked(readings, shape, polarity)
    if not result:
        raise InputError(
            f"no known layout of {shape[0]} x {shape[1]} pixels has {readings.shape[1]} readings"
        )
    best = result[0]
    if best.gain < MIN_GAIN:
        raise InputError(
            f"no known layout explains the {readings.shape[1]} readings better than chance (the "
            f"best: {best.layout}): state order and polarity, or the row numbers"
        )
    other = _other_transform(best.layout.plan, readings)
    if other is not None:
        raise InputError(f"the readings look like {other}, not like Hadamard's")
    return result


def plan_inconsistency(plan: PatternPlan, readings: NDArray[Any]) -> str | None:
    """Check readings for consistency with their plan.

    Only plans of Hadamard patterns are checked, each exposed once or with both polarities.

    Parameters
    ----------
    plan
        Plan of M exposures.
    readings
        Readings (frames, M).

    Returns
    -------
    str or None
        Message on why the readings contradict the plan, None if they do not.
    """
    if plan.basis != "hadamard" or not np.ptp(readings, axis=1).any():
        return None
    roughly = _fit(plan, readings, rough=True)
    if roughly is None:
        return None
    declared = _fit(plan, readings)
    assert declared is not None
    likely = _likely(readings, plan.shape)
    gap = likely[0][1] - roughly.image if likely else 0.0
    if gap > MIN_MARGIN * _coarseness(readings, MAX_ROUGH):
        best = _ranked(readings, plan.shape)[0]
        if best.likelihood - declared.image > MIN_MARGIN * _coarseness(readings):
            actual = _other_transform(best.layout.plan, readings) or str(best.layout)
            return (
                "the readings do not look like an image in the pattern plan's order; they look "
                f"like {actual}"
            )
    other = _other_transform(plan, readings)
    if other is not None:
        return f"the readings look like {other}, not like those of the pattern plan"
    if declared.gain < MIN_GAIN and _scattered(plan, readings[0]):
        return (
            "the readings match neither the pattern plan's order nor another known one: their "
            "patterns may have been displayed in a custom order"
        )
    return None


def _ranked(
    readings: NDArray[Any], shape: tuple[int, int], polarity: str | None = None
) -> list[Candidate]:
    likely = _likely(readings, shape, polarity)[:MAX_REFINED]
    tried = [
        (layout, result)
        for layout, _ in likely
        if (result := _fit(layout.plan, readings)) is not None
    ]
    likelihoods = np.array([result.image for _, result in tried])
    temperature = TEMPERATURE * (1 + readings.shape[1] / WORTH)
    weights = np.exp((likelihoods - likelihoods.max(initial=-np.inf)) / temperature)
    ranked = [
        Candidate(layout, float(weight / weights.sum()), result.image, result.gain)
        for (layout, result), weight in zip(tried, weights, strict=True)
    ]
    return sorted(ranked, key=lambda candidate: -candidate.probability)


def _likely(
    readings: NDArray[Any], shape: tuple[int, int], polarity: str | None = None
) -> list[tuple[Layout, float]]:
    """Known layouts with their log likelihoods under the usual spectrum, most probable first."""
    result = [
        (layout, rough.image)
        for layout in candidate_layouts(shape, readings.shape[1], polarity)
        if (rough := _fit(layout.plan, readings, rough=True)) is not None
    ]
    return sorted(result, key=lambda each: -each[1])


def _other_transform(plan: PatternPlan, readings: NDArray[Any]) -> str | None:
    """Complete transform that fits the readings better than the plan's rows in any order."""
    if plan.sampled < plan.pixels or plan.distinct[0] != plan.patterns.dc_row:
        return None
    sequence = np.argsort(plan.distinct)
    parts = _parts(plan, readings[0].astype(np.float64))
    bar = _fit_some(parts.values, row_spectra(plan.shape), parts.rows).image
    for order in _unnamed_orders(plan.shape):
        result = _fit_some(parts.values, row_spectra(plan.shape), order[sequence[parts.rows]]).image
        bar = max(bar, result)
    bar += OTHER_TRANSFORM * _coarseness(readings)
    likeliest = None
    for name, models in other_spectra(plan.shape):
        result = _fit_some(parts.values, models, sequence[parts.rows]).image
        if result > bar:
            likeliest, bar = name, result
    return likeliest


@lru_cache(maxsize=4)
def _unnamed_orders(shape: tuple[int, int]) -> list[NDArray[np.int64]]:
    """Separable orders used by some software: one order along columns, one along rows."""
    along = [
        [ordered_rows(Hadamard((1, side)), order).astype(np.int64) for order in AXIS_ORDERS]
        for side in shape
    ]
    return [np.add.outer(shape[1] * tall, wide).ravel() for tall in along[0] for wide in along[1]]


def _scattered(plan: PatternPlan, readings: NDArray[Any]) -> bool:
    """Whether coefficients vary more than noise although their rows should vary little."""
    parts = _parts(plan, readings.astype(np.float64))
    usual = row_spectra(plan.shape).mean(axis=0)[parts.rows]
    spread = parts.rows.size * np.log(usual.mean()) - np.log(usual).sum()
    return bool(spread > MIN_SPREAD and heavy_tails(parts.values) > MIN_MARGIN)


def dark_estimate(plan: PatternPlan, readings: NDArray[Any]) -> float:
    """Estimate the reading of a dark exposure from exposures of polarity +1.

    The rows that images excite least read the mean of the all-on and the dark exposure.

    Parameters
    ----------
    plan
        Plan of M exposures.
    readings
        Readings (M,) of one frame.

    Returns
    -------
    float
        Reading of a dark exposure; nan without an all-on exposure.
    """
    varying = plan.index != plan.patterns.dc_row
    expected = row_spectra(plan.shape).mean(axis=0)[plan.index[varying]]
    background = np.median(readings[varying][expected <= np.median(expected)])
    lit = readings[~varying]
    return float(2 * background - lit.mean()) if lit.size else np.nan


class _Parts(NamedTuple):
    """Coefficients ``values`` (K,) of ``rows`` (K,), sums without rows, and the DC coefficient."""

    rows: NDArray[np.int32]
    values: Floats
    sums: Floats
    dc: float


def _parts(plan: PatternPlan, readings: Floats) -> _Parts:
    both = _pairs(plan)
    if both is not None:
        plus, minus = both
        rows = plan.index[plus]
        sums = (readings[plus] + readings[minus]) / np.sqrt(2)
        values = (readings[plus] - readings[minus]) / np.sqrt(2)
        lit = rows == plan.patterns.dc_row
        dc = float(values[lit][0]) if lit.any() else np.nan
        return _Parts(rows[~lit], values[~lit], sums - np.median(sums), dc)
    varying = plan.index != plan.patterns.dc_row
    rows, values = plan.index[varying], readings[varying]
    if not plan.polarity.any():
        return _Parts(rows, values, np.empty(0), np.nan)
    expected = row_spectra(plan.shape).mean(axis=0)[rows]
    background = np.median(values[expected <= np.median(expected)])
    values, dc = values - background, readings[~varying] - background
    if dc.size == 2:  # all-on and dark: half their sum is the background plus noise
        rows = np.append(rows, rows[np.argmin(expected)])
        values = np.append(values, dc.sum() / np.sqrt(2))
    return _Parts(rows, values, np.empty(0), float(dc @ plan.polarity[~varying]))


def _pairs(plan: PatternPlan) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Exposures of both polarities of every row; None unless each row has just these two."""
    plus, minus = (np.flatnonzero(plan.polarity == sign) for sign in (1, -1))
    if plus.size + minus.size < plan.exposures or plus.size != minus.size:
        return None
    rows = plan.index[plus]
    minus = minus[np.argsort(plan.index[minus])][np.argsort(np.argsort(rows))]
    return (plus, minus) if (rows == plan.index[minus]).all() else None


def _fit(plan: PatternPlan, readings: NDArray[Any], *, rough: bool = False) -> Fit | None:
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
    rows, values, sums, dc = _parts(plan, readings / scale)
    result = _fit_some(values, models, rows, maximum)
    others = readings.size - values.size - sums.size  # DC may be anything
    penalty = others * log(2.0)
    if plan.polarity.any():  # the background is one more parameter
        penalty += log(readings.size) / 2 + NEGATIVE * (readings.min() < 0)
    if dc < 0:  # all-on is darker than all-off
        penalty += min(readings.size, dc**2 / (2 * np.mean(values**2) + np.finfo(float).tiny))
    common = gaussian(sums) - penalty
    return Fit(result.image + common, result.white + common)


def _fit_some(values: Floats, models: Floats, rows: NDArray[Any], maximum: int = MAX_FITTED) -> Fit:
    """Fit of a subset of many values, scaled to all."""
    if values.size <= maximum:
        return fit(values, models[:, rows])
    some = np.random.default_rng(0).choice(values.size, maximum, replace=False)
    fraction = values.size / maximum
    return Fit(*(fraction * each for each in fit(values[some], models[:, rows[some]])))


def _coarseness(readings: NDArray[Any], maximum: int = MAX_FITTED) -> float:
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
