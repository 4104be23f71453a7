"""Snow in scene files."""

from pathlib import Path
from typing import Annotated

from pydantic import Field

from spisim.atmosphere import precipitation
from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.precipitation import FLAKE_KG_PER_M3, FLAKE_SPEED_M_S, Precipitation
from spisim.atmosphere.snow import SNOW_G, snow
from spisim.atmosphere.weather import Falling
from spisim.base.config import Fraction, Number, Positive


class Snow(Falling):
    """Snow of a rate (as water), "wet" or "dry", with assumed scattering and flakes."""

    of_medium = frozenset({"kind"})
    of_drops = Falling.of_drops | {"flake_density_kg_m3", "fall_speed_m_s"}
    kind: str = "wet"
    """wet or dry; goes with `medium`."""
    albedo: Fraction | None = None
    """Scattered fraction of the extinction; by default from the absorption of ice."""
    g: Annotated[Number, Field(gt=-1, lt=1)] = SNOW_G
    """Mean cosine of the scattering angle."""
    flake_density_kg_m3: Positive = FLAKE_KG_PER_M3
    """Density of flakes; goes with `drops`."""
    fall_speed_m_s: Positive = FLAKE_SPEED_M_S
    """Fall speed of flakes; goes with `drops`."""

    def made(self, folder: Path, wavelength_nm: float) -> Atmosphere | Precipitation:
        """The mean over very many flakes, or single flakes; see `Weather.made`."""
        rate, nm = self.rate_mm_per_h, wavelength_nm
        if self.model == "medium":
            return snow(rate, self.kind, wavelength_nm=nm, albedo=self.albedo, g=self.g)
        names = self.model_fields_set & {"albedo", "g", "flake_density_kg_m3", "fall_speed_m_s"}
        assumed = {name: getattr(self, name) for name in names}
        return precipitation.snow(rate, wavelength_nm=nm, wind_m_s=self.wind_m_s, **assumed)


WEATHER = Snow
