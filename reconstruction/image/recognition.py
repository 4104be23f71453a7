"""In which layout readings came: which pattern each belongs to, told by the spectrum of images.

A layout is a named order of Hadamard rows and a named sequence of polarities. For each the M
readings are turned, without change of volume, into K coefficients of rows, and M - K sums in which
the rows cancel and which are all alike but for noise and drift. The likelihood of the readings is
that of both: of the coefficients by the spectrum of images (`spectra`), of the sums as Gaussian
noise about a common mean.

A picture cannot be told from its mirror images by its spectrum, nor one of a square from the one
with rows and columns exchanged.
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
"""Coefficients that are looked at, closely and roughly; of more, some by chance, the same ones for
each order."""
MAX_FRAMES = 4
"""Frames of a recording that are looked at."""
MAX_REFINED = 14
"""Layouts that all spectra are tried with, the likeliest by the usual one."""
TEMPERATURE, WORTH = 2.0, 400
"""Differences of log-likelihood of M readings are divided by TEMPERATURE (1 + M / WORTH) for
probabilities: coefficients of one image are not as independent as the model has them, and the
spectrum of none is quite that of a model, so that any number of readings says no more than so many
(J. W. Miller, D. B. Dunson, J. Am. Stat. Assoc. 114, 1113 (2019)). By the mean logarithm of the
probability of what was shown, of scenes that tools/drawn_images.py draws to learn from."""
NEGATIVE = 20.0
"""Log-odds against negative counts of displayed light: only an offset taken off makes them."""
MIN_GAIN = 6.0
"""Log-likelihood that images' spectrum must gain over a white one for readings to tell a layout;
coefficients in any order gain up to 4."""
MIN_DOUBT = 30.0
"""By how much another layout must be likelier for a named one to be doubted, and what tails gain
that are heavier than those of noise."""
MIN_SPREAD = 2000.0
"""Log-likelihood that the usual spectrum of images would gain, where its absence means something:
a thousand rows of all frequencies. Few low ones vary little, in a texture the other way round."""
OTHER_TRANSFORM = 12.0
"""The same for coefficients of another transform, compared with the likeliest layout."""

AXIS_ORDERS = ("natural", "dyadic", "sequency")
"""Of the rows along one axis."""

UNLIT = "single-ended without dark"
"""A sequence of polarities that tells no background, but may well be what was recorded."""
SEQUENCES = POLARITIES | {
    UNLIT: lambda rows, _: (rows.astype(np.int32), np.ones(len(rows), np.int8)),
}


class Layout(NamedTuple):
    """A named order of the rows, a named sequence of polarities, and the plan that they make.

    ``transposed``: the pixels are numbered column by column.
    """

    order: str
    polarity: str
    transposed: bool
    plan: PatternPlan

    def __str__(self) -> str:
        turned = ", transposed" if self.transposed else ""
        return f"order {self.order}, polarity {self.polarity}{turned}"


class Candidate(NamedTuple):
    """A layout and how probable it is among those that were tried.

    ``likelihood`` is the logarithm, up to a constant of the readings; ``gain`` by how much it
    exceeds that of the same polarities with a white spectrum.
    """

    layout: Layout
    probability: float
    likelihood: float
    gain: float


def candidate_layouts(
    shape: tuple[int, int], exposures: int, polarity: str | None = None
) -> Iterator[Layout]:
    """Layouts of so many readings, of one polarity if it is told; equal ones once."""
    seen = set()
    sequences = list(SEQUENCES) if polarity is None else [polarity]
    for turned in (False, True) if shape[0] != shape[1] else (False,):
        basis = Hadamard(shape[::-1] if turned else shape)
        for order, _ in ORDERS.loadable():
            try:
                rows = ordered_rows(basis, order)
            except Exception:  # one of other patterns, with a seed, or of a faulty package
                continue
            for name in sequences:
                retained = _rows_of(exposures, name)
                if not 1 < retained <= len(rows):
                    continue
                index, sign = SEQUENCES[name](rows[:retained], 0)
                plan = PatternPlan(basis.shape, index, sign, order, basis)
                plan = transposed(plan) if turned else plan
                if (key := (plan.index.tobytes(), sign.tobytes())) not in seen:
                    seen.add(key)
                    yield Layout(order, name, turned, plan)


def _rows_of(exposures: int, polarity: str) -> int:
    """How many rows so many exposures show; 0 where that cannot be."""
    for rows in (exposures, exposures - 1, exposures // 2):
        if rows > 0 and len(SEQUENCES[polarity](np.arange(rows), 0)[0]) == exposures:
            return rows
    return 0


def recognise(
    readings: NDArray[Any], shape: tuple[int, int], polarity: str | None = None
) -> list[Candidate]:
    """Known layouts of readings (frames, M), the most probable first.

    Raises InputError for an unknown polarity, where the shape has no Hadamard patterns, no layout
    has so many readings or none explains them better than chance does, and where they look like
    coefficients of another transform.
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
            f"no known layout explains the {readings.shape[1]} readings better than chance does "
            f"(the best: {best.layout}): name order and polarity, or give the row numbers"
        )
    other = _other_transform(best.layout.plan, readings)
    if other is not None:
        raise InputError(f"the readings look like {other}, not like Hadamard's")
    return result


