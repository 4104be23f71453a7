"""The whole instrument, its files and shipped presets."""

from __future__ import annotations

import math
from dataclasses import replace
from functools import cached_property
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import numpy as np
from pydantic import BeforeValidator, Field, ValidationError, model_validator
from pydantic_core import InitErrorDetails

from reconstruction.base.arrays import Floats, usual_float_errors
from reconstruction.base.display import html_summary, text_summary
from reconstruction.base.errors import InputError
from reconstruction.capture.spots import SpotOptics
from reconstruction.operators import NO_PATTERN, PatternPlan, mean_illumination
from reconstruction.ranging.weather import VISIBILITIES_M, Weather
from spisim.base.config import (
    Number,
    Positive,
    Section,
    check_fields,
    dump_yaml,
    find_named,
    parse_model,
    read_mapping,
    read_text,
)
from spisim.instrument.demodulation import PICTURE_HARMONICS
from spisim.instrument.detector import BucketDetector, Detector
from spisim.instrument.display import facts, field_picture
from spisim.instrument.fitting import BAND_POINTS, Imaging, Ranging, misfits, missing_parts
from spisim.instrument.parts import Filter, Lasers, Plan, Projector, Spectrum
from spisim.instrument.tofs import AnyTof
from spisim.instrument.zones import Zones
from spisim.scene.layout import Needs
from spisim.scene.sun import daylight_spectrum, in_band_irradiance

Source = Literal["projector", "laser", "daylight"]
PRESETS = Path(__file__).with_name("presets")
DETECTOR_PARTS = Path(__file__).with_name("detector_parts.yaml")
#: A spot's range is used up to this fraction of the unambiguous range: noise may exceed it.
WITHIN_RANGE = 0.98
#: Range of the daylight table.
MIN_WAVELENGTH_NM, MAX_WAVELENGTH_NM = 800, 1600
Visibility = Annotated[Number, Field(ge=VISIBILITIES_M[0], le=VISIBILITIES_M[1])]


class EyeSafety(Section):
    """Classes declared by the maker; `spisim budget` computes and compares them."""

    laser_class: Literal["1", "3R", "3B", "4"] | None = None
    """Laser class by IEC 60825-1."""
    risk_group: Literal["exempt", "1", "2", "3"] | None = None
    """Risk group of the projector by IEC 62471."""


def _stated_weather(weather: Any) -> Any:
    Weather.parsed(weather)  # its InputError lists what is allowed
    return weather


def _pattern_period(fields: dict[str, Any]) -> float | None:
    projector: Projector | None = fields["projector"]
    return None if projector is None else 1.0 / projector.pattern_rate_hz


