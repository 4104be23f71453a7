"""Maximum-likelihood fit of a Gaussian pulse on a constant background in a first-arrival histogram.

Of the n cycles without an arrival before a bin, those with one in it are binomial with probability
1 - exp(-lambda), lambda the mean number of arrivals in the bin per cycle. Solved for lambda this is
the correction of P. B. Coates, J. Phys. E 1, 878 (1968). The likelihood of a histogram is the
product of these binomials, pile-up included; its Fisher information about parameters theta is sum_i
n_i / (exp(lambda_i) - 1) (d lambda_i / d theta)^2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from ..base.arrays import Floats

BLOCKS = 16
"""Blocks of a histogram whose median is the initial background."""
MAX_WIDTHS = 6.0
"""Half width of the fitted window, in widths of the pulse."""
MAX_STEPS = 50
"""Maximum number of Fisher scoring steps."""


@dataclass(frozen=True, eq=False)
class Pulses:
    """Fitted pulses, each (...,): times and widths in bins, arrivals per cycle.

    ``delay`` is the centre from the first bin's lower edge; sigmas are the Cramér–Rao bound.
    """

    delay: Floats
    delay_sigma: Floats
    width: Floats
    arrivals: Floats
    arrivals_sigma: Floats
    background: Floats


def coates(counts: Floats, cycles: int) -> tuple[Floats, Floats]:
    """Mean arrivals per bin and cycle of histograms (..., B), and cycles that reach each bin."""
    watched = cycles - np.cumsum(counts, axis=-1) + counts
    left = np.maximum(watched - counts, 0.5)  # every cycle may have ended
    return np.log(np.maximum(watched, left) / left), watched


def find_pulses(counts: Floats, cycles: int, width: float | None) -> Pulses:
    """Fit the strongest pulse of each histogram (T, B); ``width`` rms in bins, fitted if None.

    Starts where the matched filter peaks and refines delay, arrivals, background, and possibly the
    width by Fisher scoring. The background is local; where it falls steeply, as the echo of near
    fog, the pulse appears nearer than it is.
    """
    rate, watched = coates(counts, cycles)
    start = _matched(rate, width)
    bins = counts.shape[-1]
    half_window = min(bins, int(np.ceil(MAX_WIDTHS * start[3].max())) + 2)
    nearest = np.floor(start[0]).astype(int)[:, None] + np.arange(-half_window, half_window + 1)
    inside = (nearest >= 0) & (nearest < bins)
    at = np.clip(nearest, 0, bins - 1)
    seen = np.take_along_axis(counts, at, axis=-1) * inside
    watched = np.take_along_axis(watched, at, axis=-1) * inside
    edges = np.concatenate([nearest, nearest[:, -1:] + 1], axis=-1).astype(np.float64)

    fitted = slice(3 if width is not None else 4)
    minimum = 1e-3 / cycles
    min_width, max_width = (0.1, float(bins)) if width is None else (width, width)
    lowest = np.array([-1.0, minimum, minimum / bins, min_width])
    highest = np.array([bins + 1.0, 50.0, 50.0, max_width])
    theta = np.clip(np.stack(start, axis=-1), lowest, highest)
    for _ in range(MAX_STEPS):
        score, information = _score(theta, edges, seen, watched)
        # A pulse within one bin does not show its position there: this keeps the step finite.
        information[:, 0, 0] += 1 / (theta[:, 3] ** 2 + 1 / 12)
        step = np.zeros_like(theta)
        step[:, fitted] = (_inverse(information[:, fitted, fitted]) @ score[:, fitted, None])[
            ..., 0
        ]
        max_step = theta[:, 3:] * [0.5, np.inf, np.inf, 0.5]
        before = theta
        theta = np.clip(theta + np.clip(step, -max_step, max_step), lowest, highest)
        if (np.abs(theta - before)[:, [0, 3]] < 1e-5 * theta[:, 3:]).all():
            break
    _, information = _score(theta, edges, seen, watched)
    variance = np.diagonal(_inverse(information[:, fitted, fitted]), axis1=1, axis2=2)
    delay, arrivals, background, widths = theta.T
    # A single arrival locates the pulse to the width of pulse and bin.
    delay_sigma = np.minimum(np.sqrt(variance[:, 0]), np.sqrt(widths**2 + 1 / 12))
    return Pulses(delay, delay_sigma, widths, arrivals, np.sqrt(variance[:, 1]), background)


def _matched(rate: Floats, width: float | None) -> list[Floats]:
    """Delay, arrivals, background and width at the peak of the matched filter, (T,)."""
    from scipy.signal import fftconvolve  # slow to import

    bins = rate.shape[-1]
    blocks = np.array_split(rate, min(BLOCKS, bins), axis=-1)
    background = np.median([block.mean(axis=-1) for block in blocks], axis=0)
    widths = [width] if width is not None else np.geomspace(0.5, max(bins / 6, 1), 12)
    result: list[Floats] = []
    best = np.full(len(rate), -np.inf)
    for tried in widths:
        half = min(int(np.ceil(3 * tried)), (bins - 1) // 2)
        edges = np.arange(-half, half + 2) - 0.5
        shape = np.diff(ndtr(edges / tried))
        norm = np.sqrt((shape**2).sum())
        answer = fftconvolve(rate - background[:, None], shape[None] / norm, "same", axes=-1)
        peak = answer.argmax(axis=-1)
        height = np.take_along_axis(answer, peak[:, None], axis=-1)[:, 0]
        candidate = [peak + 0.5, height / norm, background, np.full(len(rate), tried)]
        better = height > best
        best = np.where(better, height, best)
        result = [
            np.where(better, new, old)
            for new, old in zip(candidate, result or candidate, strict=True)
        ]
    return result


def _score(theta: Floats, edges: Floats, seen: Floats, watched: Floats) -> tuple[Floats, Floats]:
    """Gradient (T, 4) and information of delay, arrivals, background and width."""
    delay, arrivals, background, width = theta.T[..., None]
    at = (edges - delay) / width
    density = np.exp(-(at**2) / 2) / np.sqrt(2 * np.pi)
    pulse = np.diff(ndtr(at), axis=-1)
    slopes = np.stack(
        [
            -arrivals / width * np.diff(density, axis=-1),
            pulse,
            np.ones_like(pulse),
            -arrivals / width * np.diff(at * density, axis=-1),
        ],
        axis=1,
    )
    rate = arrivals * pulse + background
    excess = seen / -np.expm1(-rate) - watched
    weight = watched / np.expm1(rate)
    return (slopes @ excess[..., None])[..., 0], (slopes * weight[:, None]) @ slopes.swapaxes(1, 2)


def _inverse(information: Floats) -> Floats:
    """Inverse of matrices (T, P, P), finite even without information about a parameter."""
    scale = np.sqrt(np.diagonal(information, axis1=1, axis2=2)) + 1e-9
    both = scale[:, :, None] * scale[:, None, :]
    return np.asarray(np.linalg.inv(information / both + 1e-9 * np.eye(scale.shape[-1])) / both)
