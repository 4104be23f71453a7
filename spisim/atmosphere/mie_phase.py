"""Phase functions from Mie results, for the transport."""

from typing import Literal, TypeAlias, get_args

import numpy as np
from scipy.optimize import brentq

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.atmosphere.mie import Optics
from spisim.atmosphere.phase import Blend, HenyeyGreenstein, Phase, henyey_greenstein
from spisim.atmosphere.table import tabulate

PhaseName: TypeAlias = Literal["mie", "double-hg", "hg"]
PHASES: tuple[PhaseName, ...] = get_args(PhaseName)

#: The double Henyey-Greenstein function has the mean of Mie theory beyond this angle.
BACK_DEG = 175.0
#: Maximum mean cosine of a lobe.
MIN_WIDTH = 0.999


def phase_function(optics: Optics, form: str, name: str) -> Phase:
    """Phase function of a Mie result: "mie", "double-hg" or "hg".

    "mie" is the table itself. "hg" has its mean cosine but, for fog, 6 to 16 times too little
    backscatter. "double-hg" has the right amount over the last 5°, without rainbow and glory.
    InputError for another form, a forward lobe too narrow to tabulate, and if no double
    Henyey-Greenstein function fits.
    """
    if form == "mie":
        return tabulate(optics.table, declared_g=optics.g, name=name)
    if form == "double-hg":
        return double_henyey_greenstein(optics, name)
    if form == "hg":
        return henyey_greenstein(optics.g)
    raise InputError(f"phase {form!r}: {nearest(form, PHASES)}")


def double_henyey_greenstein(optics: Optics, name: str) -> Blend:
    """Forward and backward lobe with the table's <cos>, <cos²> and mean beyond 175°.

    Three parameters from three conditions (G. W. Kattawar, J. Quant. Spectrosc. Radiat. Transfer
    15, 839 (1975), with backscatter in place of the third moment). Around 90° it is 1.4 to 3 times
    too bright for fog. InputError if no such lobes exist.
    """
    cos, weights = _back()
    wanted = np.interp(np.degrees(np.arccos(cos)), optics.angles_deg, optics.phase) @ weights
    g, spread = optics.g, legendre_2(optics) - optics.g**2

    def lobes(backward: float) -> Blend:
        forward = g + spread / (g - backward)
        fraction = (g - backward) / (forward - backward)
        parts = (fraction, HenyeyGreenstein(forward)), (1 - fraction, HenyeyGreenstein(backward))
        return Blend(parts)

    def excess(backward: float) -> float:
        return float(lobes(backward).density(cos) @ weights - wanted)

    # The forward lobe narrows as the backward lobe approaches it.
    nearest_lobe = g - spread / (MIN_WIDTH - g)
    if (
        not (spread > 0 and nearest_lobe > -MIN_WIDTH)
        or excess(-MIN_WIDTH) * excess(nearest_lobe) > 0
    ):
        raise InputError(f"phase 'double-hg' does not fit {name}: use 'mie'")
    return lobes(float(brentq(excess, -MIN_WIDTH, nearest_lobe)))


def legendre_2(optics: Optics) -> float:
    """Mean Legendre polynomial P2 of the cosine; g² for Henyey-Greenstein."""
    angles = np.radians(optics.angles_deg)
    weights = optics.phase * np.sin(angles)
    cos = np.cos(angles)
    squared = np.trapezoid(weights * cos**2, angles) / np.trapezoid(weights, angles)
    return float((3 * squared - 1) / 2)


def _back() -> tuple[Floats, Floats]:
    """Cosines from `BACK_DEG` to 180°, and the weights of their mean."""
    nodes, weights = np.polynomial.legendre.leggauss(64)
    high = np.cos(np.radians(BACK_DEG))
    return (high - 1) / 2 + (high + 1) / 2 * nodes, weights / 2
