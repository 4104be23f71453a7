"""Laser class and risk group, as engineering checks. They are no certification.

IEC 60825-1:2014 for lasers from 1500 to 1800 nm, IEC 62471:2006 for the array. Limits follow from
the exposure limits of Directive 2006/25/EC: 10⁴ J/m² up to 10 s and 1000 W/m² beyond, through an
aperture of 1 mm up to 0.35 s, 1.5 t^0.375 mm up to 10 s and 3.5 mm beyond.
"""

from __future__ import annotations

import math
from dataclasses import dataclass
from functools import singledispatch
from typing import Any, Literal, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spisim.instrument import CwTof, DirectTof, Instrument, PulsedTof

LaserClass = Literal["1", "3R", "3B", "4"]
RiskGroupName = Literal["exempt", "1", "2", "3"]
LASER_CLASSES: tuple[LaserClass, ...] = ("1", "3R", "3B", "4")
RISK_GROUPS: tuple[RiskGroupName, ...] = ("exempt", "1", "2", "3")

#: Distance at which lasers are measured for the naked eye, and the aperture for long exposures.
MEASURED_AT_M, APERTURE_M = 0.1, 3.5e-3
#: Class 3R is five times class 1.
TIMES_3R = 5.0
ENERGY_3B_J, POWER_3B_W, PEAK_3B_W = 0.125, 0.5, 1.25e8
SHORTEST_PULSE_S = 1e-9

#: Distance and exposure limits of risk groups, W/m² at 780 to 3000 nm on cornea and lens:
#: 18000 t^-¾ with t = 100 s (group 1) and 10 s (group 2); 100 W/m² for 1000 s and longer.
ARRAY_AT_M = 0.2
GROUP_LIMITS_W_PER_M2 = (100.0, 18000 * 100**-0.75, 18000 * 10**-0.75)


class Emission(NamedTuple):
    """What one beam sends: its mean power and its pulses."""

    mean_w: float
    pulse_j: float
    pulse_s: float


@dataclass(frozen=True)
class LaserSafety:
    """Lasers against the limits of class 1; margins are value over limit, safe up to 1."""

    laser_class: LaserClass
    beams: int  # that may enter one limiting aperture
    mean_w: float
    pulse_j: float
    mean_margin: float
    pulse_margin: float


@dataclass(frozen=True)
class RiskGroup:
    """The array at 0.2 m, all pixels on; the margin is irradiance over the exempt group's limit."""

    risk_group: RiskGroupName
    irradiance_w_per_m2: float
    margin: float


def accessible_energy_j(time_s: float) -> float:
    """Class 1 limit of the energy within a time, 1500 to 1800 nm: 8 mJ from 1 ns to 0.35 s."""
    if time_s < SHORTEST_PULSE_S:
        return 8e6 * time_s
    if time_s <= 0.35:
        return 8e-3
    if time_s <= 10:
        return 1.8e-2 * time_s**0.75
    return 1e-2 * time_s


def laser_safety(instrument: Instrument) -> LaserSafety:
    """Class of the four lasers: single pulse, and mean power of a beam left on for 100 s.

    Beams count together if their axes are closer to each other than the limiting aperture and
    their own widths, 10 cm from where they leave.
    """
    one = emission(instrument.tof, instrument.lasers.power_w)
    beams = _beams_together(instrument)
    mean_w, pulse_j = beams * one.mean_w, beams * one.pulse_j
    return LaserSafety(
        laser_class=_class(mean_w, pulse_j, one.pulse_s),
        beams=beams,
        mean_w=mean_w,
        pulse_j=pulse_j,
        mean_margin=mean_w / (accessible_energy_j(100.0) / 100.0),
        pulse_margin=pulse_j / accessible_energy_j(one.pulse_s),
    )


@singledispatch
def emission(tof: Any, power_w: float) -> Emission:
    """Mean power, energy and length of the pulses of one beam, taken as always in use."""
    raise TypeError(f"no such method: {tof!r}")


