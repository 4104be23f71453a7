"""Smoke in scene files."""

from spisim.atmosphere.sections.fog import Fog


class Smoke(Fog):
    """Smoke, with the fields of fog."""

    kind: str = "fog-machine"
    """Named particle sizes, for smoke by visibility or water."""


WEATHER = Smoke
