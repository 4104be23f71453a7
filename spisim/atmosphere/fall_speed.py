"""How fast raindrops fall."""

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError

#: Air in which Gunn & Kinzer measured fall speeds, and the densities of air on Earth's surface.
LABORATORY_KG_PER_M3, AIR_KG_PER_M3 = 1.204, (0.5, 1.6)


def terminal_speed_m_s(
    diameter_mm: Floats, air_density_kg_m3: float = LABORATORY_KG_PER_M3
) -> Floats:
    """Fall speed of raindrops in still air.

    Within a few percent of Gunn & Kinzer's from 0.6 to 5.8 mm; smaller drops are slower, 0.5
    instead of 0.7 m/s at 0.2 mm (D. Atlas, R. C. Srivastava & R. S. Sekhon, Rev. Geophys. 11, 1,
    1973). In thinner air all are faster by the power 0.4 of the density (G. B. Foote & P. S. du
    Toit, J. Appl. Meteorol. 8, 249, 1969).
    """
    still = np.maximum(9.65 - 10.3 * np.exp(-0.6 * np.asarray(diameter_mm)), 0.0)
    return np.asarray(still * (LABORATORY_KG_PER_M3 / air_density_kg_m3) ** 0.4)


def check_air(density_kg_m3: float) -> None:
    """InputError unless air has such a density somewhere on Earth."""
    low, high = AIR_KG_PER_M3
    if not low <= density_kg_m3 <= high:
        raise InputError(
            f"air_density_kg_m3 should lie between {low:g} and {high:g} (1.2 at sea level, 1.1 at "
            f"1 km); found {density_kg_m3:g}"
        )
