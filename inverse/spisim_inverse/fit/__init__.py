"""Fits of scene and instrument to a recording, by maximum likelihood."""

from spisim_inverse.fit.fitting import fit
from spisim_inverse.fit.result import Fitted
from spisim_inverse.fit.twin import Twin

__all__ = ["Fitted", "Twin", "fit"]
