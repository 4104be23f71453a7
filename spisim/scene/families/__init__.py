"""Families of scenes: each draws any number of different worlds from a seed.

A family is a module here, named like it, with its parameters, their ranges, and a function that
builds a scene from them; or an entry point of another package. What it builds are the sections of a
scene file, with meshes in memory instead of in files.
"""

from collections.abc import Mapping
from typing import Any

from reconstruction.registry import Registry
from spisim.config.distributions import stream
from spisim.scene.families.parts.draft import Draft, Family
from spisim.scene.families.parts.parameters import Parameters, draw_parameters, ranges

#: The families by name.
FAMILIES: Registry[Family] = Registry(
    "family", package=__name__, attribute="FAMILY", group="spisim.families"
)

__all__ = ["FAMILIES", "Draft", "Family", "Parameters", "draft", "ranges"]


def draft(
    name: str, seed: int, given: Mapping[str, Any], *, attempt: int = 0, source: str = "parameters"
) -> Draft:
    """Scene of a family with the given parameters, the others and all else by seed and attempt.

    Raises InputError for an unknown family, and parameters that are unknown or out of range.
    """
    family = FAMILIES[name]
    parameters = draw_parameters(family.parameters, seed, attempt, given, source)
    return family.build(parameters, stream(seed, attempt, "build"))
