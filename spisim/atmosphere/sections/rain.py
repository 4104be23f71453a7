"""Rain in scene files."""

from pathlib import Path

from spisim.atmosphere import precipitation
from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.precipitation import LABORATORY_KG_PER_M3, Precipitation
from spisim.atmosphere.rain import Diffraction, rain
from spisim.atmosphere.weather import Falling
from spisim.base.config import Positive


class Rain(Falling):
    """Rain of a rate."""

    of_medium = frozenset({"diffraction"})
    of_drops = Falling.of_drops | {"air_density_kg_m3"}
    kind: str = "marshall-palmer"
    """Drop size distribution."""
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
        return rain(rate, kind, wavelength_nm=wavelength_nm, diffraction=self.diffraction)


WEATHER = Rain
