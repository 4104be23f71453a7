"""A photodiode behind a lens, with amplifier and converter."""

from __future__ import annotations

import math
from typing import Annotated, Any

import numpy as np
from numpy.typing import ArrayLike
from pydantic import Field, field_validator, model_validator
from scipy.constants import elementary_charge

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.spots import MAX_SPOTS
from spisim.base.config import NonNegative, Number, Positive, Section, Vector
from spisim.instrument.electronics import Adc, Amplifier
from spisim.instrument.sensor import Each, PositiveFraction, Random, Readings
from spisim.instrument.sensors import AnySensor

#: Minimum f-number: the sine of the cone of a faster lens would exceed 1.
MIN_F_NUMBER = 0.5
#: Maximum distance from the projector within one instrument.
MAX_DISTANCE_M = 100.0


class Detector(Section):
    """Common fields of bucket and ranging detectors.

    The lens has an f-number or an aperture diameter; étendue gives the other.
    """

    field_of_view_deg: Annotated[Number, Field(gt=0, le=180)]
    """Full angle of a hard-edged cone."""
    vignetting: NonNegative = 0.0
    """Exponent m: the response falls as cosᵐ inside the cone."""
    f_number: Annotated[Number, Field(ge=MIN_F_NUMBER)] | None = None
    """F-number of the lens; étendue gives its diameter. This or `aperture_diameter_mm`."""
    aperture_diameter_mm: Positive | None = None
    """Diameter of the entrance aperture. This or `f_number`."""
    lens_transmittance: PositiveFraction
    """Transmitted fraction of the light."""
    sensor: AnySensor
    """Converts light into electrons."""
    amplifier: Amplifier | None = None
    """Amplifier of a photodiode; single-photon diodes have none."""
    adc: Adc | None = None
    """Converter of a photodiode; single-photon diodes have none."""
    positions_m: tuple[Vector, ...]
    """Positions of the photodiodes, optical frame."""

    @property
    def aperture_area_m2(self) -> float:
        """Area of the entrance aperture.

        A field of half angle θ over an aperture A_ap has the étendue π A_ap sin²θ; a photodiode of
        effective area A·FF behind a lens of f-number N has π A·FF / (4 N²). So
        A_ap = A·FF / (4 N² sin²θ): narrow fields have large apertures.
        """
        if self.aperture_diameter_mm is not None:
            return math.pi * (self.aperture_diameter_mm * 1e-3) ** 2 / 4
        assert self.f_number is not None
        return self._max_aperture_m2 * (MIN_F_NUMBER / self.f_number) ** 2

    @property
    def _max_aperture_m2(self) -> float:
        half_angle = math.radians(self.field_of_view_deg) / 2
        return self.sensor.effective_area_m2 / math.sin(half_angle) ** 2

    def read(self, electrons: Floats, time_s: Each, rng: Random, taken_off: Each = 0.0) -> Readings:
        """Readings of mean primary electrons (frames, ...); see `Sensor.read`."""
        return self.sensor.read(self, electrons, time_s, rng, taken_off)

    def dark_electrons(self, time_s: float) -> float:
        """Mean dark electrons in a window."""
        return self.sensor.dark_rate_hz * time_s

    def amplifier_noise_electrons(self, time_s: ArrayLike) -> Any:
        """Rms charge of the amplifier's white current noise in windows: (i_n / q M) √(T/2)."""
        if self.amplifier is None:
            return np.zeros(np.shape(time_s))[()]
        current = self.amplifier.noise_pa_per_sqrt_hz * 1e-12
        return current * np.sqrt(np.divide(time_s, 2)) / (elementary_charge * self.sensor.gain)

    def electronics_noise_electrons(self, time_s: ArrayLike) -> Any:
        """Rms noise of amplifier and converter per reading."""
        steps = 0.0 if self.adc is None else self.adc.quantisation_noise_electrons
        return np.hypot(self.amplifier_noise_electrons(time_s), steps)

    @model_validator(mode="after")
    def _lens_is_stated_once(self) -> Detector:
        if (self.f_number is None) == (self.aperture_diameter_mm is None):
            raise InputError("needs either f_number or aperture_diameter_mm")
        max_mm = 2e3 * math.sqrt(self._max_aperture_m2 / math.pi)
        if self.aperture_diameter_mm is not None and self.aperture_diameter_mm > max_mm:
            raise InputError(
                f"aperture_diameter_mm {self.aperture_diameter_mm} and field_of_view_deg "
                f"{self.field_of_view_deg} exceed the étendue of the sensor: at most "
                f"{max_mm:.4g} mm, with a lens of f/{MIN_F_NUMBER}"
            )
        return self

    @field_validator("positions_m")
    @classmethod
    def _near_the_projector(cls, positions: tuple[Vector, ...]) -> tuple[Vector, ...]:
        for position in positions:
            if math.hypot(*position) > MAX_DISTANCE_M:
                raise InputError(
                    f"should be within {MAX_DISTANCE_M:g} m of the projector, the origin"
                )
        return positions

    @model_validator(mode="after")
    def _charge_is_amplified_and_converted(self) -> Detector:
        counts = self.sensor.counts
        for name in ("amplifier", "adc"):
            if (getattr(self, name) is None) != counts:
                verb = "counts pulses and has no" if counts else "needs an"
                raise InputError(f"a {self.sensor.type} sensor {verb} {name}")
        return self


class BucketDetector(Detector):
    """The single-pixel detector: equal photodiodes along the optical axis, currents added."""

    positions_m: Annotated[tuple[Vector, ...], Field(min_length=1, max_length=64)]
    """Positions of the photodiodes, optical frame; their currents add up."""


class TofDetector(Detector):
    """The photodiodes of the spots.

    One per spot, facing along its laser; or one for all, facing along the optical axis, for which
    the lasers fire in turn. With `zones`, the one receiver of all.
    """

    positions_m: Annotated[tuple[Vector, ...], Field(min_length=1, max_length=MAX_SPOTS)]
    """Positions, optical frame: one per laser, in order, or one for all."""

    @model_validator(mode="after")
    def _noise_is_white(self) -> TofDetector:
        if self.amplifier is not None and not self.amplifier.is_steady:
            raise InputError(
                "amplifier.corner_hz and drift_pa_per_min should be 0: ranging modulates its light "
                "far above them"
            )
        return self
