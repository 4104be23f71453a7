"""Make the shipped Mie results again: `python tools/scattering_tables.py`, in some minutes."""

import os

import numpy as np

from spisim.atmosphere import lookup, rain_table
from spisim.atmosphere.droplets import KINDS
from spisim.atmosphere.mie import ANGLES_DEG, particle_optics

#: More than for the user's own sizes: these are computed once.
RADII = 8000


def make_particles() -> None:
    """Compute the named kinds at every wavelength and write `lookup.PATH`."""
    rows = [
        [particle_optics(particles, wavelength, RADII) for wavelength in lookup.WAVELENGTHS_NM]
        for particles in KINDS.values()
    ]
    np.savez_compressed(
        lookup.PATH,
        kinds=np.array(list(KINDS)),
        wavelengths_nm=np.array(lookup.WAVELENGTHS_NM),
        angles_deg=ANGLES_DEG,
        phase=np.array([[optics.phase for optics in row] for row in rows], dtype=np.float32),
        allow_pickle=False,
        **{
            name: np.array([[getattr(optics, name) for optics in row] for row in rows])
            for name in ("extinction_m2", "albedo", "g")
        },
    )


def make_rain() -> None:
    """Compute all drops at every wavelength and write `rain_table.PATH`."""
    tables = [rain_table.compute(wavelength) for wavelength in rain_table.WAVELENGTHS_NM]
    np.savez_compressed(
        rain_table.PATH,
        wavelengths_nm=np.array(rain_table.WAVELENGTHS_NM),
        angles_deg=rain_table.ANGLES_DEG,
        allow_pickle=False,
        **{
            name: np.array([getattr(table, name) for table in tables], dtype=np.float32)
            for name in rain_table.PROPERTIES
        },
    )


if __name__ == "__main__":
    os.environ.setdefault("MIEPYTHON_USE_JIT", "1")  # read when miepython is loaded
    make_particles()
    make_rain()
