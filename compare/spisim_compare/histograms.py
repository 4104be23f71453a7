"""Histograms of the spots as vectors, and how echoes and steady light change them."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.constants import c
from reconstruction.capture import Spots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.ranging import FogOptics
from reconstruction.ranging.histogram import coates

from .charges import FogChange
from .patterns import Mean

MIN_COUNTS = 25.0
"""Minimum counts of both captures together in a group of bins: enough for a normal distribution."""
PULSE_SIGMAS = 4.0
"""Half width of the target's echo in rms widths of the pulse."""
BINS_WIDE = 2.0
"""Rms width of a pulse of unknown width, in bins."""
STEADY_QUANTILE = 0.25


class HistogramModel:
    """Arrivals per cycle in groups of bins, half way between two captures.

    Arrivals are corrected for pile-up. Neighbouring bins of few counts are joined, as of both
    captures together, so that the groups do not depend on the difference.
    """

    def __init__(self, real: HistogramSpots, simulated: HistogramSpots) -> None:
        self._own = simulated
        counts = [each.counts.sum(axis=0, dtype=np.float64) for each in (real, simulated)]
        cycles = [each.pulses * len(each.counts) for each in (real, simulated)]
        self._sum, self._cycles = counts[0] + counts[1], cycles[0] + cycles[1]
        groups = [joined_bins(each) for each in self._sum]
        self._group = groups
        self.spot = np.repeat(np.arange(len(groups)), [group.max() + 1 for group in groups])
        pooled, _ = coates(self._sum, self._cycles)
        self._rate = pooled
        self.value = self._joined(pooled)
        good = [not any(each) for each in zip(*real.saturated, *simulated.saturated, strict=True)]
        self.usable = np.concatenate(
            [np.full(group.max() + 1, ok) for group, ok in zip(groups, good, strict=True)]
        )
        self.means: tuple[Mean, Mean] = tuple(  # type: ignore[assignment]
            self._mean(each, number, len(spots.counts))
            for each, number, spots in zip(counts, cycles, (real, simulated), strict=True)
        )
        self.variance = self.means[0].variance + self.means[1].variance
        self.names = names_of_bins(groups)

    def _mean(self, counts: Floats, cycles: int, frames: int) -> Mean:
        rate, watched = coates(counts, cycles)
        variance = self._joined(self._rate / np.maximum(watched, 1))
        variance = np.maximum(variance, 1 / cycles**2)  # of one arrival
        value = self._joined(rate)
        unknown = np.full(value.shape, np.nan)
        return Mean(value, variance, self.usable, np.full(value.shape, frames), unknown)

    def _joined(self, bins: Floats) -> Floats:
        """Sums (n,) over the groups of all spots, of values per bin (S, B)."""
        sums = [np.bincount(g, each) for g, each in zip(self._group, bins, strict=True)]
        return np.concatenate(sums)

    def _per_spot(self, bins: Floats) -> Floats:
        """Values per bin (S, B) as columns (n, S), each of one spot."""
        only = np.eye(len(bins))[:, :, None] * bins[None]
        return np.column_stack([self._joined(each) for each in only])

    @property
    def steady(self) -> Floats:
        """Change (n,) of the arrivals by the same steady light on all spots."""
        return self._joined(np.ones_like(self._rate))

    @property
    def steady_of_spots(self) -> Floats:
        """Steady light (n, S) of each spot."""
        return self._per_spot(self._steady_bins)

    @property
    def echo(self) -> Floats:
        """Arrivals (n,) of the echoes alone."""
        return self._joined(self._echo_bins)

    @property
    def echo_of_spots(self) -> Floats:
        """Arrivals of the echoes as columns (n, S), each of one spot."""
        return self._per_spot(self._echo_bins)

    @property
    def echo_unsure(self) -> Floats:
        """Standard deviation of ``echo`` as columns (n, 0): steady light is known."""
        return np.zeros((self.value.size, 0))

    @property
    def elsewhere(self) -> Floats:
        """Changes (n, columns) of a spot that meets something else: another echo, other light."""
        echo = np.abs(self._joined(self._echo_bins))
        strong = np.flatnonzero(echo > PULSE_SIGMAS * np.sqrt(self.variance))
        columns = np.zeros((echo.size, strong.size))
        columns[strong, np.arange(strong.size)] = echo[strong]
        return np.hstack([columns, self.steady_of_spots])

    @property
    def between(self) -> Spots:
        """A frame of the counts of both captures."""
        return replace(
            self._own,
            counts=self._sum[None],
            saturated=~np.ones((1, len(self._sum)), bool),
            pulses=self._cycles,
            laser_energy_j=self._own.laser_energy_j * self._cycles / self._own.pulses,
        )

    @property
    def _steady_bins(self) -> Floats:
        """Arrivals of steady light (S, B): a low quantile of means over neighbouring bins."""
        smooth = _smoothed(self._rate)
        lowest = np.quantile(smooth, STEADY_QUANTILE, axis=1, keepdims=True)
        return np.broadcast_to(lowest, self._rate.shape)

    @property
    def _echo_bins(self) -> Floats:
        """Arrivals of the echoes (S, B)."""
        return np.asarray(self._rate - self._steady_bins)

    def fog(self, range_m: Floats, fog: FogOptics | None) -> FogChange | None:
        """Change of arrivals (n,) by more fog; None if no range or fog is known."""
        if fog is None or not np.isfinite(range_m).any() or not fog.extinction_per_m > 0:
            return None
        own = self._own
        centre_s = own.start_s + (np.arange(self._rate.shape[1]) + 0.5) * own.bin_width_s
        path_m = np.maximum(c * (centre_s - own.delay_offset_s), 0.0)
        width_s = own.response_sigma_s
        if np.isnan(width_s):
            width_s = BINS_WIDE * own.bin_width_s
        points = np.nan_to_num(range_m)[:, None] * own.directions
        target_m = range_m + np.linalg.norm(points - own.detector_positions_m, axis=1)
        before = path_m[None] < target_m[:, None] - PULSE_SIGMAS * c * width_s
        echo = self._echo_bins
        return FogChange(
            damped=self._joined(-path_m * echo),
            backscattered=self._joined(np.where(before, echo, 0.0)) / fog.extinction_per_m,
            extinction_per_m=fog.extinction_per_m,
        )


def joined_bins(counts: Floats) -> NDArray[np.intp]:
    """Number of the group of each bin (B,), in order, each with enough counts."""
    group, number, so_far = np.zeros(counts.size, np.intp), 0, 0.0
    for k, each in enumerate(counts):
        if so_far >= MIN_COUNTS:
            number, so_far = number + 1, 0.0
        group[k] = number
        so_far += float(each)
    if number and so_far < MIN_COUNTS:
        group[group == number] = number - 1
    return group


def names_of_bins(groups: Sequence[NDArray[np.intp]]) -> list[str]:
    """Names of the groups of bins of all spots."""
    names = []
    for spot, group in enumerate(groups):
        for number in range(group.max() + 1):
            first, *_, last = np.repeat(np.flatnonzero(group == number), 2).tolist()
            bins = f"bin {first}" if first == last else f"bins {first}–{last}"
            names.append(f"spot {spot}, {bins}")
    return names


def _smoothed(rate: Floats) -> Floats:
    width = max(rate.shape[1] // 16, 1)
    kernel = np.ones(width) / width
    return np.array([np.convolve(each, kernel, mode="valid") for each in rate])
