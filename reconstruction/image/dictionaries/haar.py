"""Haar wavelets: differences of neighbouring blocks."""

from ._wavelets import Wavelets

DICTIONARY = Wavelets("haar")
