"""Daylight given in lux, as in-band irradiance in the near infrared."""

from functools import cache
from pathlib import Path

import numpy as np
from scipy.integrate import cumulative_trapezoid

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config import load_yaml


@cache
def daylight_spectrum() -> tuple[Floats, Floats, float]:
    """Daylight spectrum: ASTM G173-03, global.

    Returns
    -------
    wavelengths : (n,) array
        nm.
    irradiance : (n,) array
        W m⁻² nm⁻¹.
    illuminance : float
        klx of this spectrum.
    """
    table = load_yaml(Path(__file__).with_name("sun.yaml").read_text(encoding="utf-8"), "sun")
    irradiance = np.asarray(table["irradiance_w_per_m2_nm"], float)
    first, last = table["wavelengths_nm"]
    wavelengths = np.linspace(first, last, irradiance.size)
    return wavelengths, irradiance, table["illuminance_klx"]


def in_band_irradiance(illuminance_klx: float, band_nm: tuple[float, float]) -> float:
    """In-band irradiance, W/m², of daylight.

    Sun and sky both have the spectrum of ASTM G173-03 global: 2.967 W/m² per 100 klx between 1544
    and 1556 nm. The blue light of a clear sky has about a quarter of that per lux, an overcast sky
    about all of it. Lamps are not daylight: per lux, white LEDs have next to nothing there,
    incandescent lamps eleven times as much.

    Parameters
    ----------
    illuminance_klx : float
        Of daylight.
    band_nm : (float, float)
        Lower and upper wavelength, within 800 to 1600 nm.

    Raises
    ------
    InputError
        For another band.
    """
    wavelengths, irradiance, klx = daylight_spectrum()
    low, high = band_nm
    if not wavelengths[0] <= low < high <= wavelengths[-1]:
        raise InputError(
            f"band_nm should rise within {wavelengths[0]:.0f} to {wavelengths[-1]:.0f} nm; "
            f"found {low} to {high}"
        )
    below = cumulative_trapezoid(irradiance, wavelengths, initial=0)
    in_band = np.interp(high, wavelengths, below) - np.interp(low, wavelengths, below)
    return float(in_band) * illuminance_klx / klx
