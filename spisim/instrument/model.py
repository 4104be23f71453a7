"""The whole instrument."""

from __future__ import annotations

from typing import Annotated, Any

import yaml
from pydantic import Field, model_validator
from scipy.constants import c, elementary_charge, h

from reconstruction.errors import InputError
from reconstruction.patterns import PatternPlan, make_plan
from spisim.config import Number, Positive, Section
from spisim.instrument.parts import BucketDetector, Filter, Lasers, Plan, Projector, Tof
from spisim.scene.sun import in_band_irradiance


def _pattern_period(fields: dict[str, Any]) -> float:
    return 1.0 / fields["projector"].pattern_rate_hz


class Instrument(Section):
    """An instrument: projector and bucket detector, lasers and time-of-flight detectors.

    Materials, fog and sun are tabulated around 1550 nm, so the wavelength is bound to 1500 to
    1600 nm. `exposure_time_s` is the part of a pattern's period in which the bucket collects.
    """

    wavelength_nm: Annotated[Number, Field(ge=1500, le=1600)]
    projector: Projector
    plan: Plan
    filter: Filter
    detector: BucketDetector
    lasers: Lasers
    tof: Tof
    exposure_time_s: Positive = Field(default_factory=_pattern_period)

    @property
    def text(self) -> str:
        """YAML that loads as this very instrument."""
        return yaml.safe_dump(self.model_dump(mode="json"), sort_keys=False)

    @property
    def pattern_plan(self) -> PatternPlan:
        """The patterns of one frame."""
        return make_plan(
            self.projector.shape, self.plan.patterns, self.plan.order, self.plan.polarity
        )

    @property
    def quantum_efficiency(self) -> float:
        """Of the bucket's photodiode at `wavelength_nm`: responsivity · h c / (q λ)."""
        photon_energy = h * c / (self.wavelength_nm * 1e-9)
        return self.detector.responsivity_a_per_w * photon_energy / elementary_charge

    def daylight_irradiance(self, illuminance_klx: float) -> float:
        """Irradiance, W/m², of daylight within the filter's band, in front of the filter."""
        return in_band_irradiance(illuminance_klx, self.filter.band_nm)

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
        return self

    @model_validator(mode="after")
    def _exposure_fits_a_pattern(self) -> Instrument:
        period = 1 / self.projector.pattern_rate_hz
        if self.exposure_time_s > period * (1 + 1e-9):
            raise InputError(
                f"exposure_time_s {self.exposure_time_s} is longer than a pattern's period "
                f"{period:.6g}, 1 / projector.pattern_rate_hz"
            )
        return self

    @model_validator(mode="after")
    def _one_electron_per_photon_at_most(self) -> Instrument:
        limit = elementary_charge * self.wavelength_nm * 1e-9 / (h * c)
        for name, detector in (("detector", self.detector), ("tof.detector", self.tof.detector)):
            if detector.responsivity_a_per_w > limit:
                raise InputError(
                    f"{name}.responsivity_a_per_w {detector.responsivity_a_per_w} is more than one "
                    f"electron per photon, {limit:.4g} A/W"
                )
        return self
