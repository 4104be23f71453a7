"""Target and fog in first-arrival histograms: likelihood modes of binomial counts.

The mean number of arrivals in a bin per cycle is rho a + beta g + b: the target's pulse, the fog in
front of it, and a steady background. Counts are binomial among the cycles that reach the bin (see
`reconstruction.ranging.histogram`); Fisher scoring fits range, rho, beta and b together.
"""

from dataclasses import dataclass

import numpy as np

from ...base.arrays import Floats, Mask
from ...capture.readings.dtof import HistogramSpots
from ..histogram import coates
from ..shape import PulseShape
from .modes import EMPTY, MAX_EXCESS_MISFIT, MIN_RANGE_M, MIN_STRENGTH, Indices, Modes
from .numerics import inverse, solved
from .overlap import overlap
from .target_prior import even_log_prior
from .templates import EXTINCTIONS_PER_M, UNEVENNESS

STEP_M = 0.005
"""Range step of the fog integral."""
BLOCK = 256
"""Ranges per block when echoes are sorted into bins."""
WINDOW_SIGMAS = 1.5
"""Half width of the window in which arrivals are counted, in standard deviations of the pulse."""
MAX_PEAKS = 8
"""Maximum number of candidate targets per spot and extinction."""
STEPS = 6
FREE = 1.0
"""Prior precision of backscattering, nearly 0: counts determine it, or do not depend on it."""
RATES = 1e-12, 500.0
"""Bounds of arrivals per bin and cycle, within which exp is finite."""
SMOOTH_BINS = 21
"""Bins averaged for an initial variance of the counts."""
Fitted = tuple[Floats, Floats, Floats]  # backscattering, background, variance
NEAR_ERROR = 1.0
"""Relative error of the echo of fog nearer than MIN_RANGE_M, which depends on parts of millimetres
that recordings do not describe; zones return 0.005 to 1 of what their optics say."""
REFITS = 2
"""Fits of the fog, the last without what is uncertain by the first."""
MAX_EXCESS_SIGMAS = 4.0
"""Bins that exceed the fog by more standard deviations are not fog."""


@dataclass(frozen=True, eq=False)
class HistogramTemplates:
    """Tables over spots, K extinctions, R ranges and B bins, in arrivals per cycle.

    ``target`` (spots, K, R): a whole pulse, for unit reflectance; ``delay`` (spots, R) of its
    centre, in bins; ``fog`` (spots, K, B) for unit backscattering; ``shape`` of a pulse.
    """

    range_m: Floats
    extinction_per_m: Floats
    target: Floats
    delay: Floats
    fog: Floats
    shape: PulseShape

    @property
    def nearest(self) -> int:
        """Bin of the nearest targets."""
        return max(int(np.interp(MIN_RANGE_M, self.range_m, self.delay[0])), 0)

    @property
    def window(self) -> int:
        """Bins, an odd number, in which arrivals of a pulse are counted."""
        return 2 * int(np.ceil(WINDOW_SIGMAS * self.shape.width)) + 1


def make_histogram_templates(
    spots: HistogramSpots, shape: PulseShape, arrivals: float, max_range_m: float
) -> HistogramTemplates:
    """Tables up to a range; ``arrivals`` per cycle if a detector collected all laser light."""
    range_m = np.arange(STEP_M, max_range_m, STEP_M)
    weight, path_m = overlap(spots, range_m)
    bins = spots.counts.shape[-1]
    delay = spots.delay(path_m)
    damped = weight[:, None] * np.exp(-EXTINCTIONS_PER_M[:, None] * path_m[:, None])
    fog = [
        arrivals * STEP_M * _spread(each, at, shape, bins)
        for each, at in zip(damped, delay, strict=True)
    ]
    return HistogramTemplates(
        range_m=range_m,
        extinction_per_m=EXTINCTIONS_PER_M,
        target=arrivals * damped / np.pi,
        delay=delay,
        fog=np.array(fog),
        shape=shape,
    )


