"""What turns light into electrons: PIN photodiode, avalanche diode, single-photon diode.

Electrons are *primary* ones throughout: one per detected photon, before any gain.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal, Self

import numpy as np
from numpy.typing import ArrayLike, NDArray
from pydantic import AfterValidator, Discriminator, Field
from scipy.constants import c, elementary_charge, h

from reconstruction.errors import InputError
from spisim.config import NonNegative, Number, Positive, Section

PositiveFraction = Annotated[Number, Field(gt=0, le=1)]
Efficiency = Annotated[Number, Field(ge=0, lt=1)]


def _rising(table: Any) -> Any:
    if isinstance(table, tuple):
        wavelengths = [row[0] for row in table]
        if len(table) < 2 or wavelengths != sorted(set(wavelengths)):
            raise InputError("a table needs rows [wavelength_nm, value] of rising wavelength")
    return table


#: One value for the whole band, or rows of wavelength (nm) and value, linear between.
Spectral = Annotated[Positive | tuple[tuple[Positive, Positive], ...], AfterValidator(_rising)]


def spectral_value(curve: Any, wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """Values of a `Spectral` field at some wavelengths; a table's ends hold beyond it."""
    at = np.asarray(wavelength_nm, dtype=np.float64)
    if isinstance(curve, tuple):
        return np.asarray(np.interp(at, *np.transpose(curve)))
    return np.full(at.shape, float(curve))


def _covers(curve: Any, band_nm: tuple[float, float]) -> bool:
    """Whether a `Spectral` field is a table that reaches over a band."""
    return isinstance(curve, tuple) and curve[0][0] <= band_nm[0] and band_nm[1] <= curve[-1][0]


class _Sensor(Section):
    photoactive_area_mm2: Positive
    fill_factor: PositiveFraction = 1.0

    @property
    def effective_area_m2(self) -> float:
        """Of the part that detects."""
        return self.photoactive_area_mm2 * 1e-6 * self.fill_factor


class _Photodiode(_Sensor):
    responsivity_a_per_w: Spectral  # at unit gain

    def electrons_per_joule(self, wavelength_nm: ArrayLike) -> NDArray[np.float64]:
        """Primary electrons per joule on the photodiode."""
        return spectral_value(self.responsivity_a_per_w, wavelength_nm) / elementary_charge

    def at_band(self, band_nm: tuple[float, float], old_nm: float, new_nm: float) -> Self:
        """For light of another band: of the same quantum efficiency, but where a table covers it.

        At one quantum efficiency the responsivity is proportional to the wavelength.
        """
        if _covers(self.responsivity_a_per_w, band_nm):
            return self
        old = float(spectral_value(self.responsivity_a_per_w, old_nm))
        return self.model_copy(update={"responsivity_a_per_w": old * (new_nm / old_nm)})


class Pin(_Photodiode):
    """Photodiode without gain."""

    type: Literal["pin"]
    dark_current_na: NonNegative

    @property
    def gain(self) -> float:
        """Electrons per primary electron."""
        return 1.0

    @property
    def excess_noise_factor(self) -> float:
        """Variance of the charge per primary electron, in primary electrons squared."""
        return 1.0

    @property
    def dark_rate_hz(self) -> float:
        """Primary dark electrons per second."""
        return self.dark_current_na * 1e-9 / elementary_charge


class Apd(_Photodiode):
    """Avalanche diode in linear mode.

    The excess noise is McIntyre's (IEEE Trans. Electron Devices 13, 164 (1966)) for the carriers
    that multiply best: F = k M + (1 - k)(2 - 1/M). Many electrons make its sum normal; for a few
    per reading the real distribution is skewed.
    """

    type: Literal["apd"]
    dark_current_na: NonNegative  # at the operating gain, taken as multiplied altogether
    gain: Annotated[Number, Field(ge=1)]
    ionisation_ratio: Annotated[Number, Field(ge=0, le=1)]  # k of holes to electrons, or inverse

    @property
    def excess_noise_factor(self) -> float:
        """Variance of the charge per primary electron, in primary electrons squared."""
        k, gain = self.ionisation_ratio, self.gain
        return k * gain + (1 - k) * (2 - 1 / gain)

    @property
    def dark_rate_hz(self) -> float:
        """Primary dark electrons per second."""
        return self.dark_current_na * 1e-9 / (elementary_charge * self.gain)


class Spad(_Sensor):
    """Avalanche diode in Geiger mode: a counter, blind for `dead_time_s` after each detection.

    Every detection is followed by another one, of a trapped carrier, with
    `afterpulse_probability`. `jitter_fwhm_s` is that of the time stamp, taken as Gaussian.
    """

    type: Literal["spad"]
    detection_efficiency: Spectral
    dark_count_rate_hz: NonNegative
    dead_time_s: NonNegative
    afterpulse_probability: Efficiency = 0.0
    jitter_fwhm_s: NonNegative = 0.0

    @property
    def gain(self) -> float:
        """A counter has none."""
        return 1.0

    @property
    def excess_noise_factor(self) -> float:
        """Of a count with its geometric cascade of after-pulses."""
        return 1 + self.afterpulse_probability

    def electrons_per_joule(self, wavelength_nm: ArrayLike) -> NDArray[np.float64]:
        """Primary detections per joule on the diode."""
        at = np.asarray(wavelength_nm, dtype=np.float64)
        return spectral_value(self.detection_efficiency, at) * at * 1e-9 / (h * c)

    def at_band(self, band_nm: tuple[float, float], old_nm: float, new_nm: float) -> Self:
        """For light of another band, as efficient as at `old_nm` but where a table covers it."""
        if _covers(self.detection_efficiency, band_nm):
            return self
        old = float(spectral_value(self.detection_efficiency, old_nm))
        return self.model_copy(update={"detection_efficiency": old})

    @property
    def dark_rate_hz(self) -> float:
        """Dark counts per second, without their after-pulses."""
        return self.dark_count_rate_hz

    @property
    def jitter_sigma_s(self) -> float:
        """Standard deviation of a time stamp."""
        return self.jitter_fwhm_s / FWHM_PER_SIGMA


FWHM_PER_SIGMA = 2 * math.sqrt(2 * math.log(2))

Sensor = Annotated[Pin | Apd | Spad, Discriminator("type")]


def quantum_efficiency(sensor: Pin | Apd | Spad, wavelength_nm: ArrayLike) -> NDArray[np.float64]:
    """Detected electrons per photon."""
    photon_energy = h * c / (np.asarray(wavelength_nm, dtype=np.float64) * 1e-9)
    return sensor.electrons_per_joule(wavelength_nm) * photon_energy
