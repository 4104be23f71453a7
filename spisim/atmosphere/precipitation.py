"""Rain and snow as populations of single drops: number, size, speed and position.

Sizes follow N(D) = N0 exp(-Λ D) between a minimum and a maximum diameter. Within the range of a
drone's instrument even rain of 100 mm/h extinguishes less than a tenth of the light; what matters
is the single drop that crosses a beam during a frame.
"""

import math
from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import ArrayLike
from scipy.special import gammainc

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere.drop_optics import Scatterer, flakes, water_drops
from spisim.atmosphere.droplets import WATER_G_PER_CM3
from spisim.atmosphere.fall_speed import LABORATORY_KG_PER_M3, check_air, terminal_speed_m_s
from spisim.atmosphere.medium import DB_PER_NEPER, check_rate
from spisim.atmosphere.rain import rain_sizes
from spisim.atmosphere.rain_table import ANGLES_DEG, solid_angle_weights
from spisim.atmosphere.snow import MELTWATER_KG_PER_M3, flake_albedo, melted_sizes
from spisim.atmosphere.visibility import visibility

Vector3 = tuple[float, float, float]

#: Assumed density and fall speed of flakes, within measured values.
FLAKE_KG_PER_M3, FLAKE_SPEED_M_S = 100.0, 1.2
ICE_KG_PER_M3 = 917.0
#: Integration points over the sizes.
SIZES = 2000
#: Integration points over the directions.
COSINES = np.cos(np.radians(ANGLES_DEG))


@dataclass(frozen=True, eq=False)
class Precipitation:
    """Drops or flakes of a whole scene, each seen as a disc.

    Diameters are those of the discs. `near_m` and `far_m` bound the simulated depths along the
    optical axis: a hood keeps nearer drops off, and farther ones are left out.
    """

    kind: str
    rate_mm_per_h: float  # of water
    intercept_per_m3_mm: float  # N0
    slope_per_mm: float  # Λ
    smallest_mm: float
    largest_mm: float
    fall_speed_m_s: Callable[[Floats], Floats]  # of diameters in mm
    optics: Scatterer
    density_kg_m3: float  # of a sphere as wide as the disc
    wind_m_s: Vector3 = (0.0, 0.0, 0.0)  # world axes
    near_m: float = 0.05
    far_m: float = 10.0

    def __post_init__(self) -> None:
        if not 0 < self.near_m < self.far_m:
            raise InputError(
                f"near_m {self.near_m} and far_m {self.far_m} should satisfy 0 < near_m < far_m"
            )

    @property
    def number_per_m3(self) -> float:
        """Number of drops within the size limits per volume of air."""
        ends = np.exp(-self.slope_per_mm * np.array([self.smallest_mm, self.largest_mm]))
        return float(self.intercept_per_m3_mm / self.slope_per_mm * (ends[0] - ends[1]))

    @property
    def extinction_per_m(self) -> float:
        """Area of all discs per volume (Q = 1); Mie theory's extinction is twice that."""
        return self._total(lambda diameter: np.ones_like(diameter))

    @property
    def albedo(self) -> float:
        """Scattered fraction of the light on the discs."""
        return self._total(self.optics.albedo) / self.extinction_per_m

    @property
    def g(self) -> float:
        """Mean cosine of the scattering angle, without diffraction."""
        scattered = solid_angle_weights(ANGLES_DEG) * self.scattering_per_m_sr(COSINES)
        return float(scattered @ COSINES / scattered.sum())

    @property
    def water_g_per_m3(self) -> float:
        """Water, liquid or frozen, per volume of air."""
        volume = 2 / 3 * self._total(lambda diameter: diameter * 1e-3)  # of spheres
        return 1e3 * self.density_kg_m3 * volume

    def summary(self) -> dict[str, Any]:
        """Plain numbers as `Atmosphere.summary`; the eye also loses diffracted light."""
        scattering = self.extinction_per_m * self.albedo
        return {
            "kind": f"{self.kind}, {self.rate_mm_per_h:g} mm/h, single drops",
            "extinction_per_m": self.extinction_per_m,
            "extinction_db_per_km": 1e3 * DB_PER_NEPER * self.extinction_per_m,
            "albedo": self.albedo,
            "g": self.g,
            "backscatter_per_sr": float(self.scattering_per_m_sr(-1.0)) / scattering,
            "visibility_m": visibility(2 * self.extinction_per_m),
            "visibility_definition": "koschmieder",
            "water_g_per_m3": self.water_g_per_m3,
        }

    @property
    def left_out(self) -> float:
        """Fraction of the total disc area that drops outside the size limits would have."""
        low, high = (
            float(gammainc(3, self.slope_per_mm * size))
            for size in (self.smallest_mm, self.largest_mm)
        )
        return 1 - (high - low)

    def scattering_per_m_sr(self, cos: ArrayLike) -> Floats:
        """Scattering coefficient per steradian at cosines of the scattering angle."""
        return np.array(
            [
                self._total(lambda diameter, one=one: self.optics.scattered_per_sr(one, diameter))
                for one in np.ravel(cos)
            ]
        ).reshape(np.shape(cos))

    def diameters_mm(self, count: int, rng: np.random.Generator) -> Floats:
        """Random diameters (count,)."""
        low, high = np.exp(-self.slope_per_mm * np.array([self.smallest_mm, self.largest_mm]))
        return np.asarray(-np.log(low - rng.random(count) * (low - high)) / self.slope_per_mm)

    def _total(self, fraction: Callable[..., Floats]) -> float:
        """∫ N(D) π D²/4 fraction(D) dD, 1/m."""
        diameter = np.linspace(self.smallest_mm, self.largest_mm, SIZES)
        number = self.intercept_per_m3_mm * np.exp(-self.slope_per_mm * diameter)
        area_m2 = np.pi / 4 * (diameter * 1e-3) ** 2
        return float(np.trapezoid(number * area_m2 * fraction(diameter), diameter))