def _spread(light: Floats, at: Floats, shape: PulseShape, bins: int) -> Floats:
    """Sum light (K, R) of pulses centred at rising bins ``at`` (R,) into bins (K, B).

    Works by blocks of ranges, each only in the bins of its pulses, so that tables stay small.
    """
    total = np.zeros((len(light), bins))
    for start in range(0, len(at), BLOCK):
        block = slice(start, start + BLOCK)
        first, last = at[block].min() + shape.first, at[block].max() + shape.last
        low, high = (int(np.clip(position, 0, bins)) for position in (first, np.ceil(last)))
        edges = np.arange(low, high + 1)
        pulses = np.diff(shape.arrived(edges - at[block, None]), axis=-1)
        total[:, low:high] += light[:, block] @ pulses
    return total


def find_histogram_modes(
    templates: HistogramTemplates, counts: Floats, cycles: int, usable: Mask, scaled: bool
) -> Modes:
    """Modes of histograms (spots, B) of the ``usable`` ones (spots,); see `modes.find_modes`."""
    rate, watched = coates(counts, cycles)
    certain = np.ones_like(rate)
    for _ in range(REFITS):
        fitted = _without_target(templates, rate, certain * watched, cycles)
        certain = _certainty(templates, watched, fitted)
    counts, watched = certain * counts, certain * watched
    peaks = _search(templates, rate, watched, fitted, usable)
    result = _refine(templates, counts, watched, fitted, peaks, scaled)
    return result.joined_with(_empty(templates, counts, watched, fitted, usable))


def _without_target(
    templates: HistogramTemplates, rate: Floats, watched: Floats, cycles: int
) -> Fitted:
    """Backscattering and background (spots, K) without outlying bins; variance (spots, B)."""
    from scipy.ndimage import uniform_filter1d  # slow to import

    smooth = uniform_filter1d(rate, SMOOTH_BINS, axis=-1, mode="nearest")
    variance = (np.maximum(smooth, 0) + 1 / cycles) / np.maximum(watched, 1)
    kept = np.ones((*templates.fog.shape[:2], rate.shape[-1]), bool)
    beta = background = np.zeros(kept.shape[:2])
    for _ in range(3):
        weight = kept / variance[:, None]
        gg = (weight * templates.fog**2).sum(axis=-1) + FREE
        g1, w1 = (weight * templates.fog).sum(axis=-1), weight.sum(axis=-1)
        yg = (weight * templates.fog * rate[:, None]).sum(axis=-1)
        y1 = (weight * rate[:, None]).sum(axis=-1)
        determinant = gg * w1 - g1**2
        beta = np.maximum((yg * w1 - y1 * g1) / determinant, 0)
        background = np.maximum((y1 - beta * g1) / w1, 0.1 / cycles / rate.shape[-1])
        excess = rate[:, None] - beta[..., None] * templates.fog - background[..., None]
        kept = excess < MAX_EXCESS_SIGMAS * np.sqrt(variance[:, None])
    return beta, background, variance


def _certainty(templates: HistogramTemplates, watched: Floats, fitted: Fitted) -> Floats:
    """Fraction (spots, B) of the information of each bin that the error of the fog's echo leaves.

    Of a bin's rate f of fog and b of background, n cycles know the variance (f + b) / n; an error
    of e f, alike in all W bins of a pulse, adds W (e f)^2.
    """
    beta, background, _ = fitted
    fog = beta[..., None] * templates.fog
    near = np.arange(watched.shape[-1]) < templates.nearest - templates.window // 2
    error = np.where(near, NEAR_ERROR, UNEVENNESS) * fog
    ratio = templates.window * error**2 * watched[:, None] / (fog + background[..., None])
    return np.asarray(1 / (1 + ratio)).min(axis=1)


