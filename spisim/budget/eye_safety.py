"""Laser class and risk group, as engineering checks without certification.

IEC 60825-1:2014 for the lasers, as point sources, IEC 62471:2006 for the array.

Laser light up to 1400 nm reaches the retina, whose limits apply; C4 is for low absorption by the
pigments behind it, C7 for absorption by the eye in front. Beyond, the cornea absorbs the light, and
limits follow from the exposure limits of Directive 2006/25/EC: between 1500 and 1800 nm 10⁴ J/m² up
to 10 s and 1000 W/m² for longer, through an aperture of 1 mm up to 0.35 s, 1.5 t^0.375 mm up to 10
s and 3.5 mm for longer.
"""

import math
from dataclasses import dataclass
from typing import Literal

import numpy as np

from reconstruction.base.errors import InputError
from spisim.budget.apertures import Worst, flood_fraction, worst_apertures
from spisim.instrument import Emission, Instrument

#: Wavelengths that these limits are for.
MIN_NM, MAX_NM = 700.0, 1800.0
RETINA_UP_TO_NM = 1400.0
MIN_PULSE_S = 1e-9
POWER_3B_W = 0.5
#: Pulses within 100 s that do not lower the retina's limit, and the minimum that remains of it.
FREE_PULSES, MIN_C5 = 600, 0.4
TIME_BASE_S = 100.0

LaserClass = Literal["1", "3R", "3B", "4"]
RiskGroupName = Literal["exempt", "1", "2", "3"]
LASER_CLASSES: tuple[LaserClass, ...] = ("1", "3R", "3B", "4")
RISK_GROUPS: tuple[RiskGroupName, ...] = ("exempt", "1", "2", "3")

#: Measuring distance of lasers for the naked eye, and apertures: a pupil of 7 mm up to 1400 nm, 3.5
#: mm for long exposures of the cornea.
MEASURED_AT_M, PUPIL_M, APERTURE_M = 0.1, 7e-3, 3.5e-3
#: Frames of a scan that are looked at, at least; period above which it counts as standing.
SCANNED, LONGEST = 1024, 4096
#: Class 3R is five times class 1.
TIMES_3R = 5.0
#: Rounding tolerance of a power at its limit.
ROUNDING = 1e-9

#: Distance and exposure limits of risk groups, W/m² at 780 to 3000 nm on cornea and lens: 18000
#: t^-¾ with t = 100 s (group 1) and 10 s (group 2); 100 W/m² from 1000 s on.
ARRAY_AT_M = 0.2
GROUP_LIMITS_W_PER_M2 = (100.0, 18000 * 100**-0.75, 18000 * 10**-0.75)
#: Maximum radiance of infrared light, which causes no aversion response, W m⁻² sr⁻¹ over the
#: source's angle, at any time (section 4.3.6); eye movements smear smaller sources.
RETINA_W_PER_M2_SR, MIN_ANGLE_RAD, MAX_ANGLE_RAD = 6000.0, 0.011, 0.1


@dataclass(frozen=True)
class LaserSafety:
    """Lasers against class 1; margins are value over limit, safe up to 1."""

    laser_class: LaserClass
    beams: int  # within one limiting aperture
    mean_w: float
    pulse_j: float
    mean_margin: float
    pulse_margin: float


@dataclass(frozen=True)
class RiskGroup:
    """The array at 0.2 m with all pixels on.

    `margin` is the irradiance over the exempt group's limit for cornea and lens, `retinal_margin`
    the radiance over the retina's limit, which is that of all groups but the highest.
    """

    risk_group: RiskGroupName
    irradiance_w_per_m2: float
    margin: float
    retinal_margin: float


def laser_safety(instrument: Instrument) -> LaserSafety:
    """Class of the lasers, from single pulses, their train, and 100 s of exposure.

    Beams add up if, 10 cm from their exit, their axes are closer than the limiting aperture plus
    their own width. Steered beams are assessed as standing wherever they may come closest, as after
    a failure of the mirrors (IEC 60825-1:2014, 5.1: reasonably foreseeable faults). If they scan
    and `scan_safeguard` states that light stops with the scan, the aperture sees pulses (4.3 f): a
    frame with a beam in it is one. What comes in within any time has that time's limit, and the
    mean is that over all frames.
    Of a flood only what enters the aperture counts, where it is brightest; as a point source, which
    overstates the hazard of a wide one.

    Raises
    ------
    InputError
        For a wavelength outside 700 to 1800 nm.
    """
    lasers, zones = instrument.ranging.lasers, instrument.ranging.zones
    power_w, worst = lasers.power_w, Worst(1, 1.0, 0.0)
    if zones is not None:
        pupil_rad = math.atan(_limiting_m(instrument) / 2 / MEASURED_AT_M)
        power_w *= flood_fraction(zones, pupil_rad)
    elif _scans(instrument):
        worst = _passes(instrument)
    else:
        beams = _beams_together(instrument)
        worst = Worst(beams, float(beams), 0.0)
    one = instrument.ranging.tof.emission(power_w)
    beams = worst.beams
    together = Emission(beams * one.mean_w, beams * one.pulse_j, one.pulse_s)
    mean_margin, pulse_margin = _margins(one, instrument.wavelength_nm, worst)
    return LaserSafety(
        laser_class=_class(together, max(mean_margin, pulse_margin), instrument.wavelength_nm),
        beams=beams,
        mean_w=together.mean_w,
        pulse_j=together.pulse_j,
        mean_margin=mean_margin,
        pulse_margin=pulse_margin,
    )


