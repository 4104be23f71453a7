"""Time stamps of a current that crosses a threshold."""

from __future__ import annotations

import math
from dataclasses import dataclass
from typing import ClassVar

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c, elementary_charge
from scipy.interpolate import CubicSpline
from scipy.ndimage import maximum_filter1d

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument.electronics import Amplifier
from spisim.instrument.sensor import PulseTiming, Reading
from spisim.instrument.stamping import smoothed
from spisim.instrument.stamping.crossings import Shape, first_middles, lone_pulses

#: Time above the threshold beyond that of a lone pulse, in its standard deviations, up to which an
#: echo counts as one: by half of it the midpoint may be off.
LONGER = 1.0
#: A current is drawn where it is above NOTICED of the noise without it and at most UNLIKELY
#: standard deviations of its own noise below the threshold; elsewhere false alarms alone count.
NOTICED, UNLIKELY = 0.25, 5.0
#: False alarms per gate from which they are worth a warning.
MANY_FALSE_ALARMS = 0.05


@dataclass(frozen=True)
class Threshold:
    """The midpoint between the crossings of the first rising and falling edge.

    What stays above the threshold for longer than a lone pulse of its height is fog, or fog and
    what is behind it, whose midpoint is nobody's: it gets no stamp. Both edges are timed anyway; a
    peak detector is assumed, too.

    The noise is that of the amplifier and shot noise in its bandwidth B, both shaped by its filter,
    and stamps are those of draws (`crossings`). False alarms have the rate of Rice (Bell Syst.
    Tech. J. 24, 46 (1945)), B / √(2 ln 2) exp(-threshold² / 2 noise²) of a Gaussian filter.
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
        return Reading("echo", time_s, time_s * self.shape.peak_fraction, time_s, converted=False)

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
    def shape(self) -> Shape:
        """Pulse and amplifier.

        The amplifier counts as a Gaussian filter, 3 dB down at its bandwidth, so that pulses stay
        even; one pole would draw out their tail.
        """
        return Shape(
            self.tof.pulse_sigma_s, math.sqrt(math.log(2)) / (2 * math.pi * self.bandwidth_hz)
        )

    @property
    def false_alarms_hz(self) -> float:
        """Rate at which noise alone crosses the threshold."""
        assert self.tof.threshold_sigma is not None
        return self.shape.zero_crossings_hz * math.exp(-(self.tof.threshold_sigma**2) / 2)

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
        if self.tof.threshold_sigma < 1:
            raise InputError(
                f"threshold_sigma {self.tof.threshold_sigma:g} is below the rms noise, which alone "
                "would cross it all the time; at least 1, and 5 to 8 is usual"
            )
        if self._amplifier.bandwidth_hz is None:
            raise InputError("detector.amplifier.bandwidth_hz is needed for a threshold")

    def chances(self, path_m: Floats, echo_per_s: Floats, steady_per_s: float) -> Floats:
        """Probability (bins,) that a cycle's first time stamp falls into each bin of the gate.

        From draws of the noise where there is light, and Rice's false alarms. Echoes between which
        the current stays above the threshold stamp as one.
        """
        tof, shape = self.tof, self.shape
        assert tof.threshold_sigma is not None
        times, current, variance = self._current(path_m, echo_per_s, steady_per_s)
        noise = self._noise(np.asarray(steady_per_s))
        threshold = tof.threshold_sigma * float(noise)
        edges: Floats = np.arange(tof.bins + 1, dtype=np.float64) * tof.bin_width_s
        chances = np.zeros(tof.bins)
        left = 1.0
        likely = current > threshold - UNLIKELY * self._noise(steady_per_s + current)
        likely &= current > NOTICED * noise
        refused = self._refused(current / threshold, likely)
        reach = math.ceil(shape.sigma_s / shape.step_s)
        drawn = maximum_filter1d(likely, 2 * reach + 1)
        for start, stop in _stays(drawn):
            part = slice(start, stop + 1)
            middles, draws = first_middles(
                shape, times[part], current[part], variance[part], threshold, refused[part]
            )
            survives = math.exp(-self.false_alarms_hz * max(times[start], 0.0))
            chances += left * survives / draws * np.histogram(middles, edges)[0]
            left *= 1 - middles.size / draws
        after = 1.0 - np.concatenate([[0.0], np.cumsum(chances)])[:-1]
        quiet = np.exp(-self.false_alarms_hz * edges)
        return np.asarray(chances + after * -np.diff(quiet))

    def _current(
        self, path_m: Floats, echo_per_s: Floats, steady_per_s: float
    ) -> tuple[Floats, Floats, Floats]:
        """Times, the echo's current behind the amplifier, and the variance of noise before it."""
        tof, shape = self.tof, self.shape
        wide = smoothed(path_m, echo_per_s, shape.sigma_s, tof.gate_s)
        # A near echo rises before the pulse's centre has left: only its stamp lies in the gate.
        times = np.arange(min(wide[0][0], 0.0), tof.gate_s, shape.step_s)
        before, behind = (
            tof.pulse_sigma_s
            * math.sqrt(2 * math.pi)
            * np.maximum(np.nan_to_num(CubicSpline(*echo, extrapolate=False)(times)), 0)
            for echo in (smoothed(path_m, echo_per_s, shape.pulse_s, tof.gate_s), wide)
        )
        return times, behind, self._noise(steady_per_s + before) ** 2

    def _noise(self, current: Floats) -> Floats:
        """Standard deviation (...) of the current behind the amplifier."""
        sensor = self.tof.detector.sensor
        amplifier = self._amplifier.noise_pa_per_sqrt_hz * 1e-12 / (elementary_charge * sensor.gain)
        density = amplifier**2 + 2 * sensor.excess_noise_factor * current
        return np.asarray(np.sqrt(density * self.bandwidth_hz))

    def _refused(self, height: Floats, likely: NDArray[np.bool_]) -> NDArray[np.bool_]:
        """Mask (times,) of midpoints that are refused, for a current over the threshold.

        Those of what stays above it for too long, and of noise that crosses it at both its ends,
        where what is `likely` to cross reaches.
        """
        shape = self.shape
        region = np.cumsum(np.diff(likely, prepend=False))  # one number for each likely part
        fog, lone = np.zeros(height.size, np.bool_), np.zeros(height.size, np.bool_)
        for start, stop in _stays(height > 1):
            stay = slice(start, stop + 1)
            usual = 2 * math.sqrt(2 * math.log(height[stay].max())) + LONGER
            if (stop - start) * shape.step_s > usual * shape.sigma_s:
                fog |= region == region[start]
            else:
                lone[stay] = True
        return fog & ~lone

    def sigma_s(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Standard deviation (...) of the mean of all time stamps.

        Of draws of lone pulses (`crossings.lone_pulses`); a bin adds 1/12 of its square. False
        alarms consume their cycles. Infinite where less than one stamp is expected.
        """
        tof, detector, window_s = self.tof, self.tof.detector, self.window_s
        assert tof.threshold_sigma is not None
        excess = detector.sensor.excess_noise_factor
        amplifier = detector.amplifier_noise_electrons(window_s) ** 2
        noise = np.sqrt(excess * steady_per_s * window_s + amplifier)
        peak = echo_per_s * window_s * self.shape.peak_fraction
        stamped, sigma_s = lone_pulses(
            self.shape, peak / noise, tof.threshold_sigma, excess / noise
        )
        stamps = tof.pulses * stamped * np.exp(-self.false_alarms_hz * path_m / c)
        variance = (sigma_s**2 + tof.bin_width_s**2 / 12) / np.maximum(stamps, 1)
        return np.asarray(np.where(stamps >= 1, np.sqrt(variance), np.inf))

    def warnings(self, steady_per_s: float) -> list[str]:
        """A warning about false alarms that take the place of echoes."""
        alarms = self.false_alarms_hz * self.tof.gate_s
        if alarms < MANY_FALSE_ALARMS:
            return []
        return [
            f"tof.threshold_sigma {self.tof.threshold_sigma:g}: noise alone crosses it "
            f"{alarms:.2g} times per gate, which hides later echoes; below "
            f"{MANY_FALSE_ALARMS:g} it would not"
        ]

    @property
    def _amplifier(self) -> Amplifier:
        amplifier = self.tof.detector.amplifier
        assert amplifier is not None
        return amplifier


def _stays(above: NDArray[np.bool_]) -> list[tuple[int, int]]:
    """Index ranges (first, last) of a mask."""
    turns = np.flatnonzero(np.diff(above, prepend=False, append=False))
    return [(int(first), int(last) - 1) for first, last in turns.reshape(-1, 2)]
