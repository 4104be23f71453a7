"""Influence of earlier exposures: AC coupling, and patterns that settle slowly."""

import math
from dataclasses import dataclass

import numpy as np
from numpy.random import Generator

from reconstruction.base.arrays import Floats
from spisim.instrument import Amplifier
from spisim.instrument.flicker import PA, STEPS, flicker_spectrum

MINUTE_S = 60.0


@dataclass(frozen=True, eq=False)
class Memory:
    """State of the electronics after a frame: the slow level, and the last light of each window.

    `level` is what an AC-coupled amplifier would subtract from the next reading. `light` (windows,)
    is the last exposure of the bucket, and of each tap, without carry-over.
    """

    level: float
    light: Floats


def slow_part(
    electrons: Floats, amplifier: Amplifier, period_s: float, level: float | None = None
) -> tuple[Floats, float]:
    """Level that an AC-coupled amplifier subtracts from readings (frames, M), and from the next.

    It is a high-pass of one pole that starts at `level`, by default settled on the first frame.
    """
    if amplifier.low_cut_hz is None:
        return np.zeros_like(electrons), 0.0
    from scipy.signal import lfilter  # slow to import

    step = -math.expm1(-2 * math.pi * amplifier.low_cut_hz * period_s)
    level = electrons[0].mean() if level is None else level
    # The level before a reading follows from all readings before it.
    changes = electrons.ravel() - level
    followed = lfilter([0, step], [1, step - 1], changes)
    taken_off = np.asarray(level + followed).reshape(electrons.shape)
    last = float(taken_off[-1, -1])
    return taken_off, last + step * (float(electrons[-1, -1]) - last)


def drifting_current_a(
    amplifier: Amplifier,
    periods: int,
    period_s: float,
    exposure_time_s: float,
    rng: Generator,
    first: int = 0,
) -> Floats:
    """Input current (periods,) in the exposures at the end of each period: 1/f noise and drift.

    Drift begins `first` periods before; an AC-coupled amplifier takes it off.
    """
    if amplifier.is_steady:
        return np.zeros(periods)
    frequency, variance = flicker_spectrum(amplifier, periods, period_s)
    waves = rng.standard_normal((2, len(frequency))) * np.sqrt(variance)
    current = len(frequency) * np.fft.irfft(np.append(0, waves[0] - 1j * waves[1]))
    step_s = period_s / STEPS
    charge = np.append(0, np.cumsum(current[: STEPS * periods])) * step_s
    edges, ends = np.arange(len(charge)) * step_s, np.arange(1, periods + 1) * period_s
    starts = ends - exposure_time_s
    noise = (np.interp(ends, edges, charge) - np.interp(starts, edges, charge)) / exposure_time_s
    drift_a_per_s = amplifier.drift_pa_per_min * PA / MINUTE_S * (amplifier.low_cut_hz is None)
    return np.asarray(noise + drift_a_per_s * (first * period_s + ends - exposure_time_s / 2))


def carried_over(
    time_constants_s: tuple[float, float], exposure_time_s: float, period_s: float
) -> float:
    """Fraction of a reading that belongs to the pattern before, for two poles in series.

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


def with_carry_over(readings: Floats, fraction: float, last: float | None = None) -> Floats:
    """Readings (frames, M) with a fraction of their predecessors.

    The first follows the `last` one of an earlier recording, by default that of this recording.
    """
    in_turn = np.roll(readings.ravel(), 1)
    if last is not None:
        in_turn[0] = last
    before = in_turn.reshape(readings.shape)
    return np.asarray((1 - fraction) * readings + fraction * before)
