"""Daubechies wavelets with four vanishing moments."""

from ._wavelets import Wavelets

DICTIONARY = Wavelets("db4")
