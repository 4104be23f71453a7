"""What a wavelength means for an instrument beside the weather: sunlight, eyes, water and ice."""

from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere import refractive_index
from spisim.budget.laser_limits import accessible_energy_j
from spisim.scene.sun import in_band_irradiance

#: Those of lidars and cameras that are compared, and that all tables know.
WAVELENGTHS_NM = (850, 905, 940, 1460, 1550)
#: Width of the band that sunlight is the mean of.
SUN_BAND_NM = 12.0
CONTINUOUS_S, PULSE_S = 100.0, 1e-8


def wavelength_figures(wavelength_nm: int) -> dict[str, float]:
    """Sunlight, class 1 limits and absorption at one of `WAVELENGTHS_NM`, as plain numbers.

    Raises InputError for another wavelength.
    """
    if wavelength_nm not in WAVELENGTHS_NM:
        candidate = nearest(str(wavelength_nm), map(str, WAVELENGTHS_NM))
        raise InputError(f"wavelength_nm {wavelength_nm}: {candidate}")
    mean_w, pulse_j = class_1_limits(wavelength_nm)
    return {
        "sun_w_per_m2_nm_100klx": sun_w_per_m2_nm_100klx(wavelength_nm),
        "class_1_mean_w": mean_w,
        "class_1_pulse_j": pulse_j,
        "water_k": -refractive_index("water", wavelength_nm).imag,
        "ice_k": -refractive_index("ice", wavelength_nm).imag,
    }


def sun_w_per_m2_nm_100klx(wavelength_nm: float) -> float:
    """Daylight, W m⁻² nm⁻¹ for 100 klx, mean over 12 nm around a wavelength.

    905 and 940 nm lie in bands of water vapour, 1460 nm in a deep one; a few nm further on, or in
    drier air, there is up to twice as much.
    """
    half = SUN_BAND_NM / 2
    band = (wavelength_nm - half, wavelength_nm + half)
    return in_band_irradiance(100.0, band) / SUN_BAND_NM


def class_1_limits(wavelength_nm: float) -> tuple[float, float]:
    """Mean power (W) of a beam left on, and energy (J) of one pulse of nanoseconds, of class 1.

    See `accessible_energy_j`; trains of pulses have limits of their own.
    """
    mean_w = accessible_energy_j(CONTINUOUS_S, wavelength_nm) / CONTINUOUS_S
    return mean_w, accessible_energy_j(PULSE_S, wavelength_nm)
