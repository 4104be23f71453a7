"""Mie results: shipped for the named kinds, computed and cached for other particles."""

import hashlib
import io
import logging
import os
import sys
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from dataclasses import fields
from functools import cache
from pathlib import Path
from typing import TypeAlias

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.base.files import write_atomically
from spisim.atmosphere.droplets import KINDS, Particles
from spisim.atmosphere.indices import check_wavelength
from spisim.atmosphere.mie import Optics, Sums, class_sums, particle_optics
from spisim.atmosphere.spectrum import SpectrumSizes
from spisim.base.home import home

PATH = Path(__file__).with_name("mie.npz")
#: Visibility is defined at 550 nm; lidars and cameras work at 850 to 1550 nm.
WAVELENGTHS_NM = (550, 850, 905, 940, 1460, 1550)
#: Changes with the computation, to invalidate the cache.
VERSION = 1

Arrays: TypeAlias = Mapping[str, Floats]

logger = logging.getLogger(__name__)


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
def look_up_classes(particles: Particles, wavelength_nm: float) -> Mapping[str, Floats]:
    """Mean cross sections of a particle in each class of a measured spectrum, by name."""
    assert isinstance(particles.sizes, SpectrumSizes)
    edges_um = np.array(particles.sizes.edges_um)

    def make() -> dict[str, Floats]:
        sums = class_sums(edges_um, particles.index_at(wavelength_nm), wavelength_nm)
        return {name: np.array([getattr(one, name) for one in sums]) for name in Sums._fields}

    return cached(f"{VERSION} classes {particles!r} {wavelength_nm!r}", make)


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


def cache_folder() -> Path:
    """Folder of the results: `SPISIM_CACHE`, or the user's cache folder."""
    if own := os.environ.get("SPISIM_CACHE"):
        return Path(own)
    if sys.platform == "darwin":
        return home() / "Library" / "Caches" / "spisim"
    return Path(os.environ.get("XDG_CACHE_HOME") or home() / ".cache") / "spisim"


def cached(key: str, make: Callable[[], Arrays]) -> Arrays:
    """What `make` returns, from the cache if possible; a damaged cache only costs time."""
    path = cache_folder() / f"mie-{hashlib.sha256(key.encode()).hexdigest()[:24]}.npz"
    # Results from a damaged file are computed again.
    with suppress(Exception), path.open("rb") as opened, np.load(opened) as file:
        if str(file["key"]) == key:
            return {name: file[name] for name in file.files if name != "key"}
    began = time.perf_counter()
    made = make()
    logger.info("Mie theory of custom droplets: %.1f s", time.perf_counter() - began)
    buffer = io.BytesIO()
    np.savez_compressed(buffer, allow_pickle=False, key=np.array(key), **dict(made))
    with suppress(OSError, InputError):
        write_atomically(path, buffer.getvalue())
    return made
