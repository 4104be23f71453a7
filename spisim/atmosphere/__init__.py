"""What hangs in the air between instrument and scene: fog by visibility, at 1550 nm."""

from spisim.atmosphere.fog import CLEAR, FOGS, Atmosphere, explicit, extinction_at_550nm, fog
from spisim.atmosphere.phase import (
    Blend,
    HenyeyGreenstein,
    Isotropic,
    Phase,
    Tabulated,
    henyey_greenstein,
)
from spisim.atmosphere.table import tabulate

__all__ = [
    "CLEAR",
    "FOGS",
    "Atmosphere",
    "Blend",
    "HenyeyGreenstein",
    "Isotropic",
    "Phase",
    "Tabulated",
    "explicit",
    "extinction_at_550nm",
    "fog",
    "henyey_greenstein",
    "tabulate",
]
