"""Noise and conversion: from mean electrons to what the ADC reports."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spisim.instrument.parts import Detector

Floats = NDArray[np.float64]

LARGE_MEAN = 1e12
"""Electrons above which the normal distribution stands for Poisson's, whose skewness is 1e-6."""


class Readings(NamedTuple):
    """Counts (frames, ...) of one detector channel."""

    counts: NDArray[Any]
    saturated: NDArray[np.bool_]  # clipped at either end of the converter's range
    noise_electrons: float  # rms of amplifier and converter, per reading; nan if there is none


def read_out(
    mean_electrons: Floats,
    detector: Detector,
    window_s: float,
    rng: np.random.Generator,
) -> Readings:
    """Draw one recording of the mean charges (frames, ...).

    Signal, daylight and dark current arrive as one Poisson process; the amplifier adds Gaussian
    charge noise, white over the window; the converter rounds and clips.
    """
    amplifier = detector.amplifier_noise_electrons(window_s)
    electrons = _arrivals(mean_electrons, rng)
    electrons += rng.normal(0, amplifier, electrons.shape)
    adc = detector.adc
    counts = np.rint(electrons / adc.electrons_per_count + adc.offset_counts)
    return Readings(
        counts=np.clip(counts, 0, adc.max_count).astype(np.int32),
        saturated=(counts <= 0) | (counts >= adc.max_count),
        noise_electrons=float(np.hypot(amplifier, adc.quantisation_noise_electrons)),
    )


def _arrivals(mean: Floats, rng: np.random.Generator) -> Floats:
    """Poisson numbers; NumPy has none of a mean near 2^63."""
    large = mean > LARGE_MEAN
    drawn = rng.poisson(np.where(large, 0, mean)).astype(np.float64)
    drawn[large] = rng.normal(mean[large], np.sqrt(mean[large]))
    return drawn


def expected_readings(mean_electrons: Floats, detector: Detector) -> Readings:
    """What an ideal instrument would report: no noise, no steps, no end of range.

    Its noise is marked unknown, so that reconstruction takes every reading at its word.
    """
    adc = detector.adc
    counts = mean_electrons / adc.electrons_per_count + adc.offset_counts
    return Readings(counts, np.zeros(counts.shape, dtype=np.bool_), np.nan)