class Instrument(Section):
    """Projector and bucket detector, lasers and ranging detectors, or one of both.

    Daylight is tabulated from 800 to 1600 nm, which bounds the filter's band; the materials of a
    scene may bound the wavelength further. `exposure_time_s` is the end of a pattern's period, in
    which the bucket collects.
    """

    wavelength_nm: Annotated[Number, Field(ge=MIN_WAVELENGTH_NM, le=MAX_WAVELENGTH_NM)]
    """Wavelength of lasers and patterns; within the filter's band."""
    projector: Projector | None = None
    """The LED array; without it, `plan` and `detector` the instrument only ranges."""
    plan: Plan | None = None
    """The patterns exposed."""
    filter: Filter
    """The band-pass filter in front of all detectors."""
    detector: BucketDetector | None = None
    """The single-pixel detector of the patterns."""
    lasers: Lasers | None = None
    """The beams of the spots; without them, `zones` and `tof` there is only an image."""
    zones: Zones | None = None
    """Zones under one flood of light, in place of `lasers`."""
    tof: AnyTof | None = None
    """Time-of-flight method of the spots."""
    weather: Annotated[
        Literal["unknown", "clear", "fog"] | Visibility, BeforeValidator(_stated_weather)
    ] = "unknown"
    """Weather that ranging assumes: unknown, clear, fog, or a visibility in metres. Captures state
    it; it changes no light.
    """
    eye_safety: EyeSafety = EyeSafety()
    """Classes declared by the maker, for comparison only."""
    exposure_time_s: Positive | None = Field(default_factory=_pattern_period)
    """Collection time at the end of a pattern's period; the whole period by default."""

    @property
    def images(self) -> bool:
        """Whether it has a projector and its detector."""
        return self.projector is not None

    @property
    def ranges(self) -> bool:
        """Whether it has lasers or zones, and their detectors."""
        return self.lasers is not None or self.zones is not None

    @property
    def imaging(self) -> Imaging:
        """The parts that make the image; InputError if there are none."""
        if self.projector is None or self.plan is None or self.detector is None:
            raise InputError(
                "the instrument has no image: projector, plan and detector are missing"
            )
        assert self.exposure_time_s is not None
        return Imaging(self.projector, self.plan, self.detector, self.exposure_time_s)

    @property
    def ranging(self) -> Ranging:
        """The parts that range; InputError if there are none."""
        beams = self.lasers or self.zones
        if beams is None or self.tof is None:
            raise InputError("the instrument has no ranges: lasers and tof are missing")
        return Ranging(beams, self.tof)

    def _repr_html_(self) -> str:
        return html_summary("Instrument", self._facts, [field_picture(*self._sides)])

    def __repr__(self) -> str:
        return text_summary("Instrument", self._facts)

    __str__ = __repr__

    @property
    def _facts(self) -> dict[str, Any]:
        return facts(self.wavelength_nm, self.frame_time_s, self.pattern_plan, *self._sides)

    @property
    def _sides(self) -> tuple[Imaging | None, Ranging | None]:
        """The parts that make the image and those that range; None where there are none."""
        return self.imaging if self.images else None, self.ranging if self.ranges else None

    @property
    def text(self) -> str:
        """YAML that loads as this instrument."""
        return dump_yaml(self._fields)

    @property
    def _fields(self) -> dict[str, Any]:
        return self.model_dump(mode="json", exclude_none=True)

    def at_wavelength(self, wavelength_nm: float) -> Instrument:
        """The same instrument built for another wavelength.

        Filter and LED spectrum shift and keep their widths; powers stay. Detectors keep their
        quantum efficiency, unless a table covers the new band: how a real photodiode performs
        elsewhere depends on its material.

        Raises
        ------
        InputError
            For a wavelength or a band outside 800 to 1600 nm.
        """
        source = f"instrument at {wavelength_nm:g} nm"
        if not MIN_WAVELENGTH_NM <= wavelength_nm <= MAX_WAVELENGTH_NM:  # nor nan
            raise InputError(
                f"{source}: wavelength_nm: should be from {MIN_WAVELENGTH_NM} to "
                f"{MAX_WAVELENGTH_NM}; found {wavelength_nm:g}"
            )
        moved_nm = wavelength_nm - self.wavelength_nm
        low, high = self.filter.band_nm
        band_nm = low + moved_nm, high + moved_nm
        fields = self._fields
        fields["wavelength_nm"] = float(wavelength_nm)
        fields["filter"]["band_nm"] = list(band_nm)
        if self._spectrum is not None:
            fields["projector"]["spectrum"]["peak_nm"] += moved_nm
        for name, detector in self.detectors.items():
            part = fields["tof"] if name == "tof.detector" else fields
            sensor = detector.sensor.at_band(band_nm, self.wavelength_nm, wavelength_nm)
            part["detector"]["sensor"] = sensor.model_dump(mode="json")
        return parse_model(dump_yaml(fields), Instrument, source)

    def with_laser_power(self, power_w: float) -> Instrument:
        """The same with another power per laser, or of the flood; InputError unless positive."""
        fields = self._fields
        fields["lasers" if self.ranging.zones is None else "zones"]["power_w"] = float(power_w)
        return parse_model(dump_yaml(fields), Instrument, f"instrument of {power_w:g} W")

    def aimed(self, directions: Floats) -> Instrument:
        """The same instrument with fixed spots along unit vectors (spots, 3).

        Detectors of their own turn with their beams; a shared one does not.
        """
        x, y, z = directions.T
        degrees = np.degrees([np.arctan2(x, z), np.arcsin(-y)]).T
        lasers = self.ranging.lasers.model_copy(
            update={"directions_deg": tuple(map(tuple, degrees.tolist())), "steering": None}
        )
        return self.model_copy(update={"lasers": lasers})

    @property
    def pattern_plan(self) -> PatternPlan:
        """The patterns of the first frame."""
        return self.pattern_plans[0]

    @cached_property
    def pattern_plans(self) -> tuple[PatternPlan, ...]:
        """Plans of successive frames, repeated; a single one if all frames are equal.

        Without an image it is one dark pixel.
        """
        if not self.images:
            return (NO_PATTERN,)
        return self.imaging.plan.cycle(self.imaging.projector.shape)

    @property
    def recorded_plans(self) -> tuple[PatternPlan, ...]:
        """The same as captures state them: without throughput, unless it is calibrated."""
        known = self.plan is None or self.plan.throughput is None or self.plan.throughput.stated
        return tuple(
            each if known else replace(each, throughput=None) for each in self.pattern_plans
        )

    def __copy__(self) -> Self:
        """A copy without the cached patterns: it may get another plan."""
        copied = super().__copy__()
        copied.__dict__.pop("pattern_plans", None)
        return copied

    @property
    def pattern_period_s(self) -> float:
        """Time from one pattern to the next; without an image that of a frame's ranges."""
        return self.imaging.pattern_period_s if self.images else self.ranging.frame_time_s

    @property
    def frame_time_s(self) -> float:
        """Duration of one frame of patterns; without an image that of the ranges."""
        if not self.images:
            return self.ranging.frame_time_s
        return self.pattern_plan.exposures / self.imaging.projector.pattern_rate_hz

    def exposure_times_s(self, frames: int) -> Floats:
        """Middle of each exposure of a recording, (frames, M), s after the start of the first."""
        exposures = self.pattern_plan.exposures
        middles: Floats = np.arange(frames * exposures, dtype=np.float64) + 0.5
        rate_hz = self.imaging.projector.pattern_rate_hz if self.images else 1 / self.frame_time_s
        return middles.reshape(frames, exposures) / rate_hz

    @property
    def tap_frequencies_hz(self) -> tuple[float, ...]:
        """Harmonics of a modulated projector that its taps respond to."""
        modulation = self.imaging.projector.modulation if self.images else None
        if modulation is None:
            return ()
        orders = modulation.orders(PICTURE_HARMONICS)
        return tuple(float(order) * modulation.frequencies_hz[0] for order in orders)

    @property
    def pixel_powers_w(self) -> Floats:
        """In-band power (H, W) of each virtual pixel when lit, in front of the filter."""
        projector = self.imaging.projector
        return projector.power_w * self.in_band_fraction * projector.pixel_fractions

    @property
    def mean_powers_w(self) -> Floats:
        """The same (H, W), averaged over all patterns exposed."""
        fractions = [mean_illumination(plan) for plan in self.pattern_plans]
        return np.asarray(self.pixel_powers_w * np.mean(fractions, axis=0))

    @property
    def in_band_fraction(self) -> float:
        """Fraction of the projector's power within the filter's band."""
        projector = self.imaging.projector
        if projector.spectrum is not None:
            return projector.spectrum.fraction_within(self.filter.band_nm)
        assert projector.in_band_fraction is not None
        return projector.in_band_fraction

    def daylight_irradiance(self, illuminance_klx: float) -> float:
        """In-band irradiance of daylight, W/m², in front of the filter."""
        return in_band_irradiance(illuminance_klx, self.filter.band_nm)

    def electrons_per_joule(self, detector: Detector, source: Source) -> float:
        """Primary electrons per joule of in-band light on a detector's aperture.

        Includes lens and filter, with the sensor's response weighted by the source's spectrum.
        """
        wavelengths, weights = self._in_band_spectrum(source)
        response = detector.sensor.electrons_per_joule(wavelengths) @ weights
        return float(self.filter.transmittance * detector.lens_transmittance * response)

    @property
    def detectors(self) -> dict[str, Detector]:
        """The detectors present, by their fields."""
        detectors = {
            "detector": self.detector,
            "tof.detector": None if self.tof is None else self.tof.detector,
        }
        return {name: each for name, each in detectors.items() if each is not None}

    @property
    def spot_optics(self) -> SpotOptics:
        """Lasers and ranging detectors as captures store them."""
        ranging = self.ranging
        (lasers, tof), receivers = ranging, ranging.receivers
        return SpotOptics(
            directions=lasers.directions,
            detector_positions_m=receivers.positions_m,
            detector_axes=receivers.axes,
            half_fields_rad=np.full(ranging.spots, receivers.half_field_rad),
            falloffs=np.full(ranging.spots, receivers.falloff),
            aperture_radii_m=np.sqrt(receivers.areas_m2 / math.pi),
            beam_divergence_rad=lasers.divergence_mrad * 1e-3,
            beam_waist_m=lasers.waist_mm * 1e-3,
            electrons_per_joule=self.electrons_per_joule(tof.detector, "laser"),
            **Weather.parsed(self.weather)._asdict(),
        )

    @property
    def _spectrum(self) -> Spectrum | None:
        """Spectrum of the projector; None if it is one line, or there is no projector."""
        return self.projector.spectrum if self.projector is not None else None

    def _in_band_spectrum(self, source: Source) -> tuple[Floats, Floats]:
        """Wavelengths, and weights that sum to one."""
        wavelengths = np.linspace(*self.filter.band_nm, BAND_POINTS)
        if source == "daylight":
            table, irradiance, _ = daylight_spectrum()
            weights = np.interp(wavelengths, table, irradiance)
        elif source == "projector" and (spectrum := self._spectrum) is not None:
            weights = spectrum.density(wavelengths)
        else:
            return np.array([self.wavelength_nm]), np.ones(1)
        return wavelengths, weights / weights.sum()

    @model_validator(mode="after")
    def _fits(self) -> Instrument:
        errors = missing_parts(dict(self)) or misfits(
            self.filter,
            self.wavelength_nm,
            *self._sides,
            lambda: self.pattern_plans,
        )
        if errors:
            raise ValidationError.from_exception_data(
                "Instrument",
                [
                    InitErrorDetails(type="value_error", ctx={"error": each}, input=None)
                    for each in errors
                ],
            )
        return self


