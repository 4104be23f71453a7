"""Families of scenes: each draws any number of different worlds from a seed.

Families are entry points of the group `spisim.families`: one family each, or a package of which
every module holds one under `FAMILY`. What a family builds are the sections of a scene file, with
meshes in memory instead of in files.
"""

from collections.abc import Mapping
from typing import Any

from reconstruction.base.registry import Registry
from spisim.base.config.distributions import stream
from spisim.scene.families.builder import Family, Placed, Point, SceneBuilder
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
    "Placed",
    "Point",
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
    """Scene of a family with the given parameters, the others and all else by seed and attempt.

    Parameters
    ----------
    name : str
        Name in `FAMILIES`.
    seed, attempt : int
        The scene follows from both; attempts of one seed are different draws.
    given : mapping
        Values of parameters by name; the others are drawn from their ranges.
    source : str
        What an error names as the origin of ``given``.

    Raises
    ------
    InputError
        For an unknown family, and parameters that are unknown or out of range.
    """
    family = FAMILIES[name]
    parameters = draw_parameters(family.parameters, seed, attempt, given, source)
    return family.build(parameters, stream(seed, attempt, "build"))
