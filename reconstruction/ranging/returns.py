"""All pulses of a first-arrival histogram: several surfaces in the field of one detector.

The likelihood is that of `reconstruction.ranging.histogram`. Pulses are added one by one, each
where the score test against the others and the background is largest, for as long as the likelihood
gains more than noise gives anywhere in the histogram. Delays are posterior means under a flat
prior, which for a known shape have the smallest mean squared error of all estimates that follow a
shift (E. J. G. Pitman, Biometrika 30, 391 (1939)); where few photons arrive, the maximum of the
likelihood is worse.
"""

from typing import NamedTuple

import numpy as np
from scipy.special import ndtr, ndtri

from ..base.arrays import Floats
from .histogram import coates
from .ranges import MIN_SIGNAL
from .shape import PulseShape

MAX_RETURNS = 4
"""Maximum number of pulses in a histogram."""
TOGETHER = 2
"""Pulses that may be added at once: a second as strong hides the first in what is background."""
SWEEPS = 6
"""Rounds over the delays, between which amplitudes and background are fitted."""
UPDATES = 8
"""Steps of the amplitudes in a round."""
STEPS = 30
"""Steps of a delay to either side."""
ZOOMS = 6
"""Times that the range of a delay narrows to what its photons leave."""
REACH = 3.0
"""Half width of the range in which a delay moves, in widths of the pulse."""
SETTLED = 0.01
"""Movement of all delays in a round, in widths of the pulse, below which it is the last."""


class Return(NamedTuple):
    """A pulse: delay and its standard deviation in bins, and arrivals per cycle."""

    delay: float
    sigma: float
    arrivals: float


def find_returns(
    counts: Floats, cycles: int, shape: PulseShape, most: int = MAX_RETURNS
) -> tuple[list[Return], float]:
    """Pulses of a histogram (B,), the strongest first, and background arrivals per bin and cycle.

    Parameters
    ----------
    counts : array, (B,)
        Arrivals in each bin.
    cycles : int
        Cycles, each of which contributes at most one arrival.
    shape : PulseShape
        What every pulse looks like.
    most : int
        Maximum number of pulses.
    """
    _, watched = coates(counts, cycles)
    fit = _Fit(counts, watched, shape)
    positions = max(counts.size / (2 * shape.width), 1.0)
    minimum = float(-ndtri(ndtr(-MIN_SIGNAL) / positions)) ** 2 / 2
    rates = np.array([counts.sum() / watched.sum()])
    none = _Pulses(np.zeros(0), np.zeros(0), rates, 0.0)
    none = none._replace(log_likelihood=fit.log_likelihood(rates, fit.parts(none.delays)))
    accepted = tried = none
    while tried.delays.size < most and counts.any():
        more = fit.with_another(tried)
        if more is None:
            break
        tried, added = more, more.delays.size - accepted.delays.size
        if tried.log_likelihood - accepted.log_likelihood >= added * minimum:
            accepted = tried
        elif added >= TOGETHER:
            break
    delays, sigmas, rates, _ = accepted
    order = np.argsort(-rates[1:])
    return [Return(float(delays[k]), float(sigmas[k]), float(rates[1 + k])) for k in order], float(
        rates[0]
    )


class _Pulses(NamedTuple):
    """Fitted delays and sigmas (pulses,), rates (1 + pulses,) of background and pulses."""

    delays: Floats
    sigmas: Floats
    rates: Floats
    log_likelihood: float


