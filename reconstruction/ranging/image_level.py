"""How far a surface can be whose pixel is so bright.

A pixel collects rho U(x) electrons of a surface of reflectance rho at x, U being what a white one
would return, and those of fog before it. With the prior of reflectances that is a likelihood of x:
what is bright is near, wherever the lasers are blind.
"""

import numpy as np

from ..base.arrays import Floats
from ..base.errors import InputError
from ..capture import Optics, Spots
from .brightness import Brightness, bucket_optics
from .first_surface import EDGES_M, STEP
from .fog.overlap import overlap
from .fog.target_prior import surface_log_prior
from .weather import weather_of

REFLECTANCES = np.geomspace(0.005, 2.0, 20)
"""Nodes over the prior of reflectance; beyond one: mirrors, and what the calibration leaves."""
VEILS = np.geomspace(1e-3, 0.3, 6)
"""Light of the fog before a surface, relative to a white surface at 1 m, where there is fog: that
in 10 m of visibility at most (see docs/theory/ranging-in-fog.md)."""
FOG = 0.5
"""Prior probability of fog, unless the weather is stated."""
TEXTURE = 0.35
"""Relative rms difference in brightness between a pixel and a spot in it."""
UNEVEN = 0.3
"""Relative uncertainty of each node of the veil."""
FLOOR = 0.02
"""Likelihood of any range, relative to the likeliest: pixels are no spots, and edges are frequent.
"""


class ImageLevel:
    """Likelihood of ranges by the brightness of the image, for the optics of a recording."""

    def __init__(self, white: Floats, fog: float) -> None:
        """Take ``white`` (spots, K + 1) electrons of a white surface in each cell of `EDGES_M`."""
        at_1_m = np.array([np.interp(1.0, EDGES_M, each[:-1]) for each in white])
        log_prior = surface_log_prior(REFLECTANCES) + np.log(REFLECTANCES)
        prior = np.exp(log_prior - log_prior.max())
        veils = at_1_m[:, None] * np.append(0, VEILS)  # (spots, V)
        air = np.append(1 - fog, np.full(VEILS.size, fog / VEILS.size))
        surface = white[..., None] * REFLECTANCES  # (spots, K + 1, R)
        self._mean = surface[..., None] + veils[:, None, None]
        self._variance = (TEXTURE * surface[..., None]) ** 2 + (UNEVEN * veils[:, None, None]) ** 2
        self._prior = (prior / prior.sum())[:, None] * air

    @classmethod
    def of(cls, optics: Optics | None, spots: Spots) -> "ImageLevel | None":
        """For a recording; None if it does not state how bright a white surface is."""
        photodiodes = bucket_optics(optics, spots)
        if not photodiodes:
            return None
        assert optics is not None
        middles_m = np.append(EDGES_M / np.sqrt(STEP), EDGES_M[-1])
        try:
            weight = np.sum([overlap(each, middles_m)[0] for each in photodiodes], axis=0)
        except InputError:
            return None
        white = np.mean(optics.pixel_electrons) * weight / np.pi
        white[:, -1] = 0.0  # nothing
        clear = weather_of(spots).clear_probability
        return cls(white, FOG if np.isnan(clear) else 1 - clear)

    def likelihood(self, brightness: Brightness) -> Floats:
        """Likelihood (spots, K + 1) of the cells, of at most one; one where nothing is known."""
        electrons, sigma = (each[:, None, None, None] for each in brightness)
        variance = self._variance + sigma**2
        with np.errstate(divide="ignore", invalid="ignore"):
            density = np.exp(-((electrons - self._mean) ** 2) / (2 * variance)) / np.sqrt(variance)
        likelihood = (density * self._prior).sum(axis=(2, 3))
        most = likelihood.max(axis=1, keepdims=True)
        with np.errstate(invalid="ignore"):
            likelihood = (likelihood / most + FLOOR) / (1 + FLOOR)
        return np.where(np.isfinite(likelihood), likelihood, 1.0)
