"""Rain in scene files."""

from spisim.atmosphere import precipitation
from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.precipitation import Precipitation
from spisim.atmosphere.rain import Diffraction, rain
from spisim.atmosphere.weather import Falling


class Rain(Falling):
    """Rain of a rate; `diffraction` says whether light bent by a milliradian counts as lost."""

    of_medium = frozenset({"diffraction"})
    kind: str = "marshall-palmer"
    diffraction: Diffraction = "remove"

    def medium(self, wavelength_nm: float) -> Atmosphere:
        """The mean over very many drops."""
        return rain(
            self.rate_mm_per_h,
            self.kind,
            wavelength_nm=wavelength_nm,
            diffraction=self.diffraction,
        )

    def drops(self, wavelength_nm: float) -> Precipitation:
        """Single drops."""
        return precipitation.rain(
            self.rate_mm_per_h, self.kind, wavelength_nm=wavelength_nm, wind_m_s=self.wind_m_s
        )


WEATHER = Rain
