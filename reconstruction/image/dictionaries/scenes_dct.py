"""Cosines as they vary in drawn scenes: stronger along the axes than across.

What people build is upright, and so are the strongest frequencies: besides falling with frequency f
their variance follows their direction t,

    S = f^-2p exp(a cos 4 t).

Exponent p and strength a are fitted, for images of any size, to drawn scenes and dead leaves by
`tools/fitted_covariance.py`.
"""

import json
from functools import cached_property
from pathlib import Path

import numpy as np

from ...arrays import Floats
from .dct import Dct

FITTED = Path(__file__).with_suffix(".json")


class ScenesDct(Dct):
    """Cosines with fitted variances."""

    def deviation(self, shape: tuple[int, int]) -> Floats:
        """0 for the constant image."""
        exponent, axes = self._fitted
        return axial_deviation(shape, exponent, axes)

    @cached_property
    def _fitted(self) -> tuple[float, float]:
        told = json.loads(FITTED.read_text())
        return told["exponent"], told["axes"]


def axial_deviation(shape: tuple[int, int], exponent: float, axes: float) -> Floats:
    """f^-p exp(a / 2 cos 4 t) of cosines (H, W), 0 for the constant."""
    vertical, horizontal = (np.arange(side) / side for side in shape)
    frequency = np.hypot.outer(vertical, horizontal)
    frequency[0, 0] = np.inf
    fourfold = np.cos(4 * np.arctan2.outer(vertical, horizontal))
    return np.asarray(frequency**-exponent * np.exp(axes / 2 * fourfold))


DICTIONARY = ScenesDct()