def rain(
    rate_mm_per_h: float,
    kind: str = "marshall-palmer",
    *,
    wavelength_nm: float = 1550.0,
    smallest_mm: float = 0.2,
    largest_mm: float = 8.0,
    wind_m_s: Vector3 = (0.0, 0.0, 0.0),
    air_density_kg_m3: float = LABORATORY_KG_PER_M3,
    near_m: float = 0.05,
    far_m: float = 10.0,
) -> Precipitation:
    """Rain of a kind in `RAINS`.

    `smallest_mm` leaves out many small drops: of Marshall & Palmer's, 1.4 % of the area at 10 mm/h
    and 5 % at 1 mm/h, see `left_out`. Drops above 8 mm break up. InputError for a rate outside 0 to
    300 mm/h, an unknown kind, limits out of order, a wavelength without a rain table, and air that
    is not on Earth.
    """
    check_rate("rain", rate_mm_per_h)
    check_air(air_density_kg_m3)
    drops = rain_sizes(kind)
    _check_sizes(smallest_mm, largest_mm)
    return Precipitation(
        kind="rain",
        rate_mm_per_h=rate_mm_per_h,
        intercept_per_m3_mm=drops.intercept,
        slope_per_mm=drops.decay(rate_mm_per_h),
        smallest_mm=smallest_mm,
        largest_mm=largest_mm,
        fall_speed_m_s=partial(terminal_speed_m_s, air_density_kg_m3=air_density_kg_m3),
        optics=water_drops(wavelength_nm),
        density_kg_m3=1e3 * WATER_G_PER_CM3,
        wind_m_s=wind_m_s,
        near_m=near_m,
        far_m=far_m,
    )


def snow(
    rate_mm_per_h: float,
    *,
    wavelength_nm: float = 1550.0,
    flake_density_kg_m3: float = FLAKE_KG_PER_M3,
    fall_speed_m_s: float = FLAKE_SPEED_M_S,
    albedo: float | None = None,
    g: float = 0.6,
    smallest_mm: float = 0.5,
    largest_mm: float = 15.0,
    wind_m_s: Vector3 = (0.0, 0.0, 0.0),
    near_m: float = 0.05,
    far_m: float = 10.0,
) -> Precipitation:
    """Snow of Gunn & Marshall (1958), see `melted_sizes`.

    A flake is wider than its melted drop by the cube root of the density ratio. All flakes fall at
    one speed (1 to 1.5 m/s for aggregates, Locatelli & Hobbs 1974). Density, albedo (by default
    `flake_albedo`) and g are assumptions: with diffraction added back, the defaults amount to an
    albedo of 0.75 at 1550 nm and g = 0.87. InputError for a rate outside 0 to 20 mm/h, and other
    values out of range.
    """
    check_rate("snow", rate_mm_per_h)
    _check_sizes(smallest_mm, largest_mm)
    if not 0 < flake_density_kg_m3 <= ICE_KG_PER_M3:
        raise InputError(
            f"flake_density_kg_m3 should be above 0 and at most that of ice, {ICE_KG_PER_M3:g}; "
            f"found {flake_density_kg_m3}"
        )
    if not (math.isfinite(fall_speed_m_s) and fall_speed_m_s > 0):
        raise InputError(f"fall_speed_m_s should be greater than 0; found {fall_speed_m_s}")
    intercept, slope = melted_sizes(rate_mm_per_h)
    wider = (MELTWATER_KG_PER_M3 / flake_density_kg_m3) ** (1 / 3)
    return Precipitation(
        kind="snow",
        rate_mm_per_h=rate_mm_per_h,
        intercept_per_m3_mm=intercept / wider,
        slope_per_mm=slope / wider,
        smallest_mm=smallest_mm,
        largest_mm=largest_mm,
        fall_speed_m_s=lambda diameter_mm: np.full_like(diameter_mm, fall_speed_m_s),
        optics=flakes(flake_albedo(wavelength_nm) if albedo is None else albedo, g),
        density_kg_m3=flake_density_kg_m3,
        wind_m_s=wind_m_s,
        near_m=near_m,
        far_m=far_m,
    )


def _check_sizes(smallest_mm: float, largest_mm: float) -> None:
    if not 0 < smallest_mm < largest_mm:
        raise InputError(
            f"smallest_mm {smallest_mm} and largest_mm {largest_mm} should satisfy "
            "0 < smallest_mm < largest_mm"
        )
