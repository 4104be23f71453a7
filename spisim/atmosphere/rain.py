"""Rain as a medium: the mean over very many drops.

Within a drone's range rain is single drops that cross the beams; a medium has their mean extinction
and echo without their fluctuations.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal, Protocol, TypeAlias

import numpy as np
from scipy.special import gammainc

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere.droplets import WATER_G_PER_CM3
from spisim.atmosphere.fall_speed import terminal_speed_m_s
from spisim.atmosphere.medium import Atmosphere, check_rate
from spisim.atmosphere.phase import Tabulated
from spisim.atmosphere.rain_table import EDGES_MM, RainTable, rain_table, solid_angle_weights
from spisim.atmosphere.spectrum import SpectrumSizes
from spisim.atmosphere.table import NODES, tabulate
from spisim.atmosphere.uncertainty import Uncertainty, propagated
from spisim.atmosphere.visibility import VISUAL_NM, visibility

Diffraction: TypeAlias = Literal["remove", "include"]


class Drops(Protocol):
    """Drop sizes at a rate."""

    def moments(self, rate_mm_per_h: float, power: int) -> Floats:
        """Σ D^power over the drops of each size class in a cubic metre, mm^power/m³."""


@dataclass(frozen=True)
class DropSizes:
    """N(D) = N0 exp(-Λ D), Λ = slope · R^-0.21, D in mm, R in mm/h."""

    intercept: float  # N0, m⁻³ mm⁻¹
    slope: float  # mm⁻¹ at 1 mm/h

    def decay(self, rate_mm_per_h: float) -> float:
        """Λ, mm⁻¹."""
        return self.slope * rate_mm_per_h**-0.21

    def moments(self, rate_mm_per_h: float, power: int) -> Floats:
        """Σ D^power over the drops of each size class in a cubic metre, mm^power/m³."""
        decay = self.decay(rate_mm_per_h)
        below = gammainc(power + 1, decay * EDGES_MM)
        whole = self.intercept * math.factorial(power) / decay ** (power + 1)
        return np.asarray(whole * np.diff(below))


@dataclass(frozen=True)
class MeasuredDrops:
    """A measured spectrum, scaled to the rate that it would have at terminal speeds."""

    spectrum: SpectrumSizes

    @property
    def diameters_mm(self) -> Floats:
        """Middles of the classes."""
        return self.spectrum.diameters_um / 1e3

    @property
    def falling(self) -> Floats:
        """Rate, mm/h, that one drop per m³ makes, by class."""
        fall = terminal_speed_m_s(self.diameters_mm)
        return np.asarray(3.6e-3 * np.pi / 6 * self.diameters_mm**3 * fall)

    def moments(self, rate_mm_per_h: float, power: int) -> Floats:
        """See `Drops`."""
        numbers = np.array(self.spectrum.numbers)
        numbers = numbers * rate_mm_per_h / (numbers @ self.falling)
        weights = numbers * self.diameters_mm**power
        return np.histogram(self.diameters_mm, EDGES_MM, weights=weights)[0]


#: J. S. Marshall & W. M. Palmer, J. Meteorol. 5, 165 (1948); J. Joss, J. C. Thams & A. Waldvogel,
#: Proc. Int. Conf. Cloud Physics, Toronto (1968), 369.
RAINS: Mapping[str, DropSizes] = MappingProxyType(
    {
        "marshall-palmer": DropSizes(8000, 4.1),
        "joss-drizzle": DropSizes(30000, 5.7),
        "joss-widespread": DropSizes(7000, 4.1),
        "joss-thunderstorm": DropSizes(1400, 3.0),
    }
)


def rain_sizes(kind: str) -> DropSizes:
    """Sizes of a kind in `RAINS`; InputError for another."""
    if kind not in RAINS:
        raise InputError(f"kind {kind!r} of rain: {nearest(kind, RAINS)}")
    return RAINS[kind]


def rain(
    rate_mm_per_h: float,
    kind: str | Drops = "marshall-palmer",
    *,
    wavelength_nm: float = 1550.0,
    diffraction: str = "remove",
) -> Atmosphere:
    """Rain of a rate, from drops of 0.1 to 6 mm by Mie theory.

    Half the extinction is diffraction into one or two milliradians. "remove" counts that light as
    unscattered, since every pixel and detector here is wider: extinction σ(1 - ωf) and albedo
    ω(1 - f)/(1 - ωf), with f the diffracted fraction of scattered light. "include" is the loss of a
    narrow laser link, with the peak widened to the 0.4° that the tabulated phase function resolves.
    Water absorbs 22 to 35 % of the extinction at 1550 nm, and twice that without diffraction.

    Parameters
    ----------
    rate_mm_per_h : float
        Above 0, at most 300.
    kind : str or Drops
        Name in `RAINS`, or drop sizes.
    wavelength_nm : float
    diffraction : str
        "remove" or "include".

    Raises
    ------
    InputError
        For other values, and a wavelength that rain is not tabulated at.
    """
    check_rate("rain", rate_mm_per_h)
    drops = rain_sizes(kind) if isinstance(kind, str) else kind
    choices = ("remove", "include")
    if diffraction not in choices:
        raise InputError(f"diffraction {diffraction!r}: {nearest(diffraction, choices)}")
    table = rain_table(wavelength_nm)
    # π/4 D² in m², per m³ of air
    area = np.pi / 4 * 1e-6 * drops.moments(rate_mm_per_h, 2)
    visual = float(area @ rain_table(VISUAL_NM).extinction)
    scattered = area * table.extinction * table.albedo
    diffracted = float(scattered @ table.diffracted)
    extinction = float(area @ table.extinction)
    scattering = float(scattered.sum())
    phase = _without_peak(table, scattered)
    if diffraction == "remove":
        extinction, scattering = extinction - diffracted, scattering - diffracted
    else:
        phase = _with_peak(phase, diffracted / scattering)
    volume_mm3 = math.pi / 6 * float(drops.moments(rate_mm_per_h, 3).sum())
    return Atmosphere(
        extinction,
        scattering / extinction,
        phase,
        f"rain, {rate_mm_per_h:g} mm/h",
        visibility(visual),
        water_g_per_m3=1e-3 * WATER_G_PER_CM3 * volume_mm3,
        uncertainty=_uncertainty(drops, table, diffraction),
    )


def _uncertainty(drops: Drops, table: RainTable, diffraction: str) -> Uncertainty | None:
    """What the counts of a measured spectrum leave unsure at a rate."""
    if not isinstance(drops, MeasuredDrops) or (sigma := drops.spectrum.sigma) is None:
        return None
    at = np.clip(np.searchsorted(EDGES_MM, drops.diameters_mm) - 1, 0, EDGES_MM.size - 2)
    lost = table.diffracted if diffraction == "remove" else 0.0
    area = drops.diameters_mm**2
    scattered = area * (table.extinction * table.albedo * (1 - lost))[at]
    extinction = scattered + area * (table.extinction * (1 - table.albedo))[at]
    wide = area * (table.extinction * table.albedo * (1 - table.diffracted))[at]
    numbers = np.array(drops.spectrum.numbers)
    per_steradian = wide[:, None] * table.phase[at]
    ahead = solid_angle_weights(table.angles_deg) * np.cos(np.radians(table.angles_deg))
    forward = per_steradian @ ahead + (scattered - wide)  # diffracted light goes on
    return propagated(numbers, sigma, extinction, scattered, forward, per_steradian, drops.falling)


def _without_peak(table: RainTable, scattered: Floats) -> Tabulated:
    fractions = scattered * (1 - table.diffracted)
    phase = fractions @ table.phase / fractions.sum()
    return tabulate(np.column_stack([table.angles_deg, phase]), name="rain")


def _with_peak(phase: Tabulated, diffracted: float) -> Tabulated:
    """Diffracted light in the table's last cell, the narrowest peak possible."""
    density = phase.density(np.linspace(-1, 1, NODES)) * (1 - diffracted)
    density[-1] += diffracted * (NODES - 1) / (2 * np.pi)
    return Tabulated(density, name="rain")
