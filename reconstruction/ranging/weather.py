"""Weather stated by the user, which two readings per spot cannot show."""

import math
from contextlib import suppress
from dataclasses import replace
from typing import NamedTuple

from ..base.errors import InputError
from ..capture import Setup
from ..capture.spots import SpotOptics

WORDS = {"unknown": math.nan, "clear": 1.0, "fog": 0.0}
"""Probability of clear air."""
VISIBILITIES_M = 1.0, 50_000.0
KOSCHMIEDER = -math.log(0.02)
"""Extinction at 550 nm times visibility, for a contrast of 2 % (H. Koschmieder, 1924); the one
definition of visibility in this package."""


class Weather(NamedTuple):
    """Prior of fog ranging, nan if unstated.

    ``clear_probability`` that fog is too thin to matter; ``visibility_m`` in fog otherwise.
    """

    clear_probability: float = math.nan
    visibility_m: float = math.nan

    @classmethod
    def parsed(cls, stated: "str | float") -> "Weather":
        """Parse "clear", "fog", "unknown" or a visibility in metres; may raise InputError."""
        if isinstance(stated, str) and stated.strip() in WORDS:
            return cls(WORDS[stated.strip()])
        with suppress(ValueError, TypeError):
            if isinstance(stated, bool):
                raise ValueError
            visibility_m = float(stated)
            if VISIBILITIES_M[0] <= visibility_m <= VISIBILITIES_M[1]:
                return cls(0.0, visibility_m)
        raise InputError(
            f"weather is {stated!r}; allowed: {', '.join(WORDS)}, or a visibility from "
            f"{VISIBILITIES_M[0]:g} to {VISIBILITIES_M[1]:g} metres"
        )


def weather_of(spots: SpotOptics) -> Weather:
    """Weather stated by a recording."""
    return Weather(spots.clear_probability, spots.visibility_m)


def with_weather(setup: Setup, weather: Weather) -> Setup:
    """Copy of a setup with this stated weather."""
    if setup.spots is None:
        return setup
    return replace(setup, spots=replace(setup.spots, **weather._asdict()))
