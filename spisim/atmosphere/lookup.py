"""Mie results: shipped for the named kinds, computed and cached for other particles."""

from collections.abc import Mapping
from dataclasses import fields
from functools import cache
from pathlib import Path

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.atmosphere.cache import cached
from spisim.atmosphere.droplets import KINDS, Particles
from spisim.atmosphere.indices import check_wavelength
from spisim.atmosphere.mie import Optics, particle_optics

PATH = Path(__file__).with_name("mie.npz")
#: Visibility is defined at 550 nm; lidars and cameras work at 850 to 1550 nm.
WAVELENGTHS_NM = (550, 850, 905, 940, 1460, 1550)
#: Changes with the computation, to invalidate the cache.
VERSION = 1


@cache
def look_up(particles: Particles, wavelength_nm: float) -> Optics:
    """Optics of particles: shipped, cached, or computed in seconds; InputError as `fog`."""
    check_wavelength(wavelength_nm)
    for name, named in KINDS.items():
        if named == particles and wavelength_nm in WAVELENGTHS_NM:
            return shipped()[name, int(wavelength_nm)]
    key = f"{VERSION} {particles!r} {wavelength_nm!r}"

    def make() -> dict[str, Floats]:
        optics = particle_optics(particles, wavelength_nm)
        return {field.name: np.asarray(getattr(optics, field.name)) for field in fields(optics)}

    return _optics(cached(key, make))


@cache
def shipped() -> dict[tuple[str, int], Optics]:
    """Results of the named kinds at `WAVELENGTHS_NM`."""
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
