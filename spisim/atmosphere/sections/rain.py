"""Rain in scene files."""

from pathlib import Path

from spisim.atmosphere import precipitation
from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.precipitation import Precipitation
from spisim.atmosphere.rain import Diffraction, rain
from spisim.atmosphere.weather import Falling


class Rain(Falling):
    """Rain of a rate."""

    of_medium = frozenset({"diffraction"})
    kind: str = "marshall-palmer"
    """Drop size distribution."""
    diffraction: Diffraction = "remove"
    """Whether light diffracted by a milliradian counts as lost; goes with `medium`."""

    def made(self, folder: Path, wavelength_nm: float) -> Atmosphere | Precipitation:
        """The mean over very many drops, or single drops; see `Weather.made`."""
        rate, kind = self.rate_mm_per_h, self.kind
        if self.model == "drops":
            wind = self.wind_m_s
            return precipitation.rain(rate, kind, wavelength_nm=wavelength_nm, wind_m_s=wind)
        return rain(rate, kind, wavelength_nm=wavelength_nm, diffraction=self.diffraction)


WEATHER = Rain
