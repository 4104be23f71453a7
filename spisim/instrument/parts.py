"""The parts of an instrument, and what follows from their data sheets.

Positions are in the optical frame of the projector: x right, y down, z forward, metres, origin at
its pinhole. Angles named `fov` or `field_of_view` are full angles.
"""

from __future__ import annotations

import math
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import BeforeValidator, Field
from scipy.constants import elementary_charge

from reconstruction.errors import InputError
from spisim.config import Count, NonNegative, Number, Positive, Section, Vector

Angle = Annotated[Number, Field(gt=-90, lt=90)]
PositiveFraction = Annotated[Number, Field(gt=0, le=1)]


class Projector(Section):
    """The LED array and its patterns, seen from the scene as a pinhole."""

    shape: tuple[Count, Count]  # (H, W) virtual pixels, square ones
    fov_deg: Annotated[Number, Field(gt=0, lt=180)]  # full angle across the width
    power_w: Positive  # radiant, with all pixels on
    in_band_fraction: PositiveFraction  # of the power, in front of the filter
    pattern_rate_hz: Positive
    falloff: NonNegative = 0.0  # exponent n of cosⁿθ across the field; 4 for a lens without aids
    lens_radius_m: NonNegative = 0.0  # 0: a pinhole, sharp everywhere
    focus_m: Positive = 1.0  # distance at which a lens is sharp

    @property
    def pixel_powers_w(self) -> NDArray[np.float64]:
        """In-band power (H, W) of each virtual pixel, fully on; `power_w` in all."""
        height, width = self.shape
        x = (2 * (np.arange(width) + 0.5) / width - 1) * self.tan_half_width
        y = (2 * (np.arange(height) + 0.5) / height - 1) * self.tan_half_height
        share = (1 + x**2 + y[:, None] ** 2) ** (-self.falloff / 2)
        return np.asarray(self.power_w * self.in_band_fraction * share / share.sum())

    @property
    def tan_half_width(self) -> float:
        """Half the width of the lit field at unit distance."""
        return math.tan(math.radians(self.fov_deg) / 2)

    @property
    def tan_half_height(self) -> float:
        """Half the height of the lit field at unit distance."""
        height, width = self.shape
        return self.tan_half_width * height / width


def _light_is_not_negative(polarity: Any) -> Any:
    if polarity == "signed":
        raise InputError(
            "signed patterns are differences formed by a recorder; choose differential or "
            "single-ended"
        )
    return polarity


class Plan(Section):
    """Which patterns are shown; see `reconstruction.make_plan`."""

    patterns: Count
    order: str
    polarity: Annotated[
        Literal["differential", "single-ended"], BeforeValidator(_light_is_not_negative)
    ]


class Filter(Section):
    """The band-pass in front of all detectors, as a box."""

    band_nm: tuple[Positive, Positive]
    transmittance: PositiveFraction


class Adc(Section):
    """Analogue-to-digital converter, scaled to photo-electrons."""

    bits: Annotated[int, Field(ge=1, le=31)]
    full_scale_electrons: Positive
    offset_counts: Annotated[int, Field(ge=0)]

    @property
    def max_count(self) -> int:
        """The count of saturation."""
        return 2**self.bits - 1

    @property
    def electrons_per_count(self) -> float:
        """Width of a step."""
        return self.full_scale_electrons / 2**self.bits

    @property
    def quantisation_noise_electrons(self) -> float:
        """Rms error of rounding, a step over √12."""
        return self.electrons_per_count / math.sqrt(12)


class Detector(Section):
    """A photodiode behind a lens, with amplifier and ADC; what bucket and ToF have in common."""

    field_of_view_deg: Annotated[Number, Field(gt=0, le=180)]  # full angle of a hard-edged cone
    vignetting: NonNegative = 0.0  # m: the response falls off with cosᵐ inside the cone
    photoactive_area_mm2: Positive
    fill_factor: PositiveFraction
    f_number: Positive
    lens_transmittance: PositiveFraction
    responsivity_a_per_w: Positive
    dark_current_na: NonNegative
    amplifier_noise_pa_per_sqrt_hz: NonNegative  # one-sided, referred to the photocurrent
    adc: Adc

    @property
    def aperture_area_m2(self) -> float:
        """Area of the entrance aperture that the étendue of photodiode and lens allows.

        A field of half angle θ over an aperture A_ap has the étendue π A_ap sin²θ, and that of a
        photodiode of effective area A·FF behind a lens of f-number N is π A·FF / (4 N²); so
        A_ap = A·FF / (4 N² sin²θ). Narrow fields have large apertures.
        """
        effective = self.photoactive_area_mm2 * 1e-6 * self.fill_factor
        half_angle = math.radians(self.field_of_view_deg) / 2
        return effective / (4 * self.f_number**2 * math.sin(half_angle) ** 2)

    @property
    def electrons_per_joule(self) -> float:
        """Photo-electrons per joule that reaches the photodiode, behind lens and filter."""
        return self.responsivity_a_per_w / elementary_charge

    def dark_electrons(self, time_s: float) -> float:
        """Mean dark count of a window."""
        return self.dark_current_na * 1e-9 * time_s / elementary_charge

    def amplifier_noise_electrons(self, time_s: float) -> float:
        """Rms charge of the amplifier's white current noise in a window: (i_n / q) √(T/2)."""
        current = self.amplifier_noise_pa_per_sqrt_hz * 1e-12
        return current * math.sqrt(time_s / 2) / elementary_charge


class BucketDetector(Detector):
    """The single-pixel detector of the patterns, looking along the optical axis."""

    position_m: Vector


class TofDetector(Detector):
    """Four alike photodiodes, each looking along the direction of its laser."""

    positions_m: Annotated[tuple[Vector, ...], Field(min_length=4, max_length=4)]


class Lasers(Section):
    """Four beams that leave from the projector's pinhole, Gaussian in angle and place."""

    power_w: Positive  # mean, each
    divergence_mrad: NonNegative = 0.0  # standard deviation per axis
    waist_mm: NonNegative = 0.0  # standard deviation per axis of the place of exit
    # azimuth to the right, then elevation up
    directions_deg: Annotated[tuple[tuple[Angle, Angle], ...], Field(min_length=4, max_length=4)]

    @property
    def directions(self) -> NDArray[np.float64]:
        """Unit vectors (4, 3) in the optical frame."""
        azimuth, elevation = np.radians(self.directions_deg).T
        return np.stack(
            [
                np.cos(elevation) * np.sin(azimuth),
                -np.sin(elevation),
                np.cos(elevation) * np.cos(azimuth),
            ],
            axis=-1,
        )


class Tof(Section):
    """Continuous-wave time of flight with four taps a quarter period apart."""

    modulation_frequency_hz: Positive
    periods: Count  # accumulated by each tap, for one frame
    tap_width: PositiveFraction  # of the period
    contrast: PositiveFraction  # of the laser's modulation: amplitude over mean
    detector: TofDetector

    @property
    def tap_phases_rad(self) -> NDArray[np.float64]:
        """Phases (4,) of the taps: 0, 90, 180, 270 degrees."""
        return np.arange(4) * np.pi / 2

    @property
    def tap_time_s(self) -> float:
        """Time for which one tap is open in a frame."""
        return self.periods * self.tap_width / self.modulation_frequency_hz

    @property
    def demodulation_contrast(self) -> float:
        """Amplitude over mean of a tap's signal against phase: contrast · sinc(tap width)."""
        return self.contrast * float(np.sinc(self.tap_width))
