"""The whole instrument."""

from __future__ import annotations

import math
from functools import cached_property
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator

from reconstruction.arrays import Floats
from reconstruction.capture.spots import SpotOptics
from reconstruction.errors import InputError
from reconstruction.notebook import drawing, figure, shown, told
from reconstruction.operators import PatternPlan, mean_illumination
from reconstruction.ranging.weather import VISIBILITIES_M, Weather
from spisim.config import Number, Positive, Section, dump_yaml, parse_model
from spisim.instrument.demodulation import PICTURE_HARMONICS
from spisim.instrument.detector import BucketDetector, Detector
from spisim.instrument.parts import Filter, Lasers, Plan, Projector
from spisim.instrument.sensor import quantum_efficiency
from spisim.instrument.tofs import AnyTof
from spisim.scene.sun import daylight_spectrum, in_band_irradiance

Source = Literal["projector", "laser", "daylight"]
Visibility = Annotated[Number, Field(ge=VISIBILITIES_M[0], le=VISIBILITIES_M[1])]

#: Wavelengths at which a spectrum within the filter's band is weighted.
BAND_POINTS = 49
#: Time constants that a pattern's period must last, so that a pattern is felt in the next one only.
SETTLING_TIMES = 5


class EyeSafety(Section):
    """The classes that the maker declares; `spisim budget` computes and compares them."""

    laser_class: Literal["1", "3R", "3B", "4"] | None = None
    """By IEC 60825-1."""
    risk_group: Literal["exempt", "1", "2", "3"] | None = None
    """Of the projector, by IEC 62471."""


def _stated_weather(weather: Any) -> Any:
    Weather.parsed(weather)  # an InputError names all that is allowed
    return weather


def _pattern_period(fields: dict[str, Any]) -> float:
    return 1.0 / fields["projector"].pattern_rate_hz