def doubt(plan: PatternPlan, readings: NDArray[Any]) -> str | None:
    """A sentence on why readings (frames, M) can hardly be of this plan, None where they can.

    Of Hadamard patterns alone, each shown once or in both polarities.
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
    if gap > MIN_DOUBT * _coarseness(readings, MAX_ROUGH):
        best = _ranked(readings, plan.shape)[0]
        if best.likelihood - declared.image > MIN_DOUBT * _coarseness(readings):
            reported = _other_transform(best.layout.plan, readings) or str(best.layout)
            return (
                "the readings do not look like those of an image in the pattern plan's order; "
                f"they look like {reported}"
            )
    other = _other_transform(plan, readings)
    if other is not None:
        return f"the readings look like {other}, not like those of the pattern plan"
    if declared.gain < MIN_GAIN and _scattered(plan, readings[0]):
        return (
            "the readings have nothing to do with the pattern plan's order, nor with another that "
            "is known: their patterns may have been shown in an order of their own"
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
    """Known layouts and their log-likelihoods by the usual spectrum alone, the likeliest first."""
    result = [
        (layout, rough.image)
        for layout in candidate_layouts(shape, readings.shape[1], polarity)
        if (rough := _fit(layout.plan, readings, rough=True)) is not None
    ]
    return sorted(result, key=lambda each: -each[1])


def _other_transform(plan: PatternPlan, readings: NDArray[Any]) -> str | None:
    """Name of a complete transform whose coefficients, in the sequence in which the plan's rows
    come, are likelier than those rows, and than Hadamard's rows in orders that have no name."""
    if plan.sampled < plan.pixels or plan.distinct[0] != plan.patterns.level:
        return None
    position = np.argsort(plan.distinct)
    parts = _parts(plan, readings[0].astype(np.float64))
    bar = _fit_some(parts.values, row_spectra(plan.shape), parts.rows).image
    for order in _unnamed_orders(plan.shape):
        result = _fit_some(parts.values, row_spectra(plan.shape), order[position[parts.rows]]).image
        bar = max(bar, result)
    bar += OTHER_TRANSFORM * _coarseness(readings)
    likeliest = None
    for name, models in other_spectra(plan.shape):
        result = _fit_some(parts.values, models, position[parts.rows]).image
        if result > bar:
            likeliest, bar = name, result
    return likeliest


@lru_cache(maxsize=4)
def _unnamed_orders(shape: tuple[int, int]) -> list[NDArray[np.int64]]:
    """Orders of all rows in which some software has them: one along columns, one along rows.

    Their coefficients fall off along both axes as those of Haar's wavelets do.
    """
    along = [
        [ordered_rows(Hadamard((1, side)), order).astype(np.int64) for order in AXIS_ORDERS]
        for side in shape
    ]
    return [np.add.outer(shape[1] * tall, wide).ravel() for tall in along[0] for wide in along[1]]


def _scattered(plan: PatternPlan, readings: NDArray[Any]) -> bool:
    """Whether coefficients vary more than noise does, of rows that vary much in images."""
    parts = _parts(plan, readings.astype(np.float64))
    usual = row_spectra(plan.shape).mean(axis=0)[parts.rows]
    spread = parts.rows.size * np.log(usual.mean()) - np.log(usual).sum()
    return bool(spread > MIN_SPREAD and heavy_tails(parts.values) > MIN_DOUBT)


def dark_estimate(plan: PatternPlan, readings: NDArray[Any]) -> float:
    """What a dark exposure would have read, from readings (M,) of +1 alone; nan without all-on.

    The rows that images excite least read half of all-on and dark together.
    """
    varying = plan.index != plan.patterns.level
    expected = row_spectra(plan.shape).mean(axis=0)[plan.index[varying]]
    background = np.median(readings[varying][expected <= np.median(expected)])
    lit = readings[~varying]
    return float(2 * background - lit.mean()) if lit.size else np.nan