def _search(
    templates: HistogramTemplates, rate: Floats, watched: Floats, fitted: Fitted, usable: Mask
) -> tuple[Indices, ...]:
    """Spot, extinction and bin of peaks above fog and background, by Poisson deviance."""
    from scipy.ndimage import uniform_filter1d  # slow to import

    beta, background, _ = fitted
    model = beta[..., None] * templates.fog + background[..., None]
    window = templates.window
    result = window * uniform_filter1d(watched * rate, window, axis=-1, mode="constant")[:, None]
    expected = window * uniform_filter1d(watched[:, None] * model, window, axis=-1, mode="constant")
    expected = np.maximum(expected, RATES[0])  # running sums have rounding errors
    result = np.maximum(result, expected)
    gain = 2 * (result * np.log(result / expected) - (result - expected))
    inner = gain[..., 1:-1]
    peak = (inner >= gain[..., :-2]) & (inner > gain[..., 2:])
    peak[..., : templates.nearest] = False
    best = np.where(peak, inner, 0.0)
    minimum = np.sort(best, axis=-1)[..., -MAX_PEAKS][..., None]
    kept = (
        (best >= minimum)
        & (best > 1)
        & (best > best.max(axis=-1, keepdims=True) - MAX_EXCESS_MISFIT)
    )
    spot, node, position = np.nonzero(kept & usable[:, None, None])
    return spot, node, position + 1


def _refine(
    templates: HistogramTemplates,
    counts: Floats,
    watched: Floats,
    fitted: Fitted,
    peaks: tuple[Indices, ...],
    scaled: bool,
) -> Modes:
    spot, node, position = peaks
    beta, background = fitted[0][spot, node], fitted[1][spot, node]
    seen, cycles, fog = counts[spot], watched[spot], templates.fog[spot, node]
    centres = np.arange(counts.shape[-1]) + 0.5
    edges = np.arange(counts.shape[-1] + 1)
    shape, width = templates.shape, templates.shape.width
    step = templates.range_m[1] - templates.range_m[0]
    # Range per bin of delay, constant except next to the instrument.
    metres = np.gradient(templates.range_m, templates.delay[0])[-1]
    at = np.array(
        [np.interp(p + 0.5, templates.delay[s], templates.range_m)
         for p, s in zip(position, spot, strict=True)]
    )  # fmt: skip
    max_range_m = templates.range_m[-2]
    rho = np.zeros(len(spot))
    for number in range(STEPS + 1):
        row = np.clip(at / step - 1, 0, templates.range_m.size - 2)
        low = row.astype(int)
        fraction = row - low
        strength = _mixed(templates.target[spot, node], low, fraction)
        delay = _mixed(templates.delay[spot], low, fraction)
        towards, since = edges - delay[:, None], centres - delay[:, None]
        whole, before = np.diff(shape.arrived(towards), axis=-1), 1 - shape.arrived(since)
        a, g = strength[:, None] * whole, fog * before
        if number == 0:
            top = _at(seen / np.maximum(cycles, 1) - beta[:, None] * g, position) - background
            rho = np.maximum(top / np.maximum(_at(a, position), 1e-12), 1e-6)
        rate = np.clip(rho[:, None] * a + beta[:, None] * g + background[:, None], *RATES)
        moved = -np.diff(shape.density(towards), axis=-1)  # of the pulse, per bin of delay
        nearer = fog * shape.density(since)
        along = rho[:, None] * strength[:, None] * moved + beta[:, None] * nearer
        jacobian = np.stack([along / metres, a, g, np.ones_like(a)], axis=-1)
        excess = seen / -np.expm1(-rate) - cycles
        information = jacobian.swapaxes(1, 2) @ (jacobian * (cycles / np.expm1(rate))[..., None])
        gradient = (jacobian.swapaxes(1, 2) @ excess[..., None])[..., 0]
        regular = information.copy()
        regular[:, 2, 2] += FREE
        if number == STEPS:
            break
        move = solved(regular, gradient)
        at = np.clip(at + np.clip(move[:, 0], -width * metres, width * metres), step, max_range_m)
        rho = np.clip(rho + move[:, 1], rho / 3, 3 * rho + 1e-9)
        beta = np.maximum(beta + move[:, 2], 0.2 * beta)
        background = np.maximum(background + move[:, 3], 0.2 * background)
    likelihood = (seen * np.log(-np.expm1(-rate)) - (cycles - seen) * rate).sum(axis=-1)
    free = [0, 1, 3]
    inner, cross = information[:, free][:, :, free], information[:, free, 2]
    across = solved(inner, cross)
    log_weight = likelihood - np.linalg.slogdet(inner)[1] / 2 + 1.5 * np.log(2 * np.pi)
    if scaled:
        log_weight += even_log_prior(rho)
    strength = rho / np.sqrt(inverse(regular)[:, 1, 1])
    result = Modes(
        spot=spot,
        node=node,
        range_m=at,
        backscatter=beta,
        log_weight=log_weight,
        slope=gradient[:, 2] - (across * gradient[:, free]).sum(axis=1),
        curvature=information[:, 2, 2] - (across * cross).sum(axis=1),
        drift=-across[:, 0],
        variance_m2=inverse(inner)[:, 0, 0],
        strength=strength,
        signal=rho * a.sum(axis=-1),
        misfit=((seen - cycles * -np.expm1(-rate)) ** 2 / np.maximum(cycles * rate, 1e-12)).sum(-1),
    )
    return result.only((strength > MIN_STRENGTH) & (at > MIN_RANGE_M) & (at < max_range_m))


