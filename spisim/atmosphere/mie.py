"""Mie theory of size distributions at one wavelength.

miepython gives the coefficients of each sphere; sums over orders, angles and sizes are matrix
products (C. F. Bohren & D. R. Huffman, Absorption and Scattering of Light by Small Particles, 1983,
equations 4.61, 4.62, 4.74 and the asymmetry on page 120). Light is unpolarised.
"""

from dataclasses import dataclass
from itertools import pairwise
from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Complex, Floats
from spisim.atmosphere.droplets import Particles

#: Radii of the integration. Twice as many change extinction and asymmetry by less than 1e-3 and
#: backscatter by less than 2 % for every named kind.
RADII = 1500
RADII_PER_CLASS = 24
#: Spheres per batch.
BATCH = 64
#: Maximum step of scattering angles, which are finest around 0° (diffraction) and 180° (glory).
MAX_STEP_DEG = 0.5


def scattering_angles(finest_deg: float = 0.02) -> Floats:
    """Angles from 0° to 180°: geometric steps from either end, then `MAX_STEP_DEG`."""
    edge = 6.0
    fine = np.concatenate([[0], np.geomspace(finest_deg, edge, 120)])
    middle = np.arange(edge, 180 - edge + MAX_STEP_DEG / 2, MAX_STEP_DEG)
    return np.concatenate([fine[:-1], middle, 180 - fine[:-1][::-1]])


ANGLES_DEG = scattering_angles()


class Sums(NamedTuple):
    """Weighted sums of the cross sections of many spheres."""

    extinction_m2: float
    scattering_m2: float
    forward_m2: float  # scattering times the mean cosine
    per_steradian_m2: Floats  # (angles,)


@dataclass(frozen=True, eq=False)
class Optics:
    """Mean optical properties of a particle at one wavelength; `phase` is 1/sr at `angles_deg`."""

    extinction_m2: float  # cross section
    albedo: float
    g: float  # mean cosine of the scattering angle
    phase: Floats  # (angles,)
    angles_deg: Floats

    @property
    def table(self) -> Floats:
        """Rows of (angle in degrees, phase function in 1/sr)."""
        return np.column_stack([self.angles_deg, self.phase])

    @property
    def backscatter_per_sr(self) -> float:
        """Phase function at 180°, 1/sr."""
        return float(self.phase[-1])


def particle_optics(particles: Particles, wavelength_nm: float, radii_count: int = RADII) -> Optics:
    """Mean optical properties of a size distribution."""
    low, high = particles.sizes.radius_range_um()
    edges = np.geomspace(low, high, radii_count + 1)
    radii = np.sqrt(edges[:-1] * edges[1:])
    fractions = particles.sizes.density(radii) * np.diff(edges)
    sums = scatter(radii, fractions, particles.index_at(wavelength_nm), wavelength_nm, ANGLES_DEG)
    return Optics(
        sums.extinction_m2,
        sums.scattering_m2 / sums.extinction_m2,
        sums.forward_m2 / sums.scattering_m2,
        sums.per_steradian_m2 / sums.scattering_m2,
        ANGLES_DEG,
    )


def class_sums(edges_um: Floats, index: complex, wavelength_nm: float) -> list[Sums]:
    """Mean cross sections of a sphere in each class, by the diameters (classes + 1,) between."""
    found = []
    for low, high in pairwise(edges_um / 2):
        edges = np.geomspace(low, high, RADII_PER_CLASS + 1)
        radii, weights = np.sqrt(edges[:-1] * edges[1:]), np.diff(edges) / (high - low)
        found.append(scatter(radii, weights, index, wavelength_nm, ANGLES_DEG))
    return found


def scatter(
    radii_um: Floats, weights: Floats, index: complex, wavelength_nm: float, angles_deg: Floats
) -> Sums:
    """Weighted sums over spheres of refractive index n - ik."""
    from miepython import coefficients  # slow to load, and not needed for shipped kinds

    wavenumber = 2e3 * np.pi / wavelength_nm  # 1/µm
    orders = len(coefficients(index, wavenumber * radii_um.max())[0])
    plus, minus = _angular_functions(angles_deg, orders)
    totals = np.zeros(3)  # of extinction, scattering, and scattering times cosine
    per_steradian = np.zeros(angles_deg.size)
    for start in range(0, radii_um.size, BATCH):
        batch = slice(start, start + BATCH)
        pairs = [coefficients(index, x) for x in wavenumber * radii_um[batch]]
        a, b = _stacked([pair[0] for pair in pairs]), _stacked([pair[1] for pair in pairs])
        fraction = weights[batch]
        n = np.arange(1, a.shape[1] + 1)
        scale = (2 * n + 1) / (n * (n + 1))
        totals += [
            fraction @ ((a + b).real @ (2 * n + 1)),
            fraction @ ((np.abs(a) ** 2 + np.abs(b) ** 2) @ (2 * n + 1)),
            fraction @ (2 * _forward(a, b, n)),
        ]
        # |S1|² + |S2|² = (|S1 + S2|² + |S1 - S2|²) / 2
        per_steradian += fraction @ _squared(scale * (a + b) / 2, plus)
        per_steradian += fraction @ _squared(scale * (a - b) / 2, minus)
    area_m2 = 1e-12 / wavenumber**2
    extinction, scattering, forward = (2 * np.pi * area_m2 * totals).tolist()
    return Sums(extinction, scattering, forward, area_m2 * per_steradian)


def _stacked(rows: list[Any]) -> Complex:
    """Rows of any length as a zero-padded matrix."""
    matrix = np.zeros((len(rows), max(len(row) for row in rows)), dtype=np.complex128)
    for filled, row in zip(matrix, rows, strict=True):
        filled[: len(row)] = row
    return matrix


def _forward(a: Complex, b: Complex, n: NDArray[np.int_]) -> Floats:
    """Bohren & Huffman's sum for the asymmetry, per sphere."""
    step, here = n[:-1] * (n[:-1] + 2) / (n[:-1] + 1), (2 * n + 1) / (n * (n + 1))
    neighbours = (a[:, :-1] * a[:, 1:].conj() + b[:, :-1] * b[:, 1:].conj()).real
    return np.asarray(neighbours @ step + (a * b.conj()).real @ here)


def _squared(coefficients: Complex, functions: Floats) -> Floats:
    """|Σ c_n f_n|² per sphere (rows) and angle (columns)."""
    functions = functions[: coefficients.shape[1]]
    return np.asarray((coefficients.real @ functions) ** 2 + (coefficients.imag @ functions) ** 2)


def _angular_functions(angles_deg: Floats, orders: int) -> tuple[Floats, Floats]:
    """π_n + τ_n and π_n - τ_n (orders, angles), by upward recurrence."""
    mu = np.cos(np.radians(angles_deg))
    plus, minus = np.empty((2, orders, mu.size))
    before, here = np.zeros_like(mu), np.ones_like(mu)
    for n in range(1, orders + 1):
        tau = n * mu * here - (n + 1) * before
        plus[n - 1], minus[n - 1] = here + tau, here - tau
        before, here = here, ((2 * n + 1) * mu * here - (n + 1) * before) / n
    return plus, minus