def class_1_power_w(instrument: Instrument) -> float:
    """Maximum power of each laser, or of the flood, for class 1."""
    safety = laser_safety(instrument)
    return instrument.ranging.lasers.power_w / max(safety.mean_margin, safety.pulse_margin)


def array_risk_group(instrument: Instrument) -> RiskGroup:
    """Risk group of the projector at 0.2 m, where its brightest pixel falls.

    Real lamps are measured; here the array counts as a uniformly lit lens, or a point without one,
    and all its light as that of the spectrum's peak.
    """
    projector = instrument.imaging.projector
    lit_m2 = 4 * projector.tan_half_width * projector.tan_half_height * ARRAY_AT_M**2
    fractions = projector.pixel_fractions
    return risk_group(
        projector.power_w * float(fractions.max()) * fractions.size / lit_m2,
        projector.spectrum.peak_nm if projector.spectrum else instrument.wavelength_nm,
        2 * projector.lens_radius_m,
    )


def risk_group(
    irradiance_w_per_m2: float, wavelength_nm: float = 1550.0, source_m: float = 0.0
) -> RiskGroup:
    """Risk group from the irradiance at 0.2 m of a source of some diameter.

    The retina has no limit beyond 1400 nm. Below, a source that exceeds it is in the highest group,
    since infrared light causes no aversion response.
    """
    index = int(np.searchsorted(GROUP_LIMITS_W_PER_M2, irradiance_w_per_m2))
    angle = min(max(source_m / ARRAY_AT_M, MIN_ANGLE_RAD), MAX_ANGLE_RAD)
    radiance = irradiance_w_per_m2 / (math.pi / 4 * angle**2)
    retinal = retinal_weight(wavelength_nm) * radiance * angle / RETINA_W_PER_M2_SR
    return RiskGroup(
        RISK_GROUPS[-1 if retinal > 1 else index],
        irradiance_w_per_m2,
        irradiance_w_per_m2 / GROUP_LIMITS_W_PER_M2[0],
        retinal,
    )


def retinal_weight(wavelength_nm: float) -> float:
    """R(λ) of the retinal thermal hazard (IEC 62471:2006, table 4.2), from 700 nm on."""
    if wavelength_nm >= RETINA_UP_TO_NM:
        return 0.0
    if wavelength_nm < 1050:
        return float(10 ** ((700 - wavelength_nm) / 500))
    if wavelength_nm <= 1150:
        return 0.2
    return float(max(0.2 * 10 ** (0.02 * (1150 - wavelength_nm)), 0.02))


def safety_warnings(instrument: Instrument) -> list[str]:
    """Warnings about classes above the declared ones."""
    declared, warnings = instrument.eye_safety, []
    lasers = laser_safety(instrument) if instrument.ranges else None
    array = array_risk_group(instrument) if instrument.images else None
    if lasers and _exceeds(LASER_CLASSES, lasers.laser_class, declared.laser_class):
        warnings.append(
            f"the lasers are of class {lasers.laser_class} by IEC 60825-1, above "
            f"eye_safety.laser_class {declared.laser_class}"
        )
    if array and _exceeds(RISK_GROUPS, array.risk_group, declared.risk_group):
        warnings.append(
            f"the array is in risk group {array.risk_group} by IEC 62471, above "
            f"eye_safety.risk_group {declared.risk_group}"
        )
    return warnings


def _exceeds(classes: tuple[str, ...], computed: str, declared: str | None) -> bool:
    """Whether a class is above the declared one, if any."""
    return declared is not None and classes.index(computed) > classes.index(declared)