def list_presets() -> list[str]:
    """Sorted names of the shipped instruments."""
    return sorted(path.stem for path in PRESETS.glob("*.yaml"))


@usual_float_errors
def load_instrument(name_or_path: str | Path) -> Instrument:
    """Load an instrument from a YAML file, or a shipped one by its name ("paper").

    Raises
    ------
    InputError
        Names file, field, value and what is allowed, for a missing file or preset, invalid YAML,
        and fields that are unknown, missing or out of range.
    """
    file = find_named(str(name_or_path), PRESETS, "instrument")
    return parse_model(read_text(file), Instrument, file, file.parent)


def embedded_instrument(text: str, capture: Path | None = None) -> Instrument:
    """Instrument that a capture holds as YAML text, of which no file that it names is opened.

    Patterns of a file are those that the ``capture`` exposed.

    Raises
    ------
    InputError
        As `load_instrument`.
    """
    source = "instrument of the capture"
    fields = read_mapping(text, Instrument, source)
    plan = fields.get("plan")
    if isinstance(plan, dict) and "patterns_file" in plan:
        own = None if capture is None else str(capture.absolute())
        fields["plan"] = plan | {"patterns_file": own}
    return check_fields(fields, Instrument, source)


def needs(instrument: Instrument) -> Needs:
    """Field, beams and detectors that a scene must suit.

    Parameters
    ----------
    instrument : Instrument
        With both image and ranges.

    Returns
    -------
    Needs
        For `spisim.scene.layout.layout_problem`.
    """
    projector, (lasers, tof) = instrument.imaging.projector, instrument.ranging
    return Needs(
        half_field_deg=(
            math.degrees(math.atan(projector.tan_half_width)),
            math.degrees(math.atan(projector.tan_half_height)),
        ),
        beams=lasers.directions,
        farthest_spot_m=WITHIN_RANGE * tof.unambiguous_range_m,
        min_spots=1,
        detectors_m=instrument.ranging.detector_positions_m,
        lens_ring_m=math.sqrt(tof.detector.aperture_area_m2 / (2 * math.pi)),
    )
