"""Smoke in scene files."""

from spisim.atmosphere.sections.fog import Fog


class Smoke(Fog):
    """Smoke, by the same fields as fog."""

    kind: str = "glycol"


WEATHER = Smoke