class Instrument(Section):
    """An instrument: projector and bucket detector, lasers and time-of-flight detectors.

    Daylight is tabulated from 800 to 1600 nm, so the filter's band is bound to that. What a scene
    knows the materials at is up to the scene. `exposure_time_s` is the part of a pattern's period,
    its end, in which the bucket collects.
    """

    wavelength_nm: Annotated[Number, Field(ge=800, le=1600)]
    """Of lasers and patterns; within the filter's band."""
    projector: Projector
    """The LED array."""
    plan: Plan
    """The patterns that it shows."""
    filter: Filter
    """The band-pass in front of all detectors."""
    detector: BucketDetector
    """The single-pixel detector of the patterns."""
    lasers: Lasers
    """The four beams."""
    tof: AnyTof
    """How the four spots are ranged."""
    weather: Annotated[
        Literal["unknown", "clear", "fog"] | Visibility, BeforeValidator(_stated_weather)
    ] = "unknown"
    """What ranges take for granted of the weather: that nothing is known, clear air, fog, or a
    visibility in metres. Captures state it; it changes no light."""
    eye_safety: EyeSafety = EyeSafety()
    """What the maker declares; it is compared, and changes nothing else."""
    exposure_time_s: Positive = Field(default_factory=_pattern_period)
    """The end of a pattern's period, in which the detector collects; all of it without."""

    def _repr_html_(self) -> str:
        projector = self.projector
        size = np.array([projector.tan_half_width, projector.tan_half_height])
        spots = self.lasers.directions
        spots = spots[:, :2] / spots[:, 2:] * (1, -1)
        wide = 1.1 * float(max(size.max(), np.abs(spots).max()))
        line = f'stroke-width="{wide / 100:.4g}"'
        (x, y), (width, height) = -size, 2 * size
        drawn = [
            f'<rect x="{x:.5g}" y="{y:.5g}" width="{width:.5g}" height="{height:.5g}" {line}/>'
        ]
        drawn += [
            f'<circle cx="{x:.5g}" cy="{y:.5g}" r="{wide / 30:.4g}" stroke="crimson" {line}/>'
            for x, y in spots
        ]
        field = figure(drawing(drawn, (-wide, -wide), (wide, wide)), "field, and spots in red")
        return shown("Instrument", self._facts, [field])

    def __repr__(self) -> str:
        return told("Instrument", self._facts)

    __str__ = __repr__

    @property
    def _facts(self) -> dict[str, Any]:
        projector, plan = self.projector, self.pattern_plan
        return {
            "wavelength": f"{self.wavelength_nm:g} nm",
            "patterns": f"{plan.sampled} of {plan.shape[0]} × {plan.shape[1]} pixels, {plan.basis}",
            "frame": f"{1e3 * self.frame_time_s:.4g} ms",
            "projector": f"{projector.power_w:g} W over {projector.fov_deg:g}°",
            "detector": f"{self.detector.sensor.type}, {self.detector.field_of_view_deg:g}°",
            "lasers": f"4 × {1e3 * self.lasers.power_w:g} mW",
            "ranging": self.tof.method,
        }

    @property
    def text(self) -> str:
        """YAML that loads as this very instrument."""
        return dump_yaml(self._fields)

    @property
    def _fields(self) -> dict[str, Any]:
        return self.model_dump(mode="json", exclude_none=True)

    def at_wavelength(self, wavelength_nm: float) -> Instrument:
        """The same instrument built for another wavelength.

        Filter and LED spectrum move along and keep their widths, powers stay. Detectors keep their
        quantum efficiency, but for tables that cover the new band, which hold: how well a real
        photodiode does elsewhere is up to its material.

        Raises InputError for a wavelength or a band outside 800 to 1600 nm.
        """
        moved_nm = wavelength_nm - self.wavelength_nm
        low, high = self.filter.band_nm
        band_nm = low + moved_nm, high + moved_nm
        fields = self._fields
        fields["wavelength_nm"] = float(wavelength_nm)
        fields["filter"]["band_nm"] = list(band_nm)
        if self.projector.spectrum is not None:
            fields["projector"]["spectrum"]["peak_nm"] += moved_nm
        for part, detector in ((fields, self.detector), (fields["tof"], self.tof.detector)):
            sensor = detector.sensor.at_band(band_nm, self.wavelength_nm, wavelength_nm)
            part["detector"]["sensor"] = sensor.model_dump(mode="json")
        source = f"instrument at {wavelength_nm:g} nm"
        return parse_model(dump_yaml(fields), Instrument, source)

    def with_laser_power(self, power_w: float) -> Instrument:
        """The same instrument with lasers of another power each.

        Raises InputError for a power that is not positive and finite.
        """
        fields = self._fields
        fields["lasers"]["power_w"] = float(power_w)
        return parse_model(dump_yaml(fields), Instrument, f"instrument of {power_w:g} W")

    @property
    def pattern_plan(self) -> PatternPlan:
        """The patterns of the first frame."""
        return self.pattern_plans[0]

    @cached_property
    def pattern_plans(self) -> tuple[PatternPlan, ...]:
        """The patterns of successive frames, over and over: one plan where all show the same."""
        return self.plan.cycle(self.projector.shape)

    def __copy__(self) -> Self:
        """Without patterns: a copy may get another plan."""
        copied = super().__copy__()
        copied.__dict__.pop("pattern_plans", None)
        return copied

    @property
    def pattern_period_s(self) -> float:
        """From one pattern to the next."""
        return 1 / self.projector.pattern_rate_hz

    @property
    def frame_time_s(self) -> float:
        """Duration of one frame of patterns."""
        return self.pattern_plan.exposures / self.projector.pattern_rate_hz

    def exposure_times_s(self, frames: int) -> Floats:
        """Middle of every exposure of a recording, (frames, M), from the first one's start."""
        exposures = self.pattern_plan.exposures
        middles: Floats = np.arange(frames * exposures, dtype=np.float64) + 0.5
        return middles.reshape(frames, exposures) / self.projector.pattern_rate_hz

    @property
    def tap_frequencies_hz(self) -> tuple[float, ...]:
        """Of a modulated projector: every harmonic that its taps respond to."""
        modulation = self.projector.modulation
        if modulation is None:
            return ()
        orders = modulation.orders(PICTURE_HARMONICS)
        return tuple(float(order) * modulation.frequencies_hz[0] for order in orders)

    @property
    def pixel_powers_w(self) -> Floats:
        """In-band power (H, W) of each virtual pixel, fully on, in front of the filter."""
        return self.projector.power_w * self.in_band_fraction * self.projector.pixel_shares

    @property
    def mean_powers_w(self) -> Floats:
        """The same (H, W) on average over all that is displayed."""
        shares = [mean_illumination(plan) for plan in self.pattern_plans]
        return np.asarray(self.pixel_powers_w * np.mean(shares, axis=0))

    @property
    def in_band_fraction(self) -> float:
        """Share of the projector's power within the filter's band."""
        if self.projector.spectrum is not None:
            return self.projector.spectrum.fraction_within(self.filter.band_nm)
        assert self.projector.in_band_fraction is not None
        return self.projector.in_band_fraction

    def daylight_irradiance(self, illuminance_klx: float) -> float:
        """Irradiance, W/m², of daylight within the filter's band, in front of the filter."""
        return in_band_irradiance(illuminance_klx, self.filter.band_nm)

    def electrons_per_joule(self, detector: Detector, source: Source) -> float:
        """Primary electrons per joule of in-band light on a detector's aperture.

        Through lens and filter; the sensor's response is weighted with the spectrum of the source.
        """
        wavelengths, weights = self._in_band_spectrum(source)
        response = detector.sensor.electrons_per_joule(wavelengths) @ weights
        return float(self.filter.transmittance * detector.lens_transmittance * response)

    @property
    def spot_optics(self) -> SpotOptics:
        """Lasers and ranging detectors, as captures tell of them."""
        detector, directions = self.tof.detector, self.lasers.directions
        ahead = np.array([0.0, 0.0, 1.0])
        return SpotOptics(
            directions=directions,
            detector_positions_m=detector.spot_positions_m,
            detector_axes=np.tile(ahead, (4, 1)) if detector.shared else directions,
            half_fields_rad=np.full(4, math.radians(detector.field_of_view_deg) / 2),
            falloffs=np.full(4, detector.vignetting),
            aperture_radii_m=np.full(4, math.sqrt(detector.aperture_area_m2 / math.pi)),
            beam_divergence_rad=self.lasers.divergence_mrad * 1e-3,
            beam_waist_m=self.lasers.waist_mm * 1e-3,
            electrons_per_joule=self.electrons_per_joule(detector, "laser"),
            **Weather.parsed(self.weather)._asdict(),
        )

    def _in_band_spectrum(self, source: Source) -> tuple[Floats, Floats]:
        """Wavelengths, and weights that sum to one."""
        wavelengths = np.linspace(*self.filter.band_nm, BAND_POINTS)
        if source == "daylight":
            table, irradiance, _ = daylight_spectrum()
            weights = np.interp(wavelengths, table, irradiance)
        elif source == "projector" and self.projector.spectrum is not None:
            weights = self.projector.spectrum.density(wavelengths)
        else:
            return np.array([self.wavelength_nm]), np.ones(1)
        return wavelengths, weights / weights.sum()

    @model_validator(mode="after")
    def _has_a_plan(self) -> Instrument:
        try:
            self.pattern_plan  # noqa: B018 - raises where there is no such plan
        except InputError as error:
            raise InputError(f"plan: {error}") from None
        return self

    @model_validator(mode="after")
    def _wavelength_passes_the_filter(self) -> Instrument:
        try:
            self.daylight_irradiance(1.0)
        except InputError as error:
            raise InputError(f"filter.{error}") from None
        low, high = self.filter.band_nm
        if not low <= self.wavelength_nm <= high:
            raise InputError(
                f"wavelength_nm {self.wavelength_nm} is outside filter.band_nm, {low} to {high}"
            )
        spectrum = self.projector.spectrum
        if spectrum is not None and spectrum.fraction_within(self.filter.band_nm) < 1e-9:
            raise InputError(
                f"projector.spectrum has no light within filter.band_nm, {low} to {high}"
            )
        return self

    @model_validator(mode="after")
    def _exposure_fits_a_pattern(self) -> Instrument:
        if self.exposure_time_s > self.pattern_period_s * (1 + 1e-9):
            raise InputError(
                f"exposure_time_s {self.exposure_time_s} is longer than a pattern's period "
                f"{self.pattern_period_s:.6g}, 1 / projector.pattern_rate_hz"
            )
        return self

    @model_validator(mode="after")
    def _patterns_settle_within_their_period(self) -> Instrument:
        amplifier = self.detector.amplifier
        times_s = {
            "projector.settling_time_s": self.projector.settling_time_s,
            "the time constant of detector.amplifier.bandwidth_hz,": (
                0.0 if amplifier is None else amplifier.time_constant_s
            ),
        }
        for name, time_s in times_s.items():
            if time_s * SETTLING_TIMES > self.pattern_period_s:
                raise InputError(
                    f"{name} {time_s:.4g} s is too long for patterns of "
                    f"{self.pattern_period_s:.4g} s, 1 / projector.pattern_rate_hz: at most "
                    f"{self.pattern_period_s / SETTLING_TIMES:.4g} s"
                )
        return self

    @model_validator(mode="after")
    def _one_electron_per_photon_at_most(self) -> Instrument:
        low, _ = band = self.filter.band_nm
        for name, detector in (("detector", self.detector), ("tof.detector", self.tof.detector)):
            sensor = detector.sensor
            if quantum_efficiency(sensor, np.linspace(*band, BAND_POINTS)).max() > 1:
                raise InputError(f"{name}.sensor.{sensor.too_efficient(low)}")
        return self

    @model_validator(mode="after")
    def _modulated_patterns_are_demodulated(self) -> Instrument:
        modulation, detector = self.projector.modulation, self.detector
        if modulation is None:
            return self
        if detector.amplifier is None:
            raise InputError("projector.modulation needs a detector that integrates charge")
        if detector.amplifier.coupling == "ac":
            raise InputError("projector.modulation needs detector.amplifier.coupling dc")
        if modulation.taps.arrangement == "in-turn":
            raise InputError(
                "projector.modulation.taps.arrangement should be parallel: one exposure holds "
                "all taps"
            )
        if len(modulation.frequencies_hz) > 1:
            raise InputError(
                "projector.modulation.frequencies_hz should be one frequency, that of all patterns"
            )
        if len(modulation.taps.phases_rad) * modulation.taps.share > 1 + 1e-9:
            raise InputError(
                "projector.modulation.taps should share the electrons of an exposure: rectangular, "
                "of width 0.25 at most"
            )
        if self.exposure_time_s * modulation.frequencies_hz[0] < 1:
            raise InputError(
                "projector.modulation.frequencies_hz should fit a period into exposure_time_s "
                f"{self.exposure_time_s:.4g}; at least {1 / self.exposure_time_s:.4g}"
            )
        return self
