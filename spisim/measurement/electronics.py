"""Noise and conversion of charge: from mean electrons to what the ADC reports."""

from __future__ import annotations

import math
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.signal import lfilter

from spisim.instrument import Adc, Amplifier, Detector

Floats = NDArray[np.float64]

LARGE_MEAN = 1e12
"""Electrons above which the normal distribution stands for Poisson's, whose skewness is 1e-6."""


class Readings(NamedTuple):
    """Counts (frames, ...) of one detector channel."""

    counts: NDArray[Any]
    saturated: NDArray[np.bool_]  # clipped at either end of the converter's range


def read_out(
    mean_electrons: Floats,
    detector: Detector,
    amplifier_noise: float | Floats,
    rng: np.random.Generator,
    taken_off: Floats | float = 0.0,
) -> Readings:
    """Draw one recording of the mean charges (frames, ...).

    Signal, daylight and dark current arrive as one Poisson process, which an avalanche makes
    noisier; `taken_off` is what an AC-coupled amplifier does not let through, though it does its
    noise; the amplifier adds Gaussian charge; the converter rounds and clips.
    """
    adc = detector.adc
    assert adc is not None
    electrons = _arrivals(mean_electrons, rng)
    excess = detector.sensor.excess_noise_factor - 1
    if excess > 0:
        electrons += rng.normal(0, np.sqrt(excess * mean_electrons))
    electrons += rng.normal(0, amplifier_noise, electrons.shape) - taken_off
    counts = np.rint(electrons / adc.electrons_per_count + adc.offset_counts)
    return Readings(
        counts=np.clip(counts, 0, adc.max_count).astype(np.int32),
        saturated=(counts <= 0) | (counts >= adc.max_count),
    )


def expected_readings(
    mean_electrons: Floats, adc: Adc, taken_off: Floats | float = 0.0
) -> Readings:
    """What an ideal instrument would report: no noise, no steps, no end of range."""
    counts = (mean_electrons - taken_off) / adc.electrons_per_count + adc.offset_counts
    return Readings(counts, np.zeros(counts.shape, dtype=np.bool_))


def _arrivals(mean: Floats, rng: np.random.Generator) -> Floats:
    """Poisson numbers; NumPy has none of a mean near 2^63."""
    large = mean > LARGE_MEAN
    drawn = rng.poisson(np.where(large, 0, mean)).astype(np.float64)
    drawn[large] = rng.normal(mean[large], np.sqrt(mean[large]))
    return drawn


def slow_part(electrons: Floats, amplifier: Amplifier, period_s: float) -> Floats:
    """What an AC-coupled amplifier takes off successive readings (frames, M).

    A high-pass of one pole, settled on the first frame before the recording starts.
    """
    if amplifier.low_cut_hz is None:
        return np.zeros_like(electrons)
    step = -math.expm1(-2 * math.pi * amplifier.low_cut_hz * period_s)
    level = electrons[0].mean()
    # The level before a reading follows from all readings before it.
    deviations = electrons.ravel() - level
    followed = lfilter([0, step], [1, step - 1], deviations)
    return np.asarray(level + followed).reshape(electrons.shape)


def carried_over(
    time_constants_s: tuple[float, float], exposure_time_s: float, period_s: float
) -> float:
    """Share of a reading that belongs to the pattern before, for two poles one behind the other.

    After a step the poles τ₁, τ₂ lack (τ₁ exp(-t/τ₁) - τ₂ exp(-t/τ₂)) / (τ₁ - τ₂); this is its mean
    over the exposure, the end of the period. Holds while the poles forget within a period.
    """
    slow, fast = sorted(time_constants_s, reverse=True)
    if slow == 0:
        return 0.0
    fast = min(fast, slow * (1 - 1e-6))

    def lacking(constant_s: float) -> float:
        if constant_s == 0:
            return 0.0
        start, stop = period_s - exposure_time_s, period_s
        return constant_s**2 * (math.exp(-start / constant_s) - math.exp(-stop / constant_s))

    return (lacking(slow) - lacking(fast)) / ((slow - fast) * exposure_time_s)


def with_carry_over(readings: Floats, share: float) -> Floats:
    """Readings (frames, M) with a share of their predecessors; before the first comes the last."""
    before = np.roll(readings.ravel(), 1).reshape(readings.shape)
    return np.asarray((1 - share) * readings + share * before)
