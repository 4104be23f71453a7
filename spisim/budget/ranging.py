"""How well a range is known, in closed form, by the instrument's own method.

Only the scatter of readings is counted: neither the bias of light that came another way, nor that
of wave forms which are not what the method assumes.
"""

from __future__ import annotations

from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from spisim.budget.link import SpotLink, Target, spot_link
from spisim.budget.noise import (
    cw_reading,
    peak_share,
    reading_of,
    threshold_time_s,
)
from spisim.instrument import CwTof, DirectTof, Instrument, PulsedTof, Spad

Floats = NDArray[np.float64]

NEAREST_M, FARTHEST_M, STEPS = 0.05, 100.0, 400
#: Points over which the shape of an echo is integrated, and how many of its sigmas they span.
ECHO_POINTS, ECHO_SIGMAS = 65, 5.0
#: Iterations for the after-pulses, which shrink by their probability every time.
ROUNDS = 20


def range_sigma_m(instrument: Instrument, target: Target) -> Floats:
    """Standard deviation of the ranges of the four spots, along their rays, (..., 4).

    Infinite where the method has no range: no echo, or beyond what it can tell apart.
    """
    link = spot_link(instrument, target)
    with np.errstate(divide="ignore", invalid="ignore", over="ignore"):
        sigma = path_sigma_m(instrument.tof, link) * link.range_per_path
    beyond = link.path_m > 2 * instrument.tof.unambiguous_range_m
    return np.where(np.isnan(sigma) | beyond, np.inf, sigma)


def longest_range_m(
    instrument: Instrument,
    limit_m: float,
    *,
    reflectance: float | Floats = 0.5,
    illuminance_klx: float | Floats = 0.0,
    extinction_per_m: float = 0.0,
) -> Floats:
    """Largest distance (...) of a target at which all four ranges scatter by less than a limit.

    0 where there is none. Up to 100 m, between 400 distances by interpolation.
    """
    distance = np.geomspace(NEAREST_M, FARTHEST_M, STEPS)
    conditions = np.broadcast_arrays(reflectance, illuminance_klx)
    brightness, daylight = (np.asarray(value, np.float64)[..., None] for value in conditions)
    target = Target(distance, brightness, daylight, extinction_per_m)
    sigma = range_sigma_m(instrument, target).max(axis=-1)  # (..., distances)
    return last_below(distance, sigma, limit_m)


def last_below(distance: Floats, sigma: Floats, limit: float) -> Floats:
    """Largest distance (...) at which sigma (..., distances) is below a limit; 0 if nowhere."""
    holds = sigma <= limit
    last = sigma.shape[-1] - 1 - np.argmax(holds[..., ::-1], axis=-1)
    after = np.minimum(last + 1, sigma.shape[-1] - 1)
    here, there = (
        np.log(np.take_along_axis(sigma, at[..., None], axis=-1)[..., 0]) for at in (last, after)
    )
    with np.errstate(invalid="ignore", divide="ignore"):
        fraction = np.clip(np.nan_to_num((np.log(limit) - here) / (there - here)), 0, 1)
    reach = distance[last] * (distance[after] / distance[last]) ** fraction
    return np.where(holds.any(axis=-1), reach, 0.0)


@singledispatch
def path_sigma_m(tof: Any, link: SpotLink) -> Floats:
    """Standard deviation (..., 4) of the path lengths that a method measures."""
    raise TypeError(f"no such method: {tof!r}")


@path_sigma_m.register
def _(tof: CwTof, link: SpotLink) -> Floats:
    """Four taps: σ_φ = √(v/2) / A (Lange & Seitz, IEEE J. Quantum Electron. 37, 390 (2001)).

    v is the variance of a tap at mean phase, A the amplitude of its signal against phase. Equals
    the paper's Eq. (3) with A_R twice the mean signal of a period. Several frequencies weigh by
    their precision, once their whole periods are told apart, which needs far better than that.
    """
    amplifier, detector = tof.detector.amplifier, tof.detector
    assert amplifier is not None
    precision = np.zeros(np.shape(link.echo_per_s))
    for frequency in tof.modulation.frequencies_hz:
        reading = cw_reading(tof, frequency)
        electronics = detector.electronics_noise_electrons(reading.amplifier_s)
        mean = (link.echo_per_s + link.steady_per_s) * reading.steady_s
        variance = detector.sensor.excess_noise_factor * mean + electronics**2
        contrast = tof.modulation.demodulation_contrast(frequency, amplifier.response)
        amplitude = contrast * link.echo_per_s * reading.echo_s
        phase_sigma = np.sqrt(variance / 2) / amplitude
        precision = precision + (2 * np.pi * frequency / (c * phase_sigma)) ** 2
    return np.asarray(1 / np.sqrt(precision))


