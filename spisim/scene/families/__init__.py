"""Families of scenes, each of which draws any number of worlds from seeds.

Families are entry points of the group `spisim.families`: one family each, or a package whose
modules each hold one under `FAMILY`. A family builds the sections of a scene file with meshes in
memory.
"""

from collections.abc import Mapping
from typing import Any

from reconstruction.base.registry import Registry
from spisim.base.config.distributions import stream
from spisim.scene.families.builder import Family, Point, Pose, SceneBuilder
from spisim.scene.families.parameters import (
    Parameters,
    draw_parameters,
    drawn,
    drawn_log,
    one_of,
    ranges,
)

FAMILIES: Registry[Family] = Registry(
    "family",
    attribute="FAMILY",
    group="spisim.families",
    hint="the worlds that come with spisim are missing; reinstall it: pip install spisim",
)
"""The families by name."""

__all__ = [
    "FAMILIES",
    "Family",
    "Parameters",
    "Point",
    "Pose",
    "SceneBuilder",
    "build",
    "drawn",
    "drawn_log",
    "one_of",
    "ranges",
]


def build(
    name: str, seed: int, given: Mapping[str, Any], *, attempt: int = 0, source: str = "parameters"
) -> SceneBuilder:
    """Build a scene of a family.

    Parameters
    ----------
    name : str
        Name in `FAMILIES`.
    seed, attempt : int
        Determine the scene; attempts of one seed are different draws.
    given : mapping
        Values of parameters by name; the others are drawn from their ranges.
    source : str
        What messages call the origin of ``given``.

    Raises
    ------
    InputError
        For an unknown family, and parameters that are unknown or out of range.
    """
    family = FAMILIES[name]
    parameters = draw_parameters(family.parameters, seed, attempt, given, source)
    return family.build(parameters, stream(seed, attempt, "build"))
