"""Time stamps of a current that crosses a threshold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from scipy.constants import c, elementary_charge
from scipy.interpolate import CubicSpline
from scipy.special import ndtr

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument.electronics import Amplifier
from spisim.instrument.sensor import PulseTiming, Reading
from spisim.instrument.stamping import smoothed

#: Time above the threshold beyond that of a lone pulse, in its standard deviations, up to which an
#: echo counts as one: by half of it the midpoint may be off.
LONGER = 1.0


@dataclass(frozen=True)
class Threshold:
    """The midpoint between the crossings of the first rising and falling edge.

    What stays above the threshold for longer than a lone pulse of its height is fog, or fog and
    what is behind it, whose midpoint is nobody's: it gets no stamp. Both edges are timed anyway; a
    peak detector is assumed, too.

    The noise is that of the amplifier and shot noise in its bandwidth B. False alarms have the rate
    of Rice (Bell Syst. Tech. J. 24, 46 (1945)), B/√3 exp(-threshold² / 2 noise²).
    """

    piles_up: ClassVar[bool] = False
    dead_time_s: ClassVar[float] = 0.0
    response_sigma_s: ClassVar[float] = math.nan  # varies with the pulse's height
    delay_offset_s: ClassVar[float] = 0.0

    tof: PulseTiming

    @property
    def reading(self) -> Reading:
        """The current of one pulse at its peak, as charge within 1 / 2B."""
        time_s = self.window_s
        return Reading("echo", time_s, time_s * self.peak_fraction, time_s, converted=False)

    @property
    def window_s(self) -> float:
        """Window whose charge is as noisy as a current in the amplifier's bandwidth: 1 / 2B."""
        return 1 / (2 * self.bandwidth_hz)

    @property
    def bandwidth_hz(self) -> float:
        """Bandwidth B of the amplifier."""
        bandwidth_hz = self._amplifier.bandwidth_hz
        assert bandwidth_hz is not None
        return bandwidth_hz

    @property
    def sigma_of_pulse_s(self) -> float:
        """Standard deviation of the pulse behind the amplifier.

        The amplifier counts as a Gaussian filter, 3 dB down at its bandwidth, so that pulses stay
        even; one pole would draw out their tail.
        """
        widening_s = math.sqrt(math.log(2)) / (2 * math.pi * self.bandwidth_hz)
        return math.hypot(self.tof.pulse_sigma_s, widening_s)

    @property
    def peak_fraction(self) -> float:
        """Peak of the pulse behind the amplifier over that before it; the charge is preserved."""
        return self.tof.pulse_sigma_s / self.sigma_of_pulse_s

    def check(self) -> None:
        """Raise InputError without a threshold or a bandwidth, or with what only diodes have."""
        if self.tof.response is not None or self.tof.diodes > 1:
            raise InputError(
                f"a {self.tof.detector.sensor.type} sensor crosses a threshold: response and "
                "diodes are those of a spad sensor"
            )
        if self.tof.threshold_sigma is None:
            raise InputError(
                f"a {self.tof.detector.sensor.type} sensor needs threshold_sigma for dtof"
            )
        if self._amplifier.bandwidth_hz is None:
            raise InputError("detector.amplifier.bandwidth_hz is needed for a threshold")

    def chances(self, path_m: Floats, echo_per_s: Floats, steady_per_s: float) -> Floats:
        """Probability (bins,) that a cycle's first time stamp falls into each bin of the gate.

        The stamp scatters by noise over slope at each edge, taken as independent. Not valid for
        echoes between which the current stays above the threshold: they stamp as one.
        """
        tof, sensor = self.tof, self.tof.detector.sensor
        assert tof.threshold_sigma is not None
        bandwidth = self.bandwidth_hz
        sigma_s = self.sigma_of_pulse_s
        step = min(tof.bin_width_s, sigma_s / 20)
        # The amplifier preserves a pulse's charge and lowers its peak.
        echo = smoothed(path_m, echo_per_s, sigma_s, tof.gate_s)
        # A near echo rises before the pulse's centre has left: only its stamp lies in the gate.
        times = np.arange(min(echo[0][0], 0.0), tof.gate_s, step)
        density = CubicSpline(*echo, extrapolate=False)(times)
        density = np.maximum(np.nan_to_num(density), 0)
        current = density * tof.pulse_sigma_s * math.sqrt(2 * math.pi)
        noise_at = np.sqrt(
            (self._amplifier.noise_pa_per_sqrt_hz * 1e-12 / (elementary_charge * sensor.gain)) ** 2
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
            lone_s = 2 * sigma_s * math.sqrt(2 * math.log(max(current[peak] / threshold, 1)))
            if times[stop] - times[start] > lone_s + LONGER * sigma_s:
                continue
            seen = float(ndtr((current[peak] - threshold) / noise_at[peak]))
            middle, scatter = _middle(times, current, noise_at, threshold, start, stop)
            in_bins = np.diff(ndtr((edges - middle) / scatter))
            survives = math.exp(-false_alarms * middle)
            chances += left * seen * survives * in_bins
            left *= 1 - seen
            if left < 1e-9:
                break
        after = 1.0 - np.concatenate([[0.0], np.cumsum(chances)])[:-1]
        return np.asarray(chances + after * -np.diff(quiet))

    def sigma_s(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Standard deviation (...) of the mean of all time stamps.

        Noise over slope at both crossings of a Gaussian pulse, taken as independent; a bin adds
        1/12 of its square. False alarms consume their cycles. Infinite below the threshold.
        """
        tof, detector, window_s = self.tof, self.tof.detector, self.window_s
        assert tof.threshold_sigma is not None
        excess = detector.sensor.excess_noise_factor
        amplifier = detector.amplifier_noise_electrons(window_s) ** 2
        quiet = excess * steady_per_s * window_s + amplifier
        threshold = tof.threshold_sigma * np.sqrt(quiet)
        peak = echo_per_s * window_s * self.peak_fraction
        # of the crossing, in sigmas
        offset = np.sqrt(2 * np.log(np.maximum(peak / threshold, 1)))
        slope = threshold * offset / self.sigma_of_pulse_s
        stamp = (quiet + excess * threshold) / (2 * slope**2) + tof.bin_width_s**2 / 12
        false_alarms = np.exp(-(tof.threshold_sigma**2) / 2) / (2 * window_s * np.sqrt(3))
        stamps = tof.pulses * np.exp(-false_alarms * path_m / c)
        return np.asarray(np.where(offset > 0, np.sqrt(stamp / stamps), np.inf))

    def warnings(self, steady_per_s: float) -> list[str]:
        """No warnings: time stamps need no converter."""
        return []

    @property
    def _amplifier(self) -> Amplifier:
        amplifier = self.tof.detector.amplifier
        assert amplifier is not None
        return amplifier


def _above(current: Floats, threshold: float) -> list[tuple[int, int]]:
    """Index ranges (first, last) above the threshold, or the maximum alone."""
    above = np.concatenate([[False], current > threshold, [False]])
    turns = np.flatnonzero(above[1:] != above[:-1])
    if not turns.size:
        peak = int(np.argmax(current))
        return [(peak, peak)] if current[peak] > 0 else []
    return [(int(first), int(last) - 1) for first, last in turns.reshape(-1, 2)]


def _middle(
    times: Floats, current: Floats, noise_at: Floats, threshold: float, start: int, stop: int
) -> tuple[float, float]:
    """Midpoint of two crossings and its standard deviation."""
    moments, variances = [], []
    for inside, outside in ((start, start - 1), (stop, stop + 1)):
        outside = min(max(outside, 0), len(times) - 1)
        slope = (current[inside] - current[outside]) / (times[inside] - times[outside] or np.inf)
        steepest = max(abs(slope), 1e-100 * noise_at[inside], 1e-300)
        fraction = (current[inside] - threshold) / (current[inside] - current[outside] or np.inf)
        crossing = times[inside] + (times[outside] - times[inside]) * min(max(fraction, 0), 1)
        moments.append(crossing)
        variances.append((noise_at[inside] / steepest) ** 2)
    width = max(times[stop] - times[start], times[1] - times[0])
    scatter = min(math.sqrt(sum(variances)) / 2, width)
    return sum(moments) / 2, scatter
