"""Kinds of time-of-flight readings, one module each, named as the method that makes them."""

from ...base.registry import Registry
from ..spots import Spots

READINGS: Registry[type[Spots]] = Registry(
    "method of time of flight",
    package=__name__,
    attribute="READINGS",
    group="reconstruction.readings",
)
