"""Weather of many kinds at one wavelength, to compare wavelengths by."""

from spisim.atmosphere.fog import fog
from spisim.atmosphere.medium import Atmosphere
from spisim.atmosphere.rain import rain
from spisim.atmosphere.snow import snow


def typical_weather(wavelength_nm: float) -> dict[str, Atmosphere]:
    """Fogs, hazes, smokes, rain and snow by what they are called.

    Raises InputError for a wavelength that rain is not tabulated at.
    """
    return {
        "heavy advection fog, 50 m": fog(50, "heavy-advection", wavelength_nm=wavelength_nm),
        "moderate radiation fog, 50 m": fog(50, "moderate-radiation", wavelength_nm=wavelength_nm),
        "haze M, 1 km": fog(1000, "haze-m", wavelength_nm=wavelength_nm),
        "haze L, 1 km": fog(1000, "haze-l", wavelength_nm=wavelength_nm),
        "glycol smoke, 20 m": fog(20, "glycol", wavelength_nm=wavelength_nm),
        "soot, 20 m": fog(20, "soot", wavelength_nm=wavelength_nm),
        "biomass smoke, 20 m": fog(20, "biomass", wavelength_nm=wavelength_nm),
        "rain, 25 mm/h": rain(25, wavelength_nm=wavelength_nm),
        "wet snow, 2.5 mm/h": snow(2.5, wavelength_nm=wavelength_nm),
    }
