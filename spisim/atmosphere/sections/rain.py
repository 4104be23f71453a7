"""Rain in scene files."""

from __future__ import annotations

from pathlib import Path

from pydantic import model_validator
from pydantic_core import PydanticCustomError

from spisim.atmosphere import precipitation
from spisim.atmosphere.fall_speed import LABORATORY_KG_PER_M3
from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.precipitation import Precipitation
from spisim.atmosphere.rain import Diffraction, MeasuredDrops, rain
from spisim.atmosphere.spectrum import read_drops
from spisim.atmosphere.weather import Falling
from spisim.base.config import Name, Positive


class Rain(Falling):
    """Rain of a rate."""

    of_medium = frozenset({"diffraction", "spectrum"})
    of_drops = Falling.of_drops | {"air_density_kg_m3"}
    kind: str = "marshall-palmer"
    """Drop size distribution."""
    spectrum: Name | None = None
    """File of a measured drop size distribution instead of a `kind`; goes with `medium`."""
    diffraction: Diffraction = "remove"
    """Whether light diffracted by a milliradian counts as lost; goes with `medium`."""
    air_density_kg_m3: Positive = LABORATORY_KG_PER_M3
    """Density of the air, in which drops fall the faster the thinner it is; goes with `drops`."""

    def made(self, folder: Path, wavelength_nm: float) -> Atmosphere | Precipitation:
        """The mean over very many drops, or single drops; see `Weather.made`."""
        rate, kind = self.rate_mm_per_h, self.kind
        if self.model == "drops":
            return precipitation.rain(
                rate,
                kind,
                wavelength_nm=wavelength_nm,
                wind_m_s=self.wind_m_s,
                air_density_kg_m3=self.air_density_kg_m3,
            )
        drops = kind if self.spectrum is None else MeasuredDrops(read_drops(folder / self.spectrum))
        return rain(rate, drops, wavelength_nm=wavelength_nm, diffraction=self.diffraction)

    @model_validator(mode="after")
    def _one_distribution(self) -> Rain:
        if {"kind", "spectrum"} <= self.model_fields_set:
            raise PydanticCustomError("rain", "needs kind or spectrum, not both")
        return self


WEATHER = Rain
