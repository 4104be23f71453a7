"""What hangs in the air between instrument and scene: fog, smoke, rain and snow."""

from spisim.atmosphere.droplets import (
    FOGS,
    KINDS,
    SMOKES,
    GammaSizes,
    LogNormalSizes,
    Particles,
)
from spisim.atmosphere.empirical import MODELS, all_extinctions, empirical_extinction
from spisim.atmosphere.fog import agreed_visibility, fog, visibility_of_water
from spisim.atmosphere.indices import refractive_index
from spisim.atmosphere.medium import CLEAR, Atmosphere, combine, explicit
from spisim.atmosphere.mie_phase import PHASES, PhaseName
from spisim.atmosphere.phase import (
    Blend,
    HenyeyGreenstein,
    Isotropic,
    Phase,
    Tabulated,
    henyey_greenstein,
)
from spisim.atmosphere.rain import RAINS, Diffraction, rain
from spisim.atmosphere.snow import SNOW_G, SNOWS, snow
from spisim.atmosphere.table import tabulate
from spisim.atmosphere.visibility import extinction_at_550nm

__all__ = [
    "CLEAR",
    "FOGS",
    "KINDS",
    "MODELS",
    "PHASES",
    "RAINS",
    "SMOKES",
    "SNOWS",
    "SNOW_G",
    "Atmosphere",
    "Blend",
    "Diffraction",
    "GammaSizes",
    "HenyeyGreenstein",
    "Isotropic",
    "LogNormalSizes",
    "Particles",
    "Phase",
    "PhaseName",
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
