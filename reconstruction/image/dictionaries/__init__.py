"""Dictionaries in which images are sparse, one module each."""

from ...base.registry import Registry
from ..dictionary import Dictionary

DICTIONARIES: Registry[Dictionary] = Registry(
    "dictionary", package=__name__, attribute="DICTIONARY", group="reconstruction.dictionaries"
)
