"""Continuous-wave time of flight."""

from __future__ import annotations

from collections.abc import Callable
from itertools import pairwise
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import Field, model_validator
from scipy.constants import c

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.spots import SpotOptics
from reconstruction.ranging import unambiguous_path_m
from spisim.base.config import Count, Section
from spisim.instrument.demodulation import TAPS, Modulation
from spisim.instrument.detector import TofDetector
from spisim.instrument.sensor import Reading
from spisim.instrument.tof import (
    BINS_PER_EDGE,
    Emission,
    SpotLight,
    check_charge,
    overflow,
    path_step_m,
)


class CwTof(Section):
    """Continuous wave: the phase of modulated light, from four taps per frequency."""

    method: Literal["cw"]
    """Method discriminator."""
    modulation: Modulation
    """Modulation of the lasers."""
    periods: Count | Annotated[tuple[Count, ...], Field(min_length=1)]
    """Periods that each tap accumulates per frame: at all frequencies, or at each."""
    detector: TofDetector
    """The photodiodes of the spots."""

    @property
    def unambiguous_range_m(self) -> float:
        """Range beyond which a spot aliases to a nearer one."""
        return float(unambiguous_path_m(np.array(self.modulation.frequencies_hz))) / 2

    @property
    def frame_time_s(self) -> float:
        turns = 4 if self.modulation.taps.arrangement == "in-turn" else 1
        each = sum(map(self.light_time_s, self.modulation.frequencies_hz))
        return each * turns

    def light_time_s(self, frequency_hz: float) -> float:
        """Working time of a tap at a frequency per frame."""
        if isinstance(self.periods, tuple):
            number = self.modulation.frequencies_hz.index(frequency_hz)
            return self.periods[number] / frequency_hz
        return self.periods / frequency_hz

    def tap_time_s(self, frequency_hz: float) -> float:
        """Open time of one tap per frame."""
        return self.modulation.taps.fraction * self.light_time_s(frequency_hz)

    @property
    def reading(self) -> Reading:
        """One tap of the lowest frequency."""
        return self.reading_at(min(self.modulation.frequencies_hz))

    def reading_at(self, frequency_hz: float) -> Reading:
        """Times of one tap at a frequency; the echo's is the mean over all phases."""
        time_s = self.tap_time_s(frequency_hz)
        amplifier_s = self.light_time_s(frequency_hz) * self.modulation.taps.noise_share
        return Reading("tap", time_s, time_s, amplifier_s)

    @property
    def edge_s(self) -> float:
        return 1 / (np.pi * max(self.modulation.frequencies_hz))

    def check_bins(self, bin_width_m: float) -> None:
        if path_step_m(self) < bin_width_m:
            frequency = max(self.modulation.frequencies_hz)
            raise InputError(
                f"tof.modulation.frequencies_hz {frequency:g}: its edges are shorter than "
                f"{BINS_PER_EDGE} bins of the path-length histogram; at most "
                f"{frequency * path_step_m(self) / bin_width_m:.4g}"
            )

    def record(
        self, light: SpotLight, optics: SpotOptics, rng: np.random.Generator | None
    ) -> CwSpots:
        """The taps of all frequencies, in turn; see `Tof.record`."""
        modulation = self.modulation
        frequencies, phases = modulation.frequencies_hz, modulation.taps.phases_rad
        electrons = np.concatenate(
            [self._electrons_in_turn(light, frequency) for frequency in frequencies], axis=-1
        )

        def by_tap(of_frequency: Callable[[float], Any]) -> NDArray[Any]:
            return np.repeat([of_frequency(each) for each in frequencies], phases.size)

        times_s = by_tap(lambda each: self.reading_at(each).amplifier_s)
        readings = self.detector.read(electrons, times_s, rng)
        return CwSpots(
            **vars(optics),
            taps=readings.counts,
            saturated=readings.saturated,
            **readings.charge,
            tap_frequencies_hz=by_tap(float),
            tap_phases_rad=np.tile(phases, len(frequencies)),
            phase_offsets_rad=by_tap(
                lambda each: modulation.phase_offset_rad(each, self._response)
            ),
            periods=by_tap(lambda each: round(each * self.light_time_s(each))),
            laser_energies_j=by_tap(lambda each: light.laser_power_w * self.tap_time_s(each)),
            contrasts=by_tap(lambda each: modulation.demodulation_contrast(each, self._response)),
        )

    def _electrons_in_turn(self, light: SpotLight, frequency_hz: float) -> Floats:
        """Mean electrons as `tap_electrons`, of the light while each tap works."""
        times_s = np.array([self.light_time_s(each) for each in self.modulation.frequencies_hz])
        number = self.modulation.frequencies_hz.index(frequency_hz)
        start, stop = np.cumsum([0, *times_s])[number : number + 2] / times_s.sum()
        if self.modulation.taps.arrangement == "parallel":
            return self.tap_electrons(light.during(start, stop), frequency_hz)
        turns = pairwise(np.linspace(start, stop, TAPS + 1).tolist())
        each = [self.tap_electrons(light.during(*turn), frequency_hz) for turn in turns]
        return np.stack([taps[..., tap] for tap, taps in enumerate(each)], axis=-1)

    def tap_electrons(self, light: SpotLight, frequency_hz: float) -> Floats:
        """Mean electrons of the four taps at one frequency, (frames, spots, taps)."""
        phase = 2 * np.pi * frequency_hz / c * light.path_length_m
        modulation = self.modulation
        window = modulation.correlation(phase, frequency_hz, self._response)  # (taps, bins)
        steady = light.steady_per_s[..., None] * modulation.taps.fraction
        return np.asarray((light.echo_per_s @ window.T + steady) * self.light_time_s(frequency_hz))

    def path_sigma_m(self, path_m: Floats, echo_per_s: Floats, steady_per_s: Floats) -> Floats:
        """Four taps: σ_φ = √(v/2) / A (Lange & Seitz, IEEE J. Quantum Electron. 37, 390 (2001)).

        v is the variance of a tap at mean phase, A the amplitude of its signal against phase. This
        equals the paper's Eq. (3) with A_R twice the mean signal of a period. Several frequencies
        are weighted by precision, assuming their whole periods are resolved.
        """
        precision = np.zeros(np.shape(echo_per_s))
        for frequency in self.modulation.frequencies_hz:
            reading = self.reading_at(frequency)
            electronics = self.detector.electronics_noise_electrons(reading.amplifier_s)
            mean = (echo_per_s + steady_per_s) * reading.steady_s
            variance = self.detector.sensor.excess_noise_factor * mean + electronics**2
            contrast = self.modulation.demodulation_contrast(frequency, self._response)
            amplitude = contrast * echo_per_s * reading.echo_s
            phase_sigma = np.sqrt(variance / 2) / amplitude
            precision = precision + (2 * np.pi * frequency / (c * phase_sigma)) ** 2
        return np.asarray(1 / np.sqrt(precision))

    def emission(self, power_w: float) -> Emission:
        """The half period of the slowest modulation with the most light counts as its pulse."""
        half_period_s = 0.5 / min(self.modulation.frequencies_hz)
        return Emission(power_w, power_w * 2 * half_period_s, half_period_s)

    def warnings(self, steady_per_s: float, echo_per_s: float) -> list[str]:
        """Warnings about taps that overflow; an echo in phase gives twice its mean."""
        return overflow(self, steady_per_s, 2 * echo_per_s)

    @property
    def _response(self) -> Callable[[Any], Any]:
        assert self.detector.amplifier is not None
        return self.detector.amplifier.response

    @model_validator(mode="after")
    def _periods_of_each_frequency(self) -> CwTof:
        frequencies = self.modulation.frequencies_hz
        if isinstance(self.periods, tuple) and len(self.periods) != len(frequencies):
            raise InputError(
                f"periods has {len(self.periods)} numbers for {len(frequencies)} "
                "modulation.frequencies_hz; one for all or one for each is needed"
            )
        return self

    @model_validator(mode="after")
    def _charge_is_demodulated(self) -> CwTof:
        check_charge("cw", self.detector)
        return self


TOF = CwTof
