"""How probable a reflectance along a laser's beam is, before any reading."""

import numpy as np

from ...base.arrays import Floats

MEDIAN = 0.27
LOG_SIGMA = 0.8
"""Of materials at 1550 nm (median 0.35, standard deviation of ln 0.65) times the cosine at which
beams meet surfaces (drawn evenly in solid angle: mean 0.77 of the normal's, skewed down)."""
ODD = 0.07
"""Probability of anything else, evenly in ln: water, ice, mirrors, retro-reflectors, edges."""
ODD_FROM, ODD_TO = 1e-4, 1e2


def log_of_surfaces(reflectance: Floats) -> Floats:
    """Logarithm of the prior's density (...) at reflectances (...)."""
    log = np.log(reflectance)
    usual = np.exp(-(((log - np.log(MEDIAN)) / LOG_SIGMA) ** 2) / 2) / (
        LOG_SIGMA * np.sqrt(2 * np.pi)
    )
    within = (reflectance > ODD_FROM) & (reflectance < ODD_TO)
    odd = np.where(within, 1 / np.log(ODD_TO / ODD_FROM), 1e-12)
    return np.asarray(np.log((1 - ODD) * usual + ODD * odd) - log)


def log_of_anything(reflectance: Floats) -> Floats:
    """The same where the readings have no radiometric scale: even in ln."""
    return np.asarray(-np.log(reflectance) - np.log(np.log(ODD_TO / ODD_FROM)))
