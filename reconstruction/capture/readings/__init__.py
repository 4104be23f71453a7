"""Kinds of time-of-flight readings, one module each, named after their measurement method."""

from ...base.registry import Registry
from ..spots import Spots

READINGS: Registry[type[Spots]] = Registry(
    "method of time of flight",
    package=__name__,
    attribute="READINGS",
    group="reconstruction.readings",
)
