"""Chances of a time stamp per bin and cycle: first photons, and crossings of a threshold."""

from __future__ import annotations

import math

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c, elementary_charge
from scipy.interpolate import CubicSpline
from scipy.ndimage import gaussian_filter1d
from scipy.special import ndtr

from spisim.instrument import DirectTof, Spad

Floats = NDArray[np.float64]

#: Iterations for the after-pulses, which shrink by their probability every time.
ROUNDS = 20


def tcspc_arrivals(
    tof: DirectTof, path_m: Floats, echo_per_s: Floats, steady_per_s: float
) -> Floats:
    """Chance (bins,) that the first detection of a cycle falls into each bin of the gate.

    `echo_per_s` (path bins,) is the rate while the laser is on. Detections are Poisson with mean
    λ_i per bin, and the first one ends the cycle: p_i = exp(-Σ_{j<i} λ_j) (1 - exp(-λ_i)) (Coates,
    J. Phys. E 1, 878 (1968)). After-pulses of a cycle's detection spread evenly over the next gate.
    """
    sensor = tof.detector.sensor
    assert isinstance(sensor, Spad)
    edges: Floats = np.arange(tof.bins + 1, dtype=np.float64) * tof.bin_width_s
    times, density = _smoothed(path_m, echo_per_s, tof.response_sigma_s)
    collected = CubicSpline(times, density).antiderivative()
    per_pulse = tof.pulse_sigma_s * math.sqrt(2 * math.pi)  # light of peak one, times seconds
    inside = np.clip(edges, times[0], times[-1])
    echo = np.maximum(np.diff(collected(inside)), 0) * per_pulse
    primary = echo + steady_per_s * tof.bin_width_s
    mean = primary
    for _ in range(ROUNDS):
        detected = -math.expm1(-mean.sum())
        mean = primary + sensor.afterpulse_probability * detected / tof.bins
    before = np.concatenate([[0.0], np.cumsum(mean)[:-1]])
    return np.asarray(np.exp(-before) * -np.expm1(-mean))


def threshold_arrivals(
    tof: DirectTof, path_m: Floats, echo_per_s: Floats, steady_per_s: float
) -> Floats:
    """Chance (bins,) that a cycle's first time stamp falls into each bin of the gate.

    The stamp is the middle between the crossings of the first rising and falling edge. Its scatter
    is that of the noise over the slope at either edge, taken as independent: noise current of
    amplifier and shot noise in the amplifier's bandwidth B. False alarms come at the rate of
    Rice (Bell Syst. Tech. J. 24, 46 (1945)), B/√3 exp(-threshold² / 2 noise²). Breaks for echoes so
    close together that the current does not fall below the threshold in between: they stamp as one.
    """
    amplifier, sensor = tof.detector.amplifier, tof.detector.sensor
    assert amplifier is not None
    assert amplifier.bandwidth_hz is not None
    assert tof.threshold_sigma is not None
    bandwidth = amplifier.bandwidth_hz
    sigma_s = tof.amplified_sigma_s
    step = min(tof.bin_width_s, sigma_s / 20)
    times = np.arange(0.0, tof.gate_s, step)
    # The amplifier keeps the charge of a pulse and lowers its peak.
    density = CubicSpline(*_smoothed(path_m, echo_per_s, sigma_s), extrapolate=False)(times)
    density = np.maximum(np.nan_to_num(density), 0)
    current = density * tof.pulse_sigma_s * math.sqrt(2 * math.pi)
    noise_at = np.sqrt(
        (amplifier.noise_pa_per_sqrt_hz * 1e-12 / (elementary_charge * sensor.gain)) ** 2
        + 2 * sensor.excess_noise_factor * (steady_per_s + current)
    ) * math.sqrt(bandwidth)
    threshold = tof.threshold_sigma * noise_at[0]
    edges: Floats = np.arange(tof.bins + 1, dtype=np.float64) * tof.bin_width_s
    chances = np.zeros(tof.bins)
    false_alarms = bandwidth / math.sqrt(3) * math.exp(-(tof.threshold_sigma**2) / 2)
    quiet = np.exp(-false_alarms * edges)
    left = 1.0
    for start, stop in _above(current, threshold):
        peak = start + int(np.argmax(current[start : stop + 1]))
        seen = float(ndtr((current[peak] - threshold) / noise_at[peak]))
        middle, scatter = _middle(times, current, noise_at, threshold, start, stop)
        place = np.diff(ndtr((edges - middle) / scatter))
        survives = math.exp(-false_alarms * middle)
        chances += left * seen * survives * place
        left *= 1 - seen
        if left < 1e-9:
            break
    after = 1.0 - np.concatenate([[0.0], np.cumsum(chances)])[:-1]
    return np.asarray(chances + after * -np.diff(quiet))


def _above(current: Floats, threshold: float) -> list[tuple[int, int]]:
    """Index ranges (first, last) above the threshold, or the highest point alone."""
    above = np.concatenate([[False], current > threshold, [False]])
    turns = np.flatnonzero(above[1:] != above[:-1])
    if not turns.size:
        peak = int(np.argmax(current))
        return [(peak, peak)] if current[peak] > 0 else []
    return [(int(first), int(last) - 1) for first, last in turns.reshape(-1, 2)]


def _middle(
    times: Floats, current: Floats, noise_at: Floats, threshold: float, start: int, stop: int
) -> tuple[float, float]:
    """Middle between two crossings and its standard deviation."""
    moments, variances = [], []
    for inside, outside in ((start, start - 1), (stop, stop + 1)):
        outside = min(max(outside, 0), len(times) - 1)
        slope = (current[inside] - current[outside]) / (times[inside] - times[outside] or np.inf)
        steepest = max(abs(slope), 1e-300)
        fraction = (current[inside] - threshold) / (current[inside] - current[outside] or np.inf)
        crossing = times[inside] + (times[outside] - times[inside]) * min(max(fraction, 0), 1)
        moments.append(crossing)
        variances.append((noise_at[inside] / steepest) ** 2)
    width = max(times[stop] - times[start], times[1] - times[0])
    scatter = min(math.sqrt(sum(variances)) / 2, width)
    return sum(moments) / 2, scatter


def _smoothed(path_m: Floats, rate: Floats, sigma_s: float) -> tuple[Floats, Floats]:
    """Times, and at them the echo to a Gaussian pulse of unit area that is centred on zero."""
    step = (path_m[1] - path_m[0]) / c
    margin = math.ceil(6 * sigma_s / step)
    padded = np.concatenate([np.zeros(margin), rate, np.zeros(margin)])
    smooth = gaussian_filter1d(padded, sigma_s / step, truncate=6.0, mode="constant")
    times = (np.arange(padded.size) - margin) * step + path_m[0] / c
    return times, smooth / step
