"""Weather: dust, grey at every wavelength."""

from spisim.atmosphere import explicit
from spisim.atmosphere.phase import henyey_greenstein
from spisim.atmosphere.weather import Weather
from spisim.base.config import Positive


class Dust(Weather):
    """Mineral dust by its mass: 0.6 m² per gram."""

    mass_g_per_m3: Positive

    def made(self, folder, wavelength_nm):
        return explicit(0.6 * self.mass_g_per_m3, 0.9, henyey_greenstein(0.7))
