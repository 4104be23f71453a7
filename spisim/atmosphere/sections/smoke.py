"""Smoke in scene files."""

from spisim.atmosphere.sections.fog import Fog


class Smoke(Fog):
    """Smoke, by the same fields as fog."""

    kind: str = "glycol"
    """Name of its particles' sizes; for smoke by visibility or water."""


WEATHER = Smoke