class _Fit:
    """Pulses on a background, fitted to one histogram; rates are background, then pulses."""

    def __init__(self, counts: Floats, watched: Floats, shape: PulseShape) -> None:
        self.counts, self.watched, self.shape = counts, watched, shape
        self.bins = np.arange(counts.size, dtype=np.float64)
        self.seen = np.flatnonzero(counts)
        self.phases = np.arange(0, 1, 1 / np.ceil(4 / shape.width)) if shape.width < 4 else [0.0]

    def parts(self, delays: Floats) -> Floats:
        """Fractions (1 + pulses, B) of unit rates: one per bin, and the pulses."""
        parts = np.zeros((1 + delays.size, self.bins.size))
        parts[0] = 1
        for part, delay in zip(parts[1:], delays, strict=True):
            near = self._near(delay, delay)
            part[near] = self.shape.in_bins(delay, self.bins[near])
        return parts

    def _near(self, earliest: float, latest: float) -> slice:
        """Bins that pulses of delays between these reach, at least one."""
        low = int(np.clip(np.floor(earliest + self.shape.first), 0, self.bins.size - 1))
        high = int(np.clip(np.ceil(latest + self.shape.last) + 1, low + 1, self.bins.size))
        return slice(low, high)

    def log_likelihood(self, rates: Floats, parts: Floats) -> float:
        """Logarithm of the likelihood."""
        mean = rates @ parts
        arrived = np.log(-np.expm1(-mean[self.seen])) @ self.counts[self.seen]
        return float(arrived - mean @ (self.watched - self.counts))

    def with_another(self, pulses: _Pulses) -> _Pulses | None:
        """One pulse more, all fitted anew; None where no position is brighter than the others."""
        delay, rate = self._brightest(pulses.rates @ self.parts(pulses.delays))
        if rate <= 0:
            return None
        delays, rates = np.append(pulses.delays, delay), np.append(pulses.rates, rate)
        sigmas = np.zeros(delays.size)
        for _ in range(SWEEPS):
            rates, before = self._fitted(rates, self.parts(delays)), delays.copy()
            for each in range(delays.size):
                delays[each], sigmas[each] = self._moved(each, delays, rates)
            if np.abs(delays - before).max() < SETTLED * self.shape.width:
                break
        parts = self.parts(delays)
        rates = self._fitted(rates, parts)
        return _Pulses(delays, sigmas, rates, self.log_likelihood(rates, parts))

    def _brightest(self, mean: Floats) -> tuple[float, float]:
        """Delay of the largest score of another pulse over its standard deviation, and its rate."""
        excess = self.counts / -np.expm1(-mean) - self.watched
        weight = self.watched / np.expm1(mean)
        low, high = int(np.floor(self.shape.first)), int(np.ceil(self.shape.last)) + 1
        offsets = np.arange(low, high + 1, dtype=np.float64)
        best, least = (-np.inf, 0.0, 0.0), 1e-6 * weight.max() / self.shape.width
        for phase in self.phases:
            shape = self.shape.in_bins(np.asarray(phase), offsets)
            score = _at_each_bin(excess, shape, low)
            information = np.maximum(_at_each_bin(weight, shape**2, low), least)
            strength = score / np.sqrt(information)
            bin_ = int(np.argmax(strength))
            if strength[bin_] > best[0]:
                best = strength[bin_], bin_ + phase, score[bin_] / information[bin_]
        return best[1], best[2]

    def _fitted(self, rates: Floats, parts: Floats) -> Floats:
        """Rates by steps of expectation and maximisation, which stay positive."""
        whole, seen = np.maximum(parts @ self.watched, 1e-9), parts[:, self.seen]
        for _ in range(UPDATES):
            arrived = self.counts[self.seen] / -np.expm1(-(rates @ seen))
            rates = np.maximum(rates * (seen @ arrived) / whole, 1e-12 / self.watched[0])
        return rates

    def _moved(self, pulse: int, delays: Floats, rates: Floats) -> tuple[float, float]:
        """Posterior mean and standard deviation of a pulse's delay, all else fixed."""
        rest = np.delete(rates, 1 + pulse) @ self.parts(np.delete(delays, pulse))
        middle, reach = float(delays[pulse]), REACH * self.shape.width
        for _ in range(ZOOMS):
            step = reach / STEPS
            tried = middle + step * np.arange(-STEPS, STEPS + 1, dtype=np.float64)
            weight = self._posterior(tried, rates[1 + pulse], rest)
            middle = float(weight @ tried)
            sigma = float(np.sqrt(weight @ (tried - middle) ** 2))
            if sigma > step:
                break
            reach = 4 * step
        return middle, float(np.hypot(sigma, step / np.sqrt(12)))

    def _posterior(self, tried: Floats, rate: float, rest: Floats) -> Floats:
        """Probabilities of delays (...) under a flat prior."""
        near = self._near(tried[0], tried[-1])
        mean = rest[near] + rate * self.shape.in_bins(tried, self.bins[near])
        missed = self.watched[near] - self.counts[near]
        seen = np.flatnonzero(self.counts[near])
        logs = np.log(-np.expm1(-mean[:, seen])) @ self.counts[near][seen] - mean @ missed
        weight = np.exp(logs - logs.max())
        return np.asarray(weight / weight.sum())


def _at_each_bin(values: Floats, shape: Floats, first: int) -> Floats:
    """Sum (B,) of values under a shape that starts ``first`` bins after each bin."""
    from scipy.signal import fftconvolve  # slow to import

    padded = np.pad(values, (max(-first, 0), max(first + shape.size - 1, 0)))
    start = max(first, 0)
    whole = fftconvolve(padded, shape[::-1], mode="valid")
    return np.asarray(whole[start : start + values.size])
