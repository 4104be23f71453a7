"""What a wavelength means for an instrument beside the weather: sunlight, eyes, water and ice."""

from __future__ import annotations

from collections.abc import Mapping
from types import MappingProxyType

from reconstruction.errors import InputError, nearest
from spisim.atmosphere import refractive_index

#: Daylight, W m⁻² nm⁻¹ for 100 klx, mean over the 12 nm around each wavelength: ASTM G173-03
#: global, which has 109.5 klx. 905 and 940 nm lie in bands of water vapour, 1460 nm in a deep one;
#: a few nm further on, or in drier air, there is up to twice as much.
SUN_W_PER_M2_NM_100KLX: Mapping[int, float] = MappingProxyType(
    {850: 0.8791, 905: 0.6365, 940: 0.2683, 1460: 0.0964, 1550: 0.2472}
)
WAVELENGTHS_NM = tuple(SUN_W_PER_M2_NM_100KLX)


def wavelength_figures(wavelength_nm: int) -> dict[str, float]:
    """Sunlight, class 1 limits and absorption at one of `WAVELENGTHS_NM`, as plain numbers.

    Raises InputError for another wavelength.
    """
    if wavelength_nm not in SUN_W_PER_M2_NM_100KLX:
        known = nearest(str(wavelength_nm), map(str, WAVELENGTHS_NM))
        raise InputError(f"wavelength_nm {wavelength_nm}: {known}")
    mean_w, pulse_j = class_1_limits(wavelength_nm)
    return {
        "sun_w_per_m2_nm_100klx": SUN_W_PER_M2_NM_100KLX[wavelength_nm],
        "class_1_mean_w": mean_w,
        "class_1_pulse_j": pulse_j,
        "water_k": -refractive_index("water", wavelength_nm).imag,
        "ice_k": -refractive_index("ice", wavelength_nm).imag,
    }


def class_1_limits(wavelength_nm: float) -> tuple[float, float]:
    """Mean power (W) of a beam left on, and energy (J) of one pulse of nanoseconds, of class 1.

    IEC 60825-1:2014 for a point source, 700 to 1050 nm and 1400 to 1800 nm: up to 1050 nm light
    reaches the retina, from 1400 nm on the cornea stops it. An engineering check, no certification;
    trains of pulses have limits of their own.
    """
    if wavelength_nm < 1400:
        transmission = 10 ** (0.002 * (wavelength_nm - 700))  # C4
        return 3.9e-4 * transmission, 7.7e-8 * transmission
    return 1e-2, 8e-4 if wavelength_nm < 1500 else 8e-3
