"""Media between instrument and scene: fog, smoke, rain and snow."""

from spisim.atmosphere.droplets import FOGS, KINDS, GammaSizes, LogNormalSizes, Particles
from spisim.atmosphere.empirical import all_extinctions, empirical_extinction
from spisim.atmosphere.fog import agreed_visibility, fog, visibility_of_water
from spisim.atmosphere.indices import refractive_index
from spisim.atmosphere.medium import CLEAR, Atmosphere, combine, explicit
from spisim.atmosphere.mie_phase import PHASES
from spisim.atmosphere.phase import (
    Blend,
    HenyeyGreenstein,
    Isotropic,
    Phase,
    Tabulated,
    henyey_greenstein,
)
from spisim.atmosphere.rain import RAINS, rain
from spisim.atmosphere.snow import snow
from spisim.atmosphere.table import tabulate
from spisim.atmosphere.visibility import extinction_at_550nm

__all__ = [
    "CLEAR",
    "FOGS",
    "KINDS",
    "PHASES",
    "RAINS",
    "Atmosphere",
    "Blend",
    "GammaSizes",
    "HenyeyGreenstein",
    "Isotropic",
    "LogNormalSizes",
    "Particles",
    "Phase",
    "Tabulated",
    "agreed_visibility",
    "all_extinctions",
    "combine",
    "empirical_extinction",
    "explicit",
    "extinction_at_550nm",
    "fog",
    "henyey_greenstein",
    "rain",
    "refractive_index",
    "snow",
    "tabulate",
    "visibility_of_water",
]
