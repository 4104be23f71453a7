"""Prior of targets: their reflectance, their range, and that they lie beyond the unambiguous range.

A target beyond that range has the phases of a nearer one, which would have to be darker by (r / (r
+ R))², and by the fog between them. Some surfaces are that dark.
"""

import numpy as np

from ...base.arrays import Floats

REFLECTANCE_MEDIAN = 0.27
REFLECTANCE_LOG_SIGMA = 0.8
"""Reflectance prior of materials at 1550 nm (median 0.35, standard deviation of ln 0.65) times the
cosine at which beams meet surfaces (uniform in solid angle: mean 0.77 of the normal's, skewed
down)."""
DARK = 0.2
"""Prior probability of the darkest surfaces, uniform in ln,"""
DARK_FROM, DARK_TO = 0.005, 0.1
"""from water, ice, old snow and glossy black plastic (0.016 to 0.023 at 1550 nm) at slanted
incidence to black rubber, paint and wet asphalt (0.04 to 0.08). 15 % of the materials in
`spisim/scene/materials.yaml`, where their measurements are named, are below 0.1; more is assumed,
as drones meet one of them for long."""
ODD = 0.05
"""Prior probability of anything else, uniform in ln: mirrors, edges, retro-reflectors."""
ODD_FROM, ODD_TO = 1e-4, 1e2
TYPICAL_RANGE_M = 5.0
"""Assumed: half of the targets are nearer than 0.6 times as far, 9 % farther than twice."""
BEYOND = 0.05
"""Prior probability of a target in the second unambiguous interval, from drawn worlds."""
INTERVALS = 2
"""Unambiguous intervals in which targets are looked for,"""
REACH_M = 40.0
"""if both end within this range: with 10 mW and a lens of 18 mm, a wall of reflectance 0.5 stands
out of the noise by 3 standard deviations there."""


def surface_log_prior(reflectance: Floats) -> Floats:
    """Log prior density (...) of reflectances (...)."""
    log = np.log(reflectance)
    usual = np.exp(-(((log - np.log(REFLECTANCE_MEDIAN)) / REFLECTANCE_LOG_SIGMA) ** 2) / 2) / (
        REFLECTANCE_LOG_SIGMA * np.sqrt(2 * np.pi)
    )
    dark = _uniform(reflectance, DARK_FROM, DARK_TO)
    odd = _uniform(reflectance, ODD_FROM, ODD_TO) + 1e-12
    return np.asarray(np.log((1 - DARK - ODD) * usual + DARK * dark + ODD * odd) - log)


def _uniform(reflectance: Floats, least: float, most: float) -> Floats:
    """Density of ln reflectance that is uniform between bounds."""
    within = (reflectance > least) & (reflectance < most)
    return np.where(within, 1 / np.log(most / least), 0.0)


def flat_log_prior(reflectance: Floats) -> Floats:
    """Log prior density without a radiometric scale: uniform in ln."""
    return np.asarray(-np.log(reflectance) - np.log(np.log(ODD_TO / ODD_FROM)))


def even_log_prior(reflectance: Floats) -> Floats:
    """Log prior density of reflectances (...): even up to one, and more for the darkest.

    Of the fog that spots share it prefers none, as `surface_log_prior` would.
    """
    even = 4 / np.pi / (1 + reflectance**2) ** 2
    dark = _uniform(reflectance, DARK_FROM, DARK_TO) / reflectance
    return np.asarray(np.log((1 - DARK) * even + DARK * dark))


def range_log_prior(range_m: Floats) -> Floats:
    """Log prior density (...) of ranges (...), per metre."""
    return np.asarray(-1.5 * np.log1p((range_m / TYPICAL_RANGE_M) ** 2) - np.log(TYPICAL_RANGE_M))


def interval_log_prior(range_m: Floats, unambiguous_m: float) -> Floats:
    """Log prior probability of the interval in which each range lies."""
    beyond = range_m > unambiguous_m
    return np.asarray(np.where(beyond, np.log(BEYOND), np.log(1 - BEYOND)))
