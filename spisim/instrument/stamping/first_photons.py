"""Time stamps of first photons: time-correlated single-photon counting."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import Any, ClassVar

import numpy as np
from scipy.constants import c
from scipy.interpolate import CubicSpline

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument.sensor import PulseTiming, Reading
from spisim.instrument.stamping import smoothed

#: Integration points of an echo's shape, and the sigmas that they span.
ECHO_POINTS, ECHO_SIGMAS = 65, 5.0
#: Detections per dead time, or per gate, above which counts pile up.
PILE_UP = 0.05


@dataclass(frozen=True)
class FirstPhotons:
    """The first detection in a gate ends its cycle; after-pulses spread over the next gate."""

    piles_up: ClassVar[bool] = True

    tof: PulseTiming
    jitter_sigma_s: float
    dead_time_s: float
    afterpulse_probability: float

    @property
    def response_sigma_s(self) -> float:
        if self.tof.response is not None:
            return self.tof.response.as_gaussian(self.tof.bin_width_s)[1]
        return math.hypot(self.tof.pulse_sigma_s, self.jitter_sigma_s)

    @property
    def delay_offset_s(self) -> float:
        """Delay of the Gaussian that fits the response, as a rig calibrates it."""
        if self.tof.response is None:
            return 0.0
        return self.tof.response.as_gaussian(self.tof.bin_width_s)[0]

    @property
    def reading(self) -> Reading:
        """All time stamps within the width of the response."""
        widths_s = np.sqrt(2 * np.pi) * self.tof.pulses * np.array([self.response_sigma_s, 1.0])
        echo_s = widths_s[1] * self.tof.pulse_sigma_s
        return Reading("echo", widths_s[0], echo_s, 0.0, converted=False)

    def check(self) -> None:
        """Raise InputError for a threshold, or jitter beside a response that holds it."""
        if self.tof.threshold_sigma is not None:
            sensor = self.tof.detector.sensor
            raise InputError(f"a {sensor.type} sensor has no threshold_sigma for dtof")
        if self.tof.response is not None and self.jitter_sigma_s > 0:
            raise InputError("detector.sensor.jitter_fwhm_s should be 0: response holds the jitter")

    def chances(self, path_m: Floats, echo_per_s: Floats, steady_per_s: float) -> Floats:
        """Probability (bins,) that the first detection of a cycle falls into each bin of the gate.

        Of one diode: detections are Poisson with mean λ_i per bin, and the first ends the cycle:
        p_i = exp(-Σ_{j<i} λ_j) (1 - exp(-λ_i)) (Coates, J. Phys. E 1, 878 (1968)), as long as no
        carrier from the last cycle, released evenly over the gate, has been first.
        """
        tof = self.tof
        edges: Floats = np.arange(tof.bins + 1, dtype=np.float64) * tof.bin_width_s
        pulse = self.response_sigma_s if tof.response is None else tof.response
        times, density = smoothed(path_m, echo_per_s, pulse, tof.gate_s)
        collected = CubicSpline(times, density).antiderivative()
        per_pulse = tof.pulse_sigma_s * math.sqrt(2 * math.pi)  # light of peak one, times seconds
        inside = np.clip(edges, times[0], times[-1])
        echo = np.maximum(np.diff(collected(inside)), 0) * per_pulse
        mean = echo + steady_per_s * tof.bin_width_s
        before = np.cumsum(mean) - mean
        released = self._released(mean.sum()) / tof.bins
        left = 1 - released * np.arange(1, tof.bins + 1)
        return np.asarray(np.exp(-before) * (released - left * np.expm1(-mean)))

    def _released(self, mean: Any) -> Any:
        """Fraction of gates with a carrier trapped in the last, for a mean of primary photons.

        A cycle detects nothing with the probability exp(-mean) (1 - this).
        """
        p = self.afterpulse_probability
        return p * -np.expm1(-mean) / (1 - p * np.exp(-mean))

    def sigma_s(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Cramér-Rao bound (...) of the delay of a Gaussian echo among first detections.

        Detections come at the rate λ(t) = b + n g(t), and the first ends the cycle. The information
        of N cycles is N ∫ exp(-∫λ) λ'² / λ dt: a live cycle is a Bernoulli trial at every instant.
        Without background or pile-up the bound is σ_t² over the detections. Amplitude and
        background count as known, which costs nothing as they are even about the echo's centre. A
        bin adds 1/12 of its squared width to σ_t². After-pulses are uniform background.
        """
        tof = self.tof
        sigma = np.hypot(self.response_sigma_s, tof.bin_width_s / np.sqrt(12))
        delay = path_m / c
        per_pulse = echo_per_s * tof.pulse_sigma_s * np.sqrt(2 * np.pi)
        rate = steady_per_s + self._released(steady_per_s * tof.gate_s + per_pulse) / tof.gate_s
        x = np.linspace(-ECHO_SIGMAS, ECHO_SIGMAS, ECHO_POINTS)  # time in sigmas, along a last axis
        shape = np.exp(-(x**2) / 2) / np.sqrt(2 * np.pi)
        echo = per_pulse[..., None] * shape
        steady = rate[..., None] * sigma
        step = x[1] - x[0]
        since_gate = rate[..., None] * np.maximum(delay[..., None] + x * sigma, 0)
        before = np.exp(-since_gate - np.cumsum(echo, axis=-1) * step)
        information = np.sum(before * (x * echo) ** 2 / (steady + echo), axis=-1) * step
        return np.asarray(sigma / np.sqrt(tof.pulses * tof.diodes * information))

    def warnings(self, steady_per_s: float) -> list[str]:
        """A warning about light on one diode that fires the detector before the echo does."""
        first = steady_per_s * self.tof.gate_s
        if first < PILE_UP:
            return []
        return [
            f"tof.detector fires {first:.2g} times per gate without any echo, which hides later "
            f"arrivals; below {PILE_UP:g} it would not"
        ]