@path_sigma_m.register
def _(tof: PulsedTof, link: SpotLink) -> Floats:
    """Windows: L = c T r with r = (S₂ - S₀) / (S₁ + S₂ - 2 S₀), errors propagated to first order.

    var L = (c T)² [F r (1 - r) / s + v ((1 - r)² + r² + (1 - 2r)²) / s²], s being the whole signal
    and v the variance of a window without it. Breaks near both ends, within the rise time.
    """
    detector, reading = tof.detector, reading_of(tof)
    excess = detector.sensor.excess_noise_factor
    signal = link.echo_per_s * reading.echo_s
    electronics = detector.electronics_noise_electrons(reading.amplifier_s)
    other = excess * link.steady_per_s * reading.steady_s + electronics**2
    longest_path = 2 * tof.unambiguous_range_m
    r = link.path_m / longest_path
    shot = excess * r * (1 - r) / signal
    spread = other * ((1 - r) ** 2 + r**2 + (1 - 2 * r) ** 2) / signal**2
    return np.asarray(longest_path * np.sqrt(shot + spread))


@path_sigma_m.register
def _(tof: DirectTof, link: SpotLink) -> Floats:
    if isinstance(tof.detector.sensor, Spad):
        return c * first_photon_sigma_s(tof, link)
    return c * threshold_crossing_sigma_s(tof, link)


def first_photon_sigma_s(tof: DirectTof, link: SpotLink) -> Floats:
    """Cramér-Rao bound (..., 4) of the delay of a Gaussian echo among first detections.

    Detections come at the rate λ(t) = b + n g(t); a cycle whose first one is at t says no more.
    The information of N cycles is N ∫ exp(-∫λ) λ'² / λ dt: an at-risk cycle is a Bernoulli trial in
    every instant. Without background or pile-up it is σ_t² over the detections. Level and
    background are taken as known, which costs nothing as they are even about the echo's centre.
    The width of a bin adds 1/12 of its square to σ_t². After-pulses are background, spread evenly.
    """
    sensor = tof.detector.sensor
    assert isinstance(sensor, Spad)
    sigma = np.hypot(tof.response_sigma_s, tof.bin_width_s / np.sqrt(12))
    delay = link.path_m / c
    per_pulse = link.echo_per_s * tof.pulse_sigma_s * np.sqrt(2 * np.pi)
    rate = link.steady_per_s
    for _ in range(ROUNDS):
        detected = -np.expm1(-(rate * tof.gate_s + per_pulse))
        rate = link.steady_per_s + sensor.afterpulse_probability * detected / tof.gate_s
    x = np.linspace(-ECHO_SIGMAS, ECHO_SIGMAS, ECHO_POINTS)  # time in sigmas, along a last axis
    shape = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)
    echo = per_pulse[..., None] * shape
    steady = rate[..., None] * sigma
    step = x[1] - x[0]
    since_gate = rate[..., None] * np.maximum(delay[..., None] + x * sigma, 0)
    before = np.exp(-since_gate - np.cumsum(echo, axis=-1) * step)
    information = np.sum(before * (x * echo) ** 2 / (steady + echo), axis=-1) * step
    return np.asarray(sigma / np.sqrt(tof.pulses * information))


def threshold_crossing_sigma_s(tof: DirectTof, link: SpotLink) -> Floats:
    """Scatter (..., 4) of the mean of all time stamps of a leading and a falling edge.

    Noise over slope at either crossing of a Gaussian pulse, taken as independent; a bin adds 1/12
    of its square. False alarms come first at the rate of Rice (Bell Syst. Tech. J. 24, 46 (1945)),
    B/√3 exp(-threshold² / 2), and take their cycles away. Infinite below the threshold.
    """
    detector, window_s = tof.detector, threshold_time_s(tof)
    assert tof.threshold_sigma is not None
    excess = detector.sensor.excess_noise_factor
    amplifier = detector.amplifier_noise_electrons(window_s) ** 2
    quiet = excess * link.steady_per_s * window_s + amplifier
    threshold = tof.threshold_sigma * np.sqrt(quiet)
    peak = link.echo_per_s * window_s * peak_share(tof)
    place = np.sqrt(2 * np.log(np.maximum(peak / threshold, 1)))  # of the crossing, in sigmas
    slope = threshold * place / tof.amplified_sigma_s
    stamp = (quiet + excess * threshold) / (2 * slope**2) + tof.bin_width_s**2 / 12
    false_alarms = np.exp(-(tof.threshold_sigma**2) / 2) / (2 * window_s * np.sqrt(3))
    stamps = tof.pulses * np.exp(-false_alarms * link.path_m / c)
    return np.asarray(np.where(place > 0, np.sqrt(stamp / stamps), np.inf))
