"""Refractive indices of water, ice and glycol."""

from functools import cache
from pathlib import Path

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.base.config import load_yaml

COLUMNS = {"water": 1, "ice": 3, "glycol": 5}  # column of n, followed by k


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
    """Refractive index n - ik of water (Segelstein 1981), ice (Warren & Brandt 2008) or glycol.

    The tables have steps of 10 nm; in between n is linear and k exponential. Water is at 25 °C: at
    0 °C its n is 0.3 % and its k 10 % higher (Rowe 2020), which changes extinction by less than 1 %
    and absorption by 10 %. Glycol is ethylene glycol (Sani & Dell'Oro 2014):
    fluids of fog machines are mixtures of propylene and triethylene glycol, glycerol and water,
    whose n is within 0.02 of it once the smoke holds as much water as the air around it.

    Parameters
    ----------
    material : str
        "water", "ice" or "glycol".
    wavelength_nm : float
        400 to 1700 nm.

    Raises
    ------
    InputError
        For another material or wavelength.
    """
    if material not in COLUMNS:
        raise InputError(f"refractive index of {material!r}: {nearest(material, COLUMNS)}")
    check_wavelength(wavelength_nm)
    table, column = _table(), COLUMNS[material]
    wavelengths = table[:, 0]
    n = np.interp(wavelength_nm, wavelengths, table[:, column])
    log_k = np.interp(wavelength_nm, wavelengths, np.log(table[:, column + 1]))
    return complex(float(n), -float(np.exp(log_k)))