class _Parts(NamedTuple):
    """M readings as ``rows`` and their coefficients ``values``, both (K,), and ``sums``.

    In sums the rows cancel; they are less their median. ``level`` is the coefficient of the level,
    nan where there is none.
    """

    rows: NDArray[np.int32]
    values: Floats
    sums: Floats
    level: float


def _parts(plan: PatternPlan, readings: Floats) -> _Parts:
    both = _pairs(plan)
    if both is not None:
        plus, minus = both
        rows = plan.index[plus]
        sums = (readings[plus] + readings[minus]) / np.sqrt(2)
        values = (readings[plus] - readings[minus]) / np.sqrt(2)
        lit = rows == plan.patterns.level
        level = float(values[lit][0]) if lit.any() else np.nan
        return _Parts(rows[~lit], values[~lit], sums - np.median(sums), level)
    varying = plan.index != plan.patterns.level
    rows, values = plan.index[varying], readings[varying]
    if not plan.polarity.any():
        return _Parts(rows, values, np.empty(0), np.nan)
    expected = row_spectra(plan.shape).mean(axis=0)[rows]
    background = np.median(values[expected <= np.median(expected)])
    values, level = values - background, readings[~varying] - background
    if level.size == 2:  # all on and dark: half their sum is the background, but for noise
        rows = np.append(rows, rows[np.argmin(expected)])
        values = np.append(values, level.sum() / np.sqrt(2))
    return _Parts(rows, values, np.empty(0), float(level @ plan.polarity[~varying]))


def _pairs(plan: PatternPlan) -> tuple[NDArray[np.intp], NDArray[np.intp]] | None:
    """Positions of both polarities of every row, None unless each is shown just so."""
    plus, minus = (np.flatnonzero(plan.polarity == sign) for sign in (1, -1))
    if plus.size + minus.size < plan.exposures or plus.size != minus.size:
        return None
    rows = plan.index[plus]
    minus = minus[np.argsort(plan.index[minus])][np.argsort(np.argsort(rows))]
    return (plus, minus) if (rows == plan.index[minus]).all() else None


def _fit(plan: PatternPlan, readings: NDArray[Any], *, rough: bool = False) -> Fit | None:
    """Log-likelihoods of readings (frames, M) under a plan, the mean over some frames.

    ``rough``: with the usual spectrum alone, and of fewer coefficients.

    None where rows are shown more often than `_parts` knows, or none but the level.
    """
    exposures = np.bincount(plan.index[plan.index != plan.patterns.level])
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
    rows, values, sums, level = _parts(plan, readings / scale)
    result = _fit_some(values, models, rows, maximum)
    others = readings.size - values.size - sums.size  # the level: anything goes
    penalty = others * log(2.0)
    if plan.polarity.any():  # the background is one more parameter
        penalty += log(readings.size) / 2 + NEGATIVE * (readings.min() < 0)
    if level < 0:  # all on is darker than all off
        penalty += min(readings.size, level**2 / (2 * np.mean(values**2) + np.finfo(float).tiny))
    reported = gaussian(sums) - penalty
    return Fit(result.image + reported, result.white + reported)


def _fit_some(values: Floats, models: Floats, rows: NDArray[Any], maximum: int = MAX_FITTED) -> Fit:
    """Fit of some of many values, for all."""
    if values.size <= maximum:
        return fit(values, models[:, rows])
    some = np.random.default_rng(0).choice(values.size, maximum, replace=False)
    fraction = values.size / maximum
    return Fit(*(fraction * each for each in fit(values[some], models[:, rows[some]])))


def _coarseness(readings: NDArray[Any], maximum: int = MAX_FITTED) -> float:
    """By how much log-likelihoods of so many readings are less sure, since some stand for all."""
    return max(readings.shape[1] / maximum, 1.0)


@lru_cache(maxsize=4)
def row_spectra(shape: tuple[int, int]) -> Floats:
    """Variances (models, N) of all Hadamard rows in images, 0 for the level."""
    basis = Hadamard(shape)
    operator = RowOperator(basis, np.arange(basis.rows, dtype=np.int32))
    varying = spectra(operator)
    result = np.zeros((len(varying), basis.rows))
    result[:, operator.varying] = varying
    return result