def _margins(one: Emission, wavelength_nm: float, worst: Worst) -> tuple[float, float]:
    """Mean power, and merged and repeated pulses, of the worst apertures over limits of class 1.

    What comes in within any time counts as a pulse, too (C5 is 1 for such long ones of a point
    source).
    """
    beams, mean_w = worst.beams, worst.mean * one.mean_w
    mean = mean_w * TIME_BASE_S / accessible_energy_j(TIME_BASE_S, wavelength_nm)
    together = Emission(beams * one.mean_w, beams * one.pulse_j, one.pulse_s)
    pulse = _pulse_margin(together, wavelength_nm, worst.mean / beams)
    return mean, max(pulse, one.mean_w * worst.hazard)


def _pulse_margin(one: Emission, wavelength_nm: float, fraction: float) -> float:
    merging_s = merging_time_s(wavelength_nm)
    limit_j = accessible_energy_j(one.pulse_s, wavelength_nm)
    if one.pulse_s > merging_s:
        return one.pulse_j / limit_j
    merged_j = max(one.pulse_j, one.mean_w * merging_s)
    factor = repeated_pulse_factor(fraction * one.mean_w / one.pulse_j, wavelength_nm)
    return merged_j / (factor * limit_j)


def _class(one: Emission, margin: float, wavelength_nm: float) -> LaserClass:
    """Class from the larger of the margins to class 1."""
    margin -= ROUNDING
    if margin <= 1:
        return "1"
    if margin <= TIMES_3R:
        return "3R"
    within_3b = one.pulse_j <= class_3b_energy_j(one.pulse_s, wavelength_nm)
    return "3B" if within_3b and one.mean_w <= POWER_3B_W else "4"


def _beams_together(instrument: Instrument) -> int:
    """Maximum number of beams within one limiting aperture, wherever their mirrors may stand.

    Exact for beams that keep their pattern; of mirrors that turn on their own, all beams count that
    come closer than the aperture to one.
    """
    lasers, radius_rad = instrument.ranging.lasers, _aperture_rad(instrument)
    home_deg, steering = np.array(lasers.directions_deg), lasers.steering
    if steering is None or steering.mirrors == "common":
        reached = home_deg[None] if steering is None else home_deg + steering.extremes(1)
        return worst_apertures(reached, radius_rad, np.zeros(len(reached))).beams
    highest_deg = np.abs(home_deg + steering.extremes(len(home_deg)))[..., 1].max()
    apart = np.radians(steering.closest_deg(home_deg)) * math.cos(math.radians(highest_deg))
    return int(np.max(np.sum(apart <= 2 * radius_rad, axis=1)))


def _aperture_rad(instrument: Instrument) -> float:
    """Half the angle that the limiting aperture and a beam around its axis take up."""
    lasers = instrument.ranging.lasers
    beam_m = 2e-3 * math.hypot(lasers.waist_mm, lasers.divergence_mrad * MEASURED_AT_M)
    return math.atan((beam_m + _limiting_m(instrument) / 2) / MEASURED_AT_M)


def _limiting_m(instrument: Instrument) -> float:
    """Diameter of the limiting aperture."""
    return PUPIL_M if instrument.wavelength_nm < RETINA_UP_TO_NM else APERTURE_M


def _scans(instrument: Instrument) -> bool:
    """Whether no beam stands, and a scan has been everywhere within the time base."""
    steering = instrument.ranging.lasers.steering
    if steering is None or not steering.is_safeguarded:
        return False
    fits = steering.period * instrument.frame_time_s <= TIME_BASE_S
    return fits and steering.period <= LONGEST


def _passes(instrument: Instrument) -> Worst:
    """Worst apertures of a scan, hazards by energy over the limit, per watt of a beam.

    A beam whose axis lies within half an aperture and its own width counts as a whole, for the
    whole frame.
    """
    lasers, frame_s = instrument.ranging.lasers, instrument.frame_time_s
    assert lasers.steering is not None
    home_deg = np.array(lasers.directions_deg)
    frames = max(SCANNED, lasers.steering.period)
    reached = np.array(
        [home_deg + lasers.steering.aimed(frame, home_deg, None) for frame in range(frames)]
    )
    times_s = frame_s * np.arange(1, frames + 1)
    limits_j = [accessible_energy_j(time_s, instrument.wavelength_nm) for time_s in times_s]
    of_mean = TIME_BASE_S / accessible_energy_j(TIME_BASE_S, instrument.wavelength_nm)
    return worst_apertures(
        reached, _aperture_rad(instrument), frame_s / np.array(limits_j), of_mean
    )


def accessible_energy_j(time_s: float, wavelength_nm: float) -> float:
    """Class 1 energy limit for a time from 10 ps; InputError outside 700 to 1800 nm."""
    if not MIN_NM <= wavelength_nm <= MAX_NM:
        raise InputError(
            f"wavelength_nm should lie between {MIN_NM:g} and {MAX_NM:g} for laser classes; "
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
