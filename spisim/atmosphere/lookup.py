"""Mie results: shipped for the named kinds, computed and kept for all other particles."""

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.atmosphere.cache import retained
from spisim.atmosphere.droplets import KINDS, Particles
from spisim.atmosphere.indices import check_wavelength
from spisim.atmosphere.mie import Optics, particle_optics

PATH = Path(__file__).with_name("mie.npz")
#: 550 nm is where visibility is defined, 850 to 1550 nm where lidars and cameras work.
WAVELENGTHS_NM = (550, 850, 905, 940, 1460, 1550)
#: Changes when the computation does, so that the cache forgets.
VERSION = 1


@cache
def look_up(particles: Particles, wavelength_nm: float) -> Optics:
    """What these particles do at a wavelength: shipped, from the cache, or computed in seconds.

    Raises InputError for a wavelength outside 400 to 1700 nm.
    """
    check_wavelength(wavelength_nm)
    for name, named in KINDS.items():
        if named == particles and wavelength_nm in WAVELENGTHS_NM:
            return shipped()[name, int(wavelength_nm)]
    key = f"{VERSION} {particles!r} {wavelength_nm!r}"

    def make() -> dict[str, Floats]:
        optics = particle_optics(particles, wavelength_nm)
        return {field.name: np.asarray(getattr(optics, field.name)) for field in fields(optics)}

    return _optics(retained(key, make))


@cache
def shipped() -> dict[tuple[str, int], Optics]:
    """Results for the named kinds at `WAVELENGTHS_NM`."""
    with np.load(PATH) as file:
        arrays = dict(file)
    return {
        (str(kind), int(wavelength)): _optics(arrays, (i, j))
        for i, kind in enumerate(arrays["kinds"])
        for j, wavelength in enumerate(arrays["wavelengths_nm"])
    }


def _optics(arrays: Mapping[str, Floats], where: tuple[int, ...] = ()) -> Optics:
    return Optics(
        extinction_m2=float(arrays["extinction_m2"][where]),
        albedo=float(arrays["albedo"][where]),
        g=float(arrays["g"][where]),
        phase=np.asarray(arrays["phase"][where], float),
        angles_deg=arrays["angles_deg"],
    )
