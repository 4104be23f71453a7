"""Make the shipped table of what rain drops scatter: `python -m spisim.atmosphere.drop_table`.

Needs miepython (with MIEPYTHON_USE_JIT=1 it takes minutes, without hours); using the table does
not.

Mie theory for spheres of water (Segelstein 1981) at 1550 nm, per steradian and per area of the
disc that a drop shows, less diffraction. Diffraction is half of the extinction of a sphere so much
larger than the wavelength and goes forward within 1.22 λ/D, 2 mrad for 1 mm: it is taken off as the
mean of its Airy rings, 1 / (π² x sin³θ), and what is left is smooth, so that its value at
`FORWARD_DEG` stands for all smaller angles. Every size stands for its neighbourhood: the ripple of
a single sphere is averaged out, as in any rain.
"""

from __future__ import annotations

import importlib
import sys
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]

TABLE = Path(__file__).with_name("drops.npz")
WAVELENGTH_MM = 1.55e-3
WATER = 1.31089 - 1.336e-4j  # at 1550 nm; absorbs where the imaginary part is negative
#: Diameters, evenly spaced in their logarithm.
DIAMETERS_MM = np.geomspace(0.1, 8.0, 26)
#: Spheres of which a row is the mean.
SPHERES = 100
#: Angles from straight back, evenly spaced in arsinh: 0.01° apart there, 0.4° at the rainbow.
ANGLES, FINE_DEG = 600, 1.0
FORWARD_DEG = 5.0


def angles_from_back_rad() -> Floats:
    """Nodes of the table, (angles,), from 0 to π."""
    place = np.linspace(0, np.arcsinh(180 / FINE_DEG), ANGLES)
    angles: Floats = np.radians(np.minimum(FINE_DEG * np.sinh(place), 180.0))
    return angles


def scattered(diameter_mm: float) -> Floats:
    """Light scattered into each angle, 1/sr, per light that a sphere's disc meets, (angles,)."""
    mie: Any = importlib.import_module("miepython")
    size = np.pi * diameter_mm / WAVELENGTH_MM
    angle = angles_from_back_rad()
    first, second = mie.S1_S2(WATER, size, -np.cos(angle), norm="wiscombe")
    whole = (np.abs(first) ** 2 + np.abs(second) ** 2) / (2 * np.pi * size**2)
    forward = np.pi - angle < np.radians(FORWARD_DEG)
    sine = np.where(forward, 1.0, np.sin(angle))
    rings = ((1 - np.cos(angle)) / 2) ** 2 / (np.pi**2 * size * np.maximum(sine, 1e-9) ** 3)
    smooth = whole - rings
    edge = ~forward & (np.pi - angle < np.radians(FORWARD_DEG + 5))
    return np.where(forward, smooth[edge].mean(), smooth)


def table(diameters_mm: Floats) -> NDArray[np.float32]:
    """Rows (diameters, angles), each the mean over spheres up to half way to its neighbours."""
    half_step = np.log(DIAMETERS_MM[1] / DIAMETERS_MM[0]) / 2
    near = np.exp(half_step * (2 * (np.arange(SPHERES) + 0.5) / SPHERES - 1))
    rows = [
        np.maximum(np.mean([scattered(size) for size in diameter * near], axis=0), 0)
        for diameter in diameters_mm
    ]
    return np.array(rows, dtype=np.float32)


def main() -> None:
    """Write the table."""
    np.savez_compressed(
        TABLE,
        diameters_mm=DIAMETERS_MM,
        angles_from_back_rad=angles_from_back_rad(),
        scattered_per_sr=table(DIAMETERS_MM),
    )
    sys.stdout.write(f"wrote {TABLE}\n")


if __name__ == "__main__":
    main()
