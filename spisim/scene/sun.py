"""How much of daylight, given in lux, falls into a band of the near infrared."""

from functools import cache
from pathlib import Path

import numpy as np
import yaml
from scipy.integrate import cumulative_trapezoid

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError


@cache
def daylight_spectrum() -> tuple[Floats, Floats, float]:
    """Wavelengths (nm), irradiance (W m⁻² nm⁻¹) and the illuminance (klx) that belongs to it."""
    table = yaml.safe_load(Path(__file__).with_name("sun.yaml").read_text(encoding="utf-8"))
    irradiance = np.asarray(table["irradiance_w_per_m2_nm"], float)
    first, last = table["wavelengths_nm"]
    wavelengths = np.linspace(first, last, irradiance.size)
    return wavelengths, irradiance, table["illuminance_klx"]


def in_band_irradiance(illuminance_klx: float, band_nm: tuple[float, float]) -> float:
    """Irradiance, W/m², between two wavelengths of daylight with this illuminance.

    Spectrum of ASTM G173-03 global, for sun and sky alike: 2.967 W/m² per 100 klx between 1544 and
    1556 nm. A clear sky's own blue light has about a quarter of that per lux, an overcast sky
    about all of it. Lamps are no daylight: the same lux from white LEDs hold next to nothing there,
    from incandescent lamps eleven times as much.

    Raises InputError unless the band lies within 800 to 1600 nm.
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
