"""Refractive indices of water, ice, glycol and fog fluid."""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from types import MappingProxyType

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.base.config import load_yaml

COLUMNS = {"water": 1, "ice": 3, "glycol": 5}  # column of n, followed by k
#: Fractions of the volume. Droplets of a fog machine hold as much water as the air around them asks
#: for: in air of 50 % humidity half of the molecules are water's (Raoult's law), a fifth of the
#: volume of the glycols and glycerol that fog fluids are made of.
MIXTURES: Mapping[str, Mapping[str, float]] = MappingProxyType(
    {"fog-fluid": MappingProxyType({"glycol": 0.8, "water": 0.2})}
)


@cache
def _table() -> Floats:
    text = Path(__file__).with_name("indices.yaml").read_text(encoding="utf-8")
    return np.asarray(load_yaml(text, "indices")["rows"], float)


def check_wavelength(wavelength_nm: float) -> None:
    """InputError outside 400 to 1700 nm, the range of all weather tables."""
    first, last = _table()[[0, -1], 0]
    if not first <= wavelength_nm <= last:
        raise InputError(
            f"wavelength_nm should lie between {first:g} and {last:g}; found {wavelength_nm:g}"
        )


def refractive_index(material: str, wavelength_nm: float) -> complex:
    """Refractive index n - ik of a material.

    Of water (Segelstein 1981), ice (Warren & Brandt 2008), glycol (ethylene glycol, Sani & Dell'Oro
    2014; n of others in fog fluids is within 0.03 of it) and the fluid of fog machines. The tables
    have steps of 10 nm; in between n is linear and k exponential. Water is at 25 °C: at 0 °C its n
    is 0.3 % and its k 10 % higher (Rowe 2020), which changes extinction by less than 1 % and
    absorption by 10 %. Mixtures are linear in volume.

    Parameters
    ----------
    material : str
        "water", "ice", "glycol" or "fog-fluid".
    wavelength_nm : float
        400 to 1700 nm.

    Raises
    ------
    InputError
        For another material or wavelength.
    """
    if material in MIXTURES:
        parts = MIXTURES[material].items()
        return sum(part * refractive_index(name, wavelength_nm) for name, part in parts)
    if material not in COLUMNS:
        known = (*COLUMNS, *MIXTURES)
        raise InputError(f"refractive index of {material!r}: {nearest(material, known)}")
    check_wavelength(wavelength_nm)
    table, column = _table(), COLUMNS[material]
    wavelengths = table[:, 0]
    n = np.interp(wavelength_nm, wavelengths, table[:, column])
    log_k = np.interp(wavelength_nm, wavelengths, np.log(table[:, column + 1]))
    return complex(float(n), -float(np.exp(log_k)))
