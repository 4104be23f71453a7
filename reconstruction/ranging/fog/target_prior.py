"""Prior of targets: their reflectance, and whether they lie beyond the unambiguous range.

A target beyond that range has the phases of a nearer one, which would have to be darker than most
surfaces: by (r / (r + R))², and by the fog between them.
"""

import numpy as np

from ...base.arrays import Floats, Mask

REFLECTANCE_MEDIAN = 0.27
REFLECTANCE_LOG_SIGMA = 0.8
"""Reflectance prior of materials at 1550 nm (median 0.35, standard deviation of ln 0.65) times the
cosine at which beams meet surfaces (uniform in solid angle: mean 0.77 of the normal's, skewed
down)."""
ODD = 0.07
"""Prior probability of anything else, uniform in ln: water, ice, mirrors, edges."""
ODD_FROM, ODD_TO = 1e-4, 1e2
BRIGHT = 1.0
"""Reflectance beyond which `bright_log_prior` falls."""
BEYOND = 0.05
"""Prior probability of a target in the second unambiguous interval, from drawn worlds."""
INTERVALS = 2
"""Unambiguous intervals in which targets are looked for."""


def surface_log_prior(reflectance: Floats) -> Floats:
    """Log prior density (...) of reflectances (...)."""
    log = np.log(reflectance)
    usual = np.exp(-(((log - np.log(REFLECTANCE_MEDIAN)) / REFLECTANCE_LOG_SIGMA) ** 2) / 2) / (
        REFLECTANCE_LOG_SIGMA * np.sqrt(2 * np.pi)
    )
    within = (reflectance > ODD_FROM) & (reflectance < ODD_TO)
    odd = np.where(within, 1 / np.log(ODD_TO / ODD_FROM), 1e-12)
    return np.asarray(np.log((1 - ODD) * usual + ODD * odd) - log)


def flat_log_prior(reflectance: Floats) -> Floats:
    """Log prior density without a radiometric scale: uniform in ln."""
    return np.asarray(-np.log(reflectance) - np.log(np.log(ODD_TO / ODD_FROM)))


def bright_log_prior(reflectance: Floats) -> Floats:
    """Log of a density, up to a constant, that is flat but for reflectances (...) above one."""
    return np.asarray(-2 * np.log1p((reflectance / BRIGHT) ** 2))


def interval_log_prior(range_m: Floats, unambiguous_m: float) -> Floats:
    """Log prior probability of the interval in which each range lies."""
    beyond = range_m > unambiguous_m
    return np.asarray(np.where(beyond, np.log(BEYOND), np.log(1 - BEYOND)))


def twin_log_prior(nearer: Floats, farther: Floats, beyond: Mask) -> Floats:
    """Log probability of each target among two with the same phases, an unambiguous range apart.

    Parameters
    ----------
    nearer, farther
        Reflectances (C,) that explain the echo at either range.
    beyond
        Which targets (C,) are the farther ones.
    """
    near = np.log(1 - BEYOND) + _log_density_of_log(nearer)
    far = np.log(BEYOND) + _log_density_of_log(farther)
    return np.asarray(np.where(beyond, far, near) - np.logaddexp(near, far))


def _log_density_of_log(reflectance: Floats) -> Floats:
    """Log prior density of ln reflectance, where however dark a surface is not impossible."""
    darkest = np.maximum(reflectance, 2 * ODD_FROM)
    return surface_log_prior(darkest) + np.log(darkest)
