"""Pulsed time of flight with integration windows."""

from __future__ import annotations

from collections.abc import Callable
from typing import Annotated, Literal

import numpy as np
from pydantic import Field, model_validator
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.readings.pulsed import PulsedSpots
from reconstruction.capture.spots import SpotOptics
from spisim.base.config import Count, NonNegative, Positive, Section
from spisim.instrument.detector import TofDetector
from spisim.instrument.sensor import Reading
from spisim.instrument.tof import Emission, SpotLight, check_charge, check_pulse, overflow

#: Samples of the pulse's waveform per window.
WAVE_POINTS = 2000


class PulsedTof(Section):
    """Pulses: charge in consecutive windows as long as the pulse, and one window before it."""

    method: Literal["pulsed"]
    """Method discriminator."""
    pulse_width_s: Positive
    """Width of the pulse at half height, and of each window."""
    rise_time_s: NonNegative = 0.0
    """Rise and fall time of the pulse."""
    windows: Annotated[int, Field(ge=2, le=64)] = 2
    """Consecutive windows for the echo."""
    gate_delay_s: NonNegative = 0.0
    """Delay from the start of the pulse to the first window."""
    pulses: Count
    """Pulses per frame."""
    repetition_rate_hz: Positive
    """Pulses per second."""
    detector: TofDetector
    """The photodiodes of the spots."""

    @property
    def window_starts_s(self) -> tuple[float, ...]:
        """Starts of the background's window and the echo's, relative to the start of the pulse."""
        gates = (self.gate_delay_s + k * self.pulse_width_s for k in range(self.windows))
        return (-2 * self.pulse_width_s, *gates)

    @property
    def unambiguous_range_m(self) -> float:
        """Range beyond which the last window but one receives no light."""
        return c * (self.gate_delay_s + (self.windows - 1) * self.pulse_width_s) / 2

    @property
    def frame_time_s(self) -> float:
        return self.pulses / self.repetition_rate_hz

    @property
    def reading(self) -> Reading:
        """One window that contains the whole echo."""
        time_s = self.pulses * self.pulse_width_s
        return Reading("window", time_s, time_s, time_s)

    @property
    def edge_s(self) -> float:
        return self.pulse_width_s  # over which a window's part of the pulse rises

    def check_bins(self, bin_width_m: float) -> None:
        check_pulse(self, "pulse_width_s", self.pulse_width_s, bin_width_m)

    def record(
        self, light: SpotLight, optics: SpotOptics, rng: np.random.Generator | None
    ) -> PulsedSpots:
        """The windows; see `Tof.record`."""
        amplifier, time_s = self.detector.amplifier, self.pulses * self.pulse_width_s
        readings = self.detector.read(self.window_electrons(light), time_s, rng)
        return PulsedSpots(
            **vars(optics),
            taps=readings.counts,
            saturated=readings.saturated,
            **readings.charge,
            window_starts_s=np.array(self.window_starts_s),
            pulse_width_s=self.pulse_width_s,
            pulses=self.pulses,
            delay_offset_s=0.0 if amplifier is None else amplifier.time_constant_s,
            laser_energy_j=self.pulses * self.emission(light.laser_power_w).pulse_j,
        )

    def window_electrons(self, light: SpotLight) -> Floats:
        """Mean electrons of the windows, (frames, spots, windows)."""
        collected = self._collected()
        starts = (
            np.array(self.window_starts_s)[:, None] - light.path_length_m / c
        )  # (windows, bins)
        window = collected(starts + self.pulse_width_s) - collected(starts)
        steady = light.steady_per_s[..., None] * self.pulse_width_s
        return np.asarray((light.echo_per_s @ window.T + steady) * self.pulses)

    def _collected(self) -> Callable[[Floats], Floats]:
        """Time integral, as a function, of the unit pulse behind the amplifier."""
        width, amplifier = self.pulse_width_s, self.detector.amplifier
        pole_s = 0.0 if amplifier is None else amplifier.time_constant_s
        step = width / WAVE_POINTS
        times = np.arange(-2 * WAVE_POINTS, 6 * WAVE_POINTS) * step
        rise = max(self.rise_time_s, step)
        edges = [np.clip(0.5 + (times - edge) / rise, 0, 1) for edge in (0.0, width)]
        pulse = edges[0] - edges[1]
        if pole_s > 0:
            from scipy.signal import lfilter  # slow to import

            decay = np.exp(-step / pole_s)
            pulse = lfilter([(1 - decay) / 2, (1 - decay) / 2], [1, -decay], pulse)
        sums = np.concatenate([[0.0], np.cumsum((pulse[1:] + pulse[:-1]) / 2)]) * step
        return lambda at: np.asarray(np.interp(at, times, sums))

    def path_sigma_m(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Windows: L = c T r with r = (S₂ - S₀) / (S₁ + S₂ - 2 S₀), to first order in the errors.

        var L = (c T)² [F r (1 - r) / s + v ((1 - r)² + r² + (1 - 2r)²) / s²], where s is the whole
        signal and v the variance of a window without it. Not valid within the rise time of either
        end.
        """
        detector, reading = self.detector, self.reading
        excess = detector.sensor.excess_noise_factor
        signal = echo_per_s * reading.echo_s
        electronics = detector.electronics_noise_electrons(reading.amplifier_s)
        other = excess * steady_per_s * reading.steady_s + electronics**2
        elapsed = (path_m / c - self.gate_delay_s) / self.pulse_width_s
        r = elapsed - np.clip(np.floor(elapsed), 0, self.windows - 2)
        shot = excess * r * (1 - r) / signal
        spread = other * ((1 - r) ** 2 + r**2 + (1 - 2 * r) ** 2) / signal**2
        sigma = c * self.pulse_width_s * np.sqrt(shot + spread)
        return np.where((r >= 0) & (r <= 1), sigma, np.inf)

    def emission(self, power_w: float) -> Emission:
        energy = power_w * self.pulse_width_s
        return Emission(energy * self.repetition_rate_hz, energy, self.pulse_width_s)

    def warnings(self, steady_per_s: float, echo_per_s: float) -> list[str]:
        """Warnings about windows that overflow."""
        return overflow(self, steady_per_s, echo_per_s)

    @model_validator(mode="after")
    def _fits(self) -> PulsedTof:
        check_charge("pulsed", self.detector)
        if self.rise_time_s > self.pulse_width_s:
            raise InputError(
                f"rise_time_s {self.rise_time_s:g} is longer than pulse_width_s "
                f"{self.pulse_width_s:g}"
            )
        needed_s = self.gate_delay_s + (self.windows + 2) * self.pulse_width_s
        if needed_s * self.repetition_rate_hz > 1:
            raise InputError(
                f"repetition_rate_hz {self.repetition_rate_hz:g} leaves no room for "
                f"{self.windows + 1} windows of {self.pulse_width_s:g} s and a gap; at most "
                f"{1 / needed_s:.4g}"
            )
        return self


TOF = PulsedTof
