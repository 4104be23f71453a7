"""Recognition of the layout of readings, by the power spectrum of images.

A layout is a named order of Hadamard rows and a named sequence of polarities. Layouts are compared
by the likelihood of the readings under each (`layout_likelihood`).

An image cannot be distinguished from its mirror images by its spectrum, nor a square one from its
transpose.
"""

from collections.abc import Iterator
from functools import lru_cache
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError, nearest
from ..operators import ORDERS, POLARITIES, PatternPlan, ordered_rows, transposed
from ..operators.bases.hadamard import Hadamard
from .layout_likelihood import MAX_ROUGH, coarseness, fit_plan, fit_some, parts_of, row_spectra
from .spectra import heavy_tails
from .transforms import other_spectra

MAX_REFINED = 14
"""Layouts, the most probable under the usual spectrum, that are fitted with all spectra."""
TEMPERATURE, WORTH = 2.0, 400
"""Differences of log likelihood of M readings are divided by TEMPERATURE (1 + M / WORTH) before
they become probabilities: coefficients of one image are less independent than the model assumes,
and no spectrum is exactly that of a model, so that the information saturates (J. W. Miller, D. B.
Dunson, J. Am. Stat. Assoc. 114, 1113 (2019)). Fitted to the mean log probability of the true
layout, for scenes that tools/drawn_images.py generates for training."""
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
    roughly = fit_plan(plan, readings, rough=True)
    if roughly is None:
        return None
    declared = fit_plan(plan, readings)
    assert declared is not None
    likely = _likely(readings, plan.shape)
    gap = likely[0][1] - roughly.image if likely else 0.0
    if gap > MIN_MARGIN * coarseness(readings, MAX_ROUGH):
        best = _ranked(readings, plan.shape)[0]
        if best.likelihood - declared.image > MIN_MARGIN * coarseness(readings):
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
        if (result := fit_plan(layout.plan, readings)) is not None
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
        if (rough := fit_plan(layout.plan, readings, rough=True)) is not None
    ]
    return sorted(result, key=lambda each: -each[1])


def _other_transform(plan: PatternPlan, readings: NDArray[Any]) -> str | None:
    """Complete transform that fits the readings better than the plan's rows in any order."""
    if plan.sampled < plan.pixels or plan.distinct[0] != plan.patterns.dc_row:
        return None
    sequence = np.argsort(plan.distinct)
    parts = parts_of(plan, readings[0].astype(np.float64))
    bar = fit_some(parts.values, row_spectra(plan.shape), parts.rows).image
    for order in _unnamed_orders(plan.shape):
        result = fit_some(parts.values, row_spectra(plan.shape), order[sequence[parts.rows]]).image
        bar = max(bar, result)
    bar += OTHER_TRANSFORM * coarseness(readings)
    likeliest = None
    for name, models in other_spectra(plan.shape):
        result = fit_some(parts.values, models, sequence[parts.rows]).image
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
    parts = parts_of(plan, readings.astype(np.float64))
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