@emission.register
def _(tof: CwTof, power_w: float) -> Emission:
    """Half a period of the slowest modulation has the most light."""
    half_period_s = 0.5 / min(tof.modulation.frequencies_hz)
    return Emission(power_w, power_w * 2 * half_period_s, half_period_s)


@emission.register
def _(tof: PulsedTof, power_w: float) -> Emission:
    energy = power_w * tof.pulse_width_s
    return Emission(energy * tof.repetition_rate_hz, energy, tof.pulse_width_s)


@emission.register
def _(tof: DirectTof, power_w: float) -> Emission:
    energy = power_w * tof.pulse_sigma_s * math.sqrt(2 * math.pi)
    return Emission(energy * tof.repetition_rate_hz, energy, tof.pulse_fwhm_s)


def array_risk_group(instrument: Instrument) -> RiskGroup:
    """Risk group of the projector at 0.2 m, where its brightest pixel falls; all its light counts.

    Risk groups of real lamps are measured; this one takes the array as a point.
    """
    projector = instrument.projector
    lit_m2 = 4 * projector.tan_half_width * projector.tan_half_height * ARRAY_AT_M**2
    shares = projector.pixel_shares
    return risk_group(projector.power_w * float(shares.max()) * shares.size / lit_m2)


def risk_group(irradiance_w_per_m2: float) -> RiskGroup:
    """Risk group by the irradiance at 0.2 m; the retina has no limit beyond 1400 nm."""
    place = int(np.searchsorted(GROUP_LIMITS_W_PER_M2, irradiance_w_per_m2))
    margin = irradiance_w_per_m2 / GROUP_LIMITS_W_PER_M2[0]
    return RiskGroup(RISK_GROUPS[place], irradiance_w_per_m2, margin)


def safety_warnings(instrument: Instrument) -> list[str]:
    """What exceeds the classes that the instrument declares."""
    declared, warnings = instrument.eye_safety, []
    lasers, array = laser_safety(instrument), array_risk_group(instrument)
    if declared.laser_class is not None and LASER_CLASSES.index(
        lasers.laser_class
    ) > LASER_CLASSES.index(declared.laser_class):
        warnings.append(
            f"the lasers are of class {lasers.laser_class} by IEC 60825-1, above "
            f"eye_safety.laser_class {declared.laser_class}"
        )
    if declared.risk_group is not None and RISK_GROUPS.index(array.risk_group) > RISK_GROUPS.index(
        declared.risk_group
    ):
        warnings.append(
            f"the array is in risk group {array.risk_group} by IEC 62471, above "
            f"eye_safety.risk_group {declared.risk_group}"
        )
    return warnings


def _class(mean_w: float, pulse_j: float, pulse_s: float) -> LaserClass:
    mean_limit, pulse_limit = accessible_energy_j(100.0) / 100.0, accessible_energy_j(pulse_s)
    short = pulse_s < SHORTEST_PULSE_S
    limits: dict[LaserClass, tuple[float, float]] = {
        "1": (mean_limit, pulse_limit),
        "3R": (TIMES_3R * mean_limit, TIMES_3R * pulse_limit),
        "3B": (POWER_3B_W, PEAK_3B_W * pulse_s if short else ENERGY_3B_J),
    }
    for name, (mean, pulse) in limits.items():
        if mean_w <= mean and pulse_j <= pulse:
            return name
    return "4"


def _beams_together(instrument: Instrument) -> int:
    """The most beams that one limiting aperture may take in."""
    lasers = instrument.lasers
    directions = lasers.directions
    places: NDArray[np.float64] = MEASURED_AT_M * directions / directions[:, 2:]
    apart = np.linalg.norm(places[:, None] - places, axis=-1)
    width = 4e-3 * math.hypot(lasers.waist_mm, lasers.divergence_mrad * MEASURED_AT_M)
    return int(np.max(np.sum(apart < APERTURE_M + width, axis=1)))
