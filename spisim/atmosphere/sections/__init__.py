"""Kinds of weather, one module each, named like their section of a scene file."""

from reconstruction.base.registry import Registry
from spisim.atmosphere.weather import Weather

WEATHER: Registry[type[Weather]] = Registry(
    "weather", package=__name__, attribute="WEATHER", group="spisim.weather"
)
