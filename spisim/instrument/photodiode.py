"""Common behaviour of PIN and avalanche photodiodes, from light to converted charge."""

from __future__ import annotations

from typing import Any, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from scipy.constants import c, elementary_charge, h

from reconstruction.base.arrays import Floats
from spisim.instrument.sensor import (
    Each,
    FrontEnd,
    PulseTiming,
    Random,
    Readings,
    Sensor,
    Spectral,
    covers,
    spectral_value,
)
from spisim.instrument.stamping.threshold import Threshold

#: Gain at which data sheets of avalanche diodes state a responsivity.
USUAL_GAIN = 100.0
#: Minimum responsivity at unit gain, near infrared: a smaller one does not hint at a gain.
MIN_A_PER_W = 0.1
#: Electrons above which a normal distribution replaces Poisson's, whose skewness is 1e-6.
LARGE_MEAN = 1e12


class Photodiode(Sensor):
    """A sensor whose charge is amplified and converted."""

    responsivity_a_per_w: Spectral
    """Responsivity at unit gain: one value, or rows of wavelength in nm and value."""

    def electrons_per_joule(self, wavelength_nm: ArrayLike) -> Floats:
        """Primary electrons per joule on the photodiode."""
        return spectral_value(self.responsivity_a_per_w, wavelength_nm) / elementary_charge

    def at_band(self, band_nm: tuple[float, float], old_nm: float, new_nm: float) -> Self:
        """For light of another band: same quantum efficiency, unless a table covers the band.

        At constant quantum efficiency the responsivity is proportional to the wavelength.
        """
        if covers(self.responsivity_a_per_w, band_nm):
            return self
        old = float(spectral_value(self.responsivity_a_per_w, old_nm))
        return self.model_copy(update={"responsivity_a_per_w": old * (new_nm / old_nm)})

    def too_efficient(self, shortest_nm: float) -> str:
        limit = elementary_charge * shortest_nm * 1e-9 / (h * c)
        message = (
            f"responsivity_a_per_w {self.responsivity_a_per_w} is more than one electron per "
            f"photon, {limit:.4g} A/W"
        )
        largest = float(np.max(spectral_value(self.responsivity_a_per_w, shortest_nm)))
        gain = self.gain if self.gain > 1 else USUAL_GAIN
        if not MIN_A_PER_W <= largest / gain <= limit:
            return message
        return (
            f"{message}; it belongs at unit gain: if the data sheet states it at a gain of "
            f"{gain:g}, divide by that, {largest / gain:.3g}"
        )

    def arrivals(self, electrons: Floats, rng: np.random.Generator) -> Floats:
        """Draw charges with these means: Poisson noise, and excess noise of an avalanche."""
        drawn = _poisson(electrons, rng)
        excess = self.excess_noise_factor - 1
        if excess > 0:
            drawn += rng.normal(0, np.sqrt(excess * electrons))
        return drawn

    def read(
        self,
        detector: FrontEnd,
        electrons: Floats,
        time_s: Each,
        rng: Random,
        taken_off: Each = 0.0,
    ) -> Readings:
        """One recording with amplifier noise, rounding and clipping; see `Sensor.read`."""
        adc = detector.adc
        assert adc is not None
        if rng is None:  # no noise, no quantisation, no saturation
            counts: NDArray[Any] = (
                electrons - taken_off
            ) / adc.electrons_per_count + adc.offset_counts
            saturated = np.zeros(counts.shape, np.bool_)
        else:
            charge = self.arrivals(electrons, rng)
            amplifier = detector.amplifier_noise_electrons(time_s)
            charge += rng.normal(0, amplifier, charge.shape) - taken_off
            counts, saturated = adc.converted(charge)
        return Readings(
            counts,
            saturated,
            electrons_per_count=adc.electrons_per_count,
            offset_counts=float(adc.offset_counts),
            noise_electrons=detector.electronics_noise_electrons(time_s),
            excess_noise_factor=self.excess_noise_factor,
        )

    def warnings(
        self, name: str, detector: FrontEnd, time_s: float, background: float, whole: float
    ) -> list[str]:
        """Warnings about charge beyond the converter's range; see `Sensor.warnings`."""
        assert detector.adc is not None
        if detector.amplifier is not None and detector.amplifier.coupling == "ac":
            return []  # the mean does not reach the converter
        room = detector.adc.headroom_electrons
        if background > room:
            return [
                f"{name}.adc holds {room:.3g} electrons, and the background alone is "
                f"{background:.3g}: every reading saturates"
            ]
        if whole > room:
            return [
                f"{name}.adc holds {room:.3g} electrons, and signal and background together are "
                f"{whole:.3g}: bright readings saturate"
            ]
        return []

    def stamping(self, tof: PulseTiming) -> Threshold:
        return Threshold(tof)


def _poisson(mean: Floats, rng: np.random.Generator) -> Floats:
    """Poisson numbers; NumPy cannot draw them for means near 2^63."""
    large = mean > LARGE_MEAN
    drawn = rng.poisson(np.where(large, 0, mean)).astype(np.float64)
    drawn[large] = rng.normal(mean[large], np.sqrt(mean[large]))
    return drawn
