"""Families of scenes: each draws any number of different worlds from a seed.

A family is a module with its parameters, their ranges, and a function that builds a scene from
them. What it builds are the sections of a scene file, with meshes in memory instead of in files.
"""

from collections.abc import Mapping
from typing import Any

from reconstruction.errors import InputError, nearest
from spisim.distributions import stream
from spisim.families import (
    drone,
    forest,
    gates,
    landing_pad,
    person,
    power_line,
    rubble,
    scaffold,
    shelf,
    stairwell,
    street,
    targets,
    tunnel,
    warehouse,
)
from spisim.families.draft import Draft, Family
from spisim.families.parameters import Parameters, draw_parameters, ranges

_MODULES = (
    drone,
    forest,
    gates,
    landing_pad,
    person,
    power_line,
    rubble,
    scaffold,
    shelf,
    stairwell,
    street,
    targets,
    tunnel,
    warehouse,
)
#: The families by name, in alphabetical order.
FAMILIES: Mapping[str, Family] = {
    family.name: family
    for family in sorted((module.FAMILY for module in _MODULES), key=lambda family: family.name)
}

__all__ = ["FAMILIES", "Draft", "Family", "Parameters", "draft", "find_family", "ranges"]


def find_family(name: str) -> Family:
    """Family of this name; InputError, naming the nearest, where there is none."""
    if name not in FAMILIES:
        raise InputError(f"unknown family {name!r}: {nearest(name, sorted(FAMILIES))}")
    return FAMILIES[name]


def draft(
    name: str, seed: int, given: Mapping[str, Any], *, attempt: int = 0, source: str = "parameters"
) -> Draft:
    """Scene of a family with the given parameters, the others and all else by seed and attempt.

    Raises InputError for an unknown family, and parameters that are unknown or out of range.
    """
    family = find_family(name)
    parameters = draw_parameters(family.parameters, seed, attempt, given, source)
    return family.build(parameters, stream(seed, attempt, "build"))
