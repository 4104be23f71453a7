"""Readings of a recording as one vector of counts, and what a twin should give in their place."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction import Capture
from reconstruction.base.arrays import Floats, Mask
from reconstruction.capture import Buckets, Spots
from reconstruction.capture.readings.dtof import HistogramSpots
from spisim.simulation.light import LightSequence, Transport
from spisim.simulation.measurement import record_frames
from spisim_compare.charges import names_of_taps
from spisim_compare.histograms import joined_bins, names_of_bins
from spisim_compare.patterns import mean_over_frames, names_of_patterns
from spisim_inverse.fit.twin import Scale, Twin

MIN_VARIANCE = 1.0 / 12
"""Minimum variance of a reading in counts: that of rounding."""


@dataclass(frozen=True, eq=False)
class Expected:
    """Expected counts (n,) of a frame and their variance (n,)."""

    counts: Floats
    variance: Floats


@dataclass(frozen=True, eq=False)
class Readings:
    """Means over the frames of a recording, in counts: of patterns, then of spots.

    Attributes
    ----------
    mean, frames, usable
        Mean (n,) of each reading, of so many frames, and whether it may be used.
    names, group, groups
        Name of each reading, its group (n,), and the groups' names: patterns, and each spot.
    scatter
        Variance (n,) between frames; nan for a single one.
    patterns
        Number of readings of patterns.
    """

    capture: Capture
    mean: Floats
    frames: NDArray[np.intp]
    usable: Mask
    scatter: Floats
    names: list[str]
    group: NDArray[np.intp]
    patterns: int
    bins: Sequence[NDArray[np.intp]]

    @property
    def groups(self) -> list[str]:
        """Names of the groups."""
        return ["patterns", *(f"spot {spot}" for spot in range(int(self.group.max(initial=0))))]

    @classmethod
    def of(cls, capture: Capture) -> Readings:
        """Readings of all frames."""
        parts, plans = [], len(capture.setup.plans)
        names: list[str] = []
        groups = [np.zeros(0, np.intp)]
        bins: Sequence[NDArray[np.intp]] = ()
        if capture.plan.shows_image:
            names += names_of_patterns(capture.setup.plans)
            for turn in range(plans):
                counts = capture.buckets.counts[turn::plans]
                parts.append(_mean(counts, capture.buckets.usable[turn::plans]))
            groups.append(np.zeros(len(names), np.intp))
        patterns, spots = len(names), capture.spots
        if isinstance(spots, HistogramSpots):
            bins = [joined_bins(each) for each in spots.counts.sum(axis=0, dtype=np.float64)]
            joined = np.array([_joined(frame, bins) for frame in spots.counts])
            owner = np.repeat(np.arange(len(bins)), [each.max() + 1 for each in bins])
            parts.append(_mean(joined, ~spots.saturated[:, owner]))
            names += names_of_bins(bins)
            groups.append(owner + 1)
        elif spots is not None:
            flat: Any = spots
            shape = len(flat.taps), -1
            parts.append(_mean(flat.taps.reshape(shape), ~flat.saturated.reshape(shape)))
            names += names_of_taps(flat)
            owner = np.repeat(np.arange(len(flat.directions)), flat.taps.shape[-1])
            groups.append(owner + 1)
        mean, frames, usable, scatter = (np.concatenate(each) for each in zip(*parts, strict=True))
        group = np.concatenate(groups)
        return cls(capture, mean, frames, usable, scatter, names, group, patterns, bins)

    def expected(self, twin: Twin, light: Transport) -> Expected:
        """What the twin should give of this light."""
        if twin.range_offset_m:
            moved_m = light.path_length_m + 2 * twin.range_offset_m
            light = replace(light, path_length_m=moved_m)
        sequence, plans = LightSequence(np.zeros(1), (light,)), len(self.capture.setup.plans)
        made, _ = record_frames(
            twin.scene, twin.instrument, sequence, (), np.random.SeedSequence(0), noise=False,
            frames=plans,
        )  # fmt: skip
        parts = []
        if self.capture.plan.shows_image:
            assert twin.buckets is not None
            noise = self._bucket_noise(twin, made.buckets)
            parts.append(_buckets(replace(made.buckets, noise_electrons=noise), twin.buckets))
        if made.spots is not None:
            parts.append(self._spots(made.spots, twin.spots))
        counts, variance = (np.concatenate(each) for each in zip(*parts, strict=True))
        return Expected(counts, np.maximum(variance, MIN_VARIANCE))

    def _bucket_noise(self, twin: Twin, made: Buckets) -> float:
        """Noise of electronics in electrons, as the recording states it, or the instrument."""
        stated = self.capture.buckets.noise_electrons
        if np.isfinite(stated):
            return stated
        detector = twin.instrument.imaging.detector
        return float(detector.electronics_noise_electrons(made.exposure_time_s))

    def _spots(self, made: Spots, scale: Scale | None) -> tuple[Floats, Floats]:
        if isinstance(made, HistogramSpots):
            counts = _joined(made.counts[0], self.bins)
            return counts, counts * (1 - counts / made.pulses)
        assert scale is not None
        charge: Any = made
        stated: Any = self.capture.spots
        if np.isfinite(stated.noise_electrons).all():
            charge = replace(charge, noise_electrons=stated.noise_electrons)
        electrons = charge.electrons(charge.taps[0])
        return _counts(electrons.ravel(), charge.variance(electrons).ravel(), scale)


def _mean(counts: Floats, usable: Mask) -> tuple[Floats, NDArray[np.intp], Mask, Floats]:
    """Mean, number of frames, use and scatter of counts (frames, n)."""
    mean = mean_over_frames(counts.astype(np.float64), np.ones(counts.shape), usable)
    return mean.value, mean.frames, mean.usable, mean.scatter


def _joined(counts: Floats, bins: Sequence[NDArray[np.intp]]) -> Floats:
    """Counts (n,) of groups of bins, of those of all spots (S, B)."""
    return np.concatenate([np.bincount(g, each) for g, each in zip(bins, counts, strict=True)])


def _buckets(made: Buckets, scale: Scale) -> tuple[Floats, Floats]:
    """Expected counts, and their variance, of all plans (n,)."""
    electrons = made.electrons_per_count * (made.counts - made.offset_counts)
    variance = made.variance
    if made.dead_time_s > 0:  # of what is counted, not of what arrived
        variance = variance / (1 + made.signal * made.dead_time_s / made.exposure_time_s) ** 4
    return _counts(electrons.ravel(), variance.ravel(), scale)


def _counts(electrons: Floats, variance: Floats, scale: Scale) -> tuple[Floats, Floats]:
    per_count = scale.electrons_per_count
    return scale.offset_counts + electrons / per_count, variance / per_count**2
