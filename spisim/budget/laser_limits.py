"""Limits of laser classes by IEC 60825-1:2014, for a point source. No certification.

Up to 1400 nm light reaches the retina, and the limits are its; C4 is for how little the pigments
behind it absorb, C7 for how much the eye in front does. Beyond, the cornea stops the light, and the
limits follow from the exposure limits of Directive 2006/25/EC: between 1500 and 1800 nm 10⁴ J/m² up
to 10 s and 1000 W/m² for longer, through an aperture of 1 mm up to 0.35 s, 1.5 t^0.375 mm up to
10 s and 3.5 mm for longer.
"""

from reconstruction.base.errors import InputError

#: Wavelengths that these limits are for.
FIRST_NM, LAST_NM = 700.0, 1800.0
RETINA_UP_TO_NM = 1400.0
MIN_PULSE_S = 1e-9
POWER_3B_W = 0.5
#: Pulses within 100 s that do not lower the retina's limit, and the minimum that remains of it.
FREE_PULSES, MIN_C5 = 600, 0.4
TIME_BASE_S = 100.0


def accessible_energy_j(time_s: float, wavelength_nm: float) -> float:
    """Class 1 energy limit for a time from 10 ps; InputError outside 700 to 1800 nm."""
    if not FIRST_NM <= wavelength_nm <= LAST_NM:
        raise InputError(
            f"wavelength_nm should lie between {FIRST_NM:g} and {LAST_NM:g} for laser classes; "
            f"found {wavelength_nm:g}"
        )
    if wavelength_nm < RETINA_UP_TO_NM:
        return min(_retinal_j(time_s, wavelength_nm), class_3b_energy_j(time_s, wavelength_nm))
    if wavelength_nm < 1500:
        return _corneal_j_below_1500(time_s)
    return _corneal_j(time_s)


def class_3b_energy_j(time_s: float, wavelength_nm: float) -> float:
    """Class 3B energy limit for a time."""
    pulse_j = 0.03 * _c4(wavelength_nm) if wavelength_nm < RETINA_UP_TO_NM else 0.125
    if time_s < MIN_PULSE_S:
        return pulse_j / MIN_PULSE_S * time_s
    return max(pulse_j, POWER_3B_W * time_s)


def merging_time_s(wavelength_nm: float) -> float:
    """T_i: pulses within it count as one for the retina; 0 beyond 1400 nm."""
    if wavelength_nm >= RETINA_UP_TO_NM:
        return 0.0
    return 5e-6 if wavelength_nm < 1050 else 13e-6


def repeated_pulse_factor(rate_hz: float, wavelength_nm: float) -> float:
    """C5: remaining fraction of a single pulse's limit, for 100 s of pulses up to T_i."""
    merging_s = merging_time_s(wavelength_nm)
    if merging_s == 0:
        return 1.0
    pulses = TIME_BASE_S * min(rate_hz, 1 / merging_s)
    return 1.0 if pulses <= FREE_PULSES else max(5 * pulses**-0.25, MIN_C5)


def _retinal_j(time_s: float, wavelength_nm: float) -> float:
    c4, c7 = _c4(wavelength_nm), _c7(wavelength_nm)
    if time_s > 10:
        return 3.9e-4 * c4 * c7 * time_s
    short_j, longer = (7.7e-8 * c4, 7e-4 * c4) if wavelength_nm < 1050 else (7.7e-7, 3.5e-3)
    if time_s <= merging_time_s(wavelength_nm):
        return short_j * c7
    return float(longer * c7 * time_s**0.75)


def _c4(wavelength_nm: float) -> float:
    return float(min(10 ** (0.002 * (wavelength_nm - 700)), 5.0))


def _c7(wavelength_nm: float) -> float:
    if wavelength_nm <= 1150:
        return 1.0
    if wavelength_nm <= 1200:
        return float(10 ** (0.018 * (wavelength_nm - 1150)))
    return float(8 + 10 ** (0.04 * (wavelength_nm - 1250)))


def _corneal_j_below_1500(time_s: float) -> float:
    """1400 to 1500 nm: 0.8 mJ from 1 ns to 1 ms."""
    if time_s < MIN_PULSE_S:
        return 8e5 * time_s
    if time_s <= 1e-3:
        return 8e-4
    if time_s <= 0.35:
        return float(4.4e-3 * time_s**0.25)
    return 1e-2 * time_s


def _corneal_j(time_s: float) -> float:
    """1500 to 1800 nm: 8 mJ from 1 ns to 0.35 s."""
    if time_s < MIN_PULSE_S:
        return 8e6 * time_s
    if time_s <= 0.35:
        return 8e-3
    if time_s <= 10:
        return float(1.8e-2 * time_s**0.75)
    return 1e-2 * time_s
