"""A Gaussian pulse on a constant background in a histogram of first arrivals, by likelihood.

Of the n cycles that have had no arrival before a bin, those with one in it are binomial with
probability 1 - exp(-lambda), lambda the mean number of arrivals in the bin per cycle. Solved for
lambda that is the correction of P. B. Coates, J. Phys. E 1, 878 (1968). The likelihood of a whole
histogram is the product of these binomials, pile-up included; its Fisher information about
parameters theta is sum_i n_i / (exp(lambda_i) - 1) (d lambda_i / d theta)^2.
"""

from dataclasses import dataclass

import numpy as np
from scipy.special import ndtr

from ..base.arrays import Floats

BLOCKS = 16
"""Parts of a histogram whose median is the first guess of its background."""
MAX_WIDTHS = 6.0
"""Bins within so many widths of the pulse tell about it and its background."""
MAX_STEPS = 50
"""Most steps of Fisher scoring."""


@dataclass(frozen=True, eq=False)
class Pulses:
    """Pulses found, each (...,): times and widths in bins, arrivals per cycle.

    ``delay`` of the centre from the first bin's lower edge; standard deviations from the Fisher
    information, the Cramer-Rao bound.
    """

    delay: Floats
    delay_sigma: Floats
    width: Floats
    arrivals: Floats
    arrivals_sigma: Floats
    background: Floats


def coates(counts: Floats, cycles: int) -> tuple[Floats, Floats]:
    """Mean arrivals per bin and cycle of histograms (..., B), and the cycles that saw each bin."""
    watched = cycles - np.cumsum(counts, axis=-1) + counts
    left = np.maximum(watched - counts, 0.5)  # where every cycle had its arrival, none is left
    return np.log(np.maximum(watched, left) / left), watched


def find_pulses(counts: Floats, cycles: int, width: float | None) -> Pulses:
    """The strongest pulse of each histogram (T, B); ``width`` rms in bins, fitted where None.

    Where the matched filter is largest, delay, arrivals, background, and the width if need be, are
    refined together by Fisher scoring. The background is that around the pulse; where it falls
    steeply there, as the echo of near fog does, the pulse appears nearer than it is.
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
        # A pulse within one bin says nothing of its place there: this keeps the step finite.
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
    # Even one arrival tells the delay as well as pulse and bin are wide.
    delay_sigma = np.minimum(np.sqrt(variance[:, 0]), np.sqrt(widths**2 + 1 / 12))
    return Pulses(delay, delay_sigma, widths, arrivals, np.sqrt(variance[:, 1]), background)


def _matched(rate: Floats, width: float | None) -> list[Floats]:
    """Delay, arrivals, background and width where a filter like the pulse answers most, (T,)."""
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
    """Gradient (T, 4) of the log likelihood by delay, arrivals, background, width; information."""
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
    """Inverse of matrices (T, P, P), finite even where a histogram tells nothing of a parameter."""
    scale = np.sqrt(np.diagonal(information, axis1=1, axis2=2)) + 1e-9
    both = scale[:, :, None] * scale[:, None, :]
    return np.asarray(np.linalg.inv(information / both + 1e-9 * np.eye(scale.shape[-1])) / both)
