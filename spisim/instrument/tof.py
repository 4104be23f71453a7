"""How the four spots are ranged: continuous wave, pulses with windows, or single arrivals."""

from __future__ import annotations

import math
from typing import Annotated, Literal

import numpy as np
from pydantic import Discriminator, Field, model_validator
from scipy.constants import c

from reconstruction.errors import InputError
from reconstruction.ranging import unambiguous_path_m
from spisim.config import Count, NonNegative, Number, Positive, Section
from spisim.instrument.demodulation import Modulation
from spisim.instrument.detector import TofDetector
from spisim.instrument.sensor import FWHM_PER_SIGMA, Spad


class CwTof(Section):
    """Continuous wave: the phase of modulated light, from four taps per frequency."""

    method: Literal["cw"]
    modulation: Modulation
    periods: Count  # accumulated by each tap at each frequency, for one frame
    detector: TofDetector

    def tap_time_s(self, frequency_hz: float) -> float:
        """Time for which one tap is open in a frame."""
        return self.periods * self.modulation.taps.share / frequency_hz

    @property
    def unambiguous_range_m(self) -> float:
        """Range from which on a spot looks nearer than it is."""
        return float(unambiguous_path_m(np.array(self.modulation.frequencies_hz))) / 2

    @property
    def frame_time_s(self) -> float:
        """Time that a frame takes, all frequencies and taps."""
        turns = 4 if self.modulation.taps.arrangement == "in-turn" else 1
        spots = 4 if self.detector.shared else 1
        periods = sum(1 / frequency for frequency in self.modulation.frequencies_hz)
        return self.periods * periods * turns * spots

    @model_validator(mode="after")
    def _charge_is_demodulated(self) -> CwTof:
        _integrates_charge("cw", self.detector)
        return self


class PulsedTof(Section):
    """Pulses: charge in two windows as long as the pulse, one after the other, and one before.

    The range is the share of the light that arrives in the second window. The pulse rises and
    falls within `rise_time_s`, linearly.
    """

    method: Literal["pulsed"]
    pulse_width_s: Positive  # at half height; of each window too
    rise_time_s: NonNegative = 0.0
    pulses: Count
    repetition_rate_hz: Positive
    detector: TofDetector

    @property
    def window_starts_s(self) -> tuple[float, float, float]:
        """Of background, first and second window, from the start of the pulse."""
        return (-2 * self.pulse_width_s, 0.0, self.pulse_width_s)

    @property
    def unambiguous_range_m(self) -> float:
        """Range from which on the first window gets nothing."""
        return c * self.pulse_width_s / 2

    @property
    def frame_time_s(self) -> float:
        """Time that a frame takes."""
        return self.pulses / self.repetition_rate_hz * (4 if self.detector.shared else 1)

    @model_validator(mode="after")
    def _fits(self) -> PulsedTof:
        _integrates_charge("pulsed", self.detector)
        if self.rise_time_s > self.pulse_width_s:
            raise InputError(
                f"rise_time_s {self.rise_time_s:g} is longer than pulse_width_s "
                f"{self.pulse_width_s:g}"
            )
        if 4 * self.pulse_width_s * self.repetition_rate_hz > 1:
            raise InputError(
                f"repetition_rate_hz {self.repetition_rate_hz:g} leaves no room for three windows "
                f"of {self.pulse_width_s:g} s and a gap; at most {0.25 / self.pulse_width_s:.4g}"
            )
        return self


class DirectTof(Section):
    """Single arrivals: each pulse gives at most one time stamp, and those a histogram.

    A single-photon diode stamps its first detection in the gate. A charge detector stamps the
    first crossing of a threshold, `threshold_sigma` times the rms noise of the current, as the
    middle between the crossings of rising and falling edge, which does not walk with the pulse's
    height. `pulse_fwhm_s` is that of Gaussian light.
    """

    method: Literal["dtof"]
    pulse_fwhm_s: Positive
    pulses: Count
    repetition_rate_hz: Positive
    bin_width_s: Positive
    bins: Annotated[int, Field(ge=3, le=2**20)]
    threshold_sigma: Annotated[Number, Field(ge=1)] | None = None
    detector: TofDetector

    @property
    def gate_s(self) -> float:
        """How long a cycle waits for an arrival, from the centre of the pulse on."""
        return self.bins * self.bin_width_s

    @property
    def unambiguous_range_m(self) -> float:
        """Range from which on the light arrives after the gate."""
        return c * self.gate_s / 2

    @property
    def pulse_sigma_s(self) -> float:
        """Standard deviation of the pulse of light."""
        return self.pulse_fwhm_s / FWHM_PER_SIGMA

    @property
    def amplified_sigma_s(self) -> float:
        """Standard deviation of the pulse behind the amplifier that feeds the threshold.

        The amplifier is taken as a filter of Gaussian shape here, 3 dB down at its bandwidth, so
        that pulses stay even; one pole would draw out their end.
        """
        amplifier = self.detector.amplifier
        assert amplifier is not None
        assert amplifier.bandwidth_hz is not None
        widening_s = math.sqrt(math.log(2)) / (2 * math.pi * amplifier.bandwidth_hz)
        return math.hypot(self.pulse_sigma_s, widening_s)

    @property
    def response_sigma_s(self) -> float:
        """Standard deviation of light and time stamp together; of a threshold, nan: it varies."""
        sensor = self.detector.sensor
        if not isinstance(sensor, Spad):
            return math.nan
        return math.hypot(self.pulse_sigma_s, sensor.jitter_sigma_s)

    @property
    def frame_time_s(self) -> float:
        """Time that a frame takes."""
        return self.pulses / self.repetition_rate_hz * (4 if self.detector.shared else 1)

    @model_validator(mode="after")
    def _fits(self) -> DirectTof:
        sensor, amplifier = self.detector.sensor, self.detector.amplifier
        counts = isinstance(sensor, Spad)
        if counts != (self.threshold_sigma is None):
            verb = "has no threshold_sigma" if counts else "needs threshold_sigma"
            raise InputError(f"a {sensor.type} sensor {verb} for dtof")
        if amplifier is not None and amplifier.bandwidth_hz is None:
            raise InputError("detector.amplifier.bandwidth_hz is needed for a threshold")
        dead = sensor.dead_time_s if isinstance(sensor, Spad) else 0.0
        highest = 1 / (self.gate_s + dead)
        if self.repetition_rate_hz > highest * (1 + 1e-9):
            raise InputError(
                f"repetition_rate_hz {self.repetition_rate_hz:g}: the gate of bins · bin_width_s, "
                f"{self.gate_s:.4g} s, and the dead time do not fit a period; at most {highest:.4g}"
            )
        return self


Tof = Annotated[CwTof | PulsedTof | DirectTof, Discriminator("method")]


def _integrates_charge(method: str, detector: TofDetector) -> None:
    if isinstance(detector.sensor, Spad):
        raise InputError(f"{method} integrates charge; a spad sensor counts: choose method dtof")
    if detector.amplifier is not None and detector.amplifier.coupling == "ac":
        raise InputError(
            f"detector.amplifier.coupling should be dc: {method} subtracts the background itself"
        )