def _empty(
    templates: HistogramTemplates, counts: Floats, watched: Floats, fitted: Fitted, usable: Mask
) -> Modes:
    """Modes of fog and background alone."""
    beta, background, _ = fitted
    spot, node = np.nonzero(np.repeat(usable[:, None], beta.shape[1], axis=1))
    fog, seen, cycles = templates.fog[spot, node], counts[spot], watched[spot]
    at, steady = beta[spot, node], background[spot, node]
    for number in range(STEPS + 1):
        rate = np.clip(at[:, None] * fog + steady[:, None], *RATES)
        jacobian = np.stack([fog, np.ones_like(fog)], axis=-1)
        excess = seen / -np.expm1(-rate) - cycles
        information = jacobian.swapaxes(1, 2) @ (jacobian * (cycles / np.expm1(rate))[..., None])
        gradient = (jacobian.swapaxes(1, 2) @ excess[..., None])[..., 0]
        if number == STEPS:
            break
        regular = information.copy()
        regular[:, 0, 0] += FREE
        move = solved(regular, gradient)
        at = np.maximum(at + move[:, 0], 0.2 * at)
        steady = np.maximum(steady + move[:, 1], 0.2 * steady)
    likelihood = (seen * np.log(-np.expm1(-rate)) - (cycles - seen) * rate).sum(axis=-1)
    shape = information[:, 0, 1] / information[:, 1, 1]
    room = np.log(EMPTY * templates.range_m[-1]) + np.log(2 * np.pi) / 2
    log_weight = likelihood - np.log(information[:, 1, 1]) / 2 + room
    slope = gradient[:, 0] - shape * gradient[:, 1]
    curvature = information[:, 0, 0] - shape * information[:, 0, 1]
    return Modes.of_fog(spot, node, at, log_weight, slope, curvature, misfit=np.zeros(len(spot)))


def _mixed(table: Floats, low: Indices, fraction: Floats) -> Floats:
    """Interpolate rows (C, R) at fractional indices, (C,)."""
    here, there = _at(table, low), _at(table, low + 1)
    return here + fraction * (there - here)


def _at(rows: Floats, position: Indices) -> Floats:
    return np.take_along_axis(rows, position[:, None], axis=1)[:, 0]
