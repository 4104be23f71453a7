"""Weights of the strategies that find the same light (balance heuristic, Veach 1997, §9.2).

A strategy has a part in some of the light, by the number of the vertex at which it found it and
whether the path has passed straight through a surface before. Its share there follows from
`others`, the sum of the other strategies' densities relative to its own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.jit import Bool, Float, UInt


class Weight(NamedTuple):
    """Of one strategy: in which light it has a part, and how large its share is there."""

    part: Callable[[UInt, Bool], Bool]  # (vertex, crossed)
    fraction: Callable[[Float, UInt], Float]  # (others, vertex)


def _all(vertex: UInt, crossed: Bool) -> Bool:
    return mi.Bool(True)


def _second_on(vertex: UInt, crossed: Bool) -> Bool:
    return vertex > 1


def _second_on_or_behind_glass(vertex: UInt, crossed: Bool) -> Bool:
    return (vertex > 1) | crossed


def _balanced(others: Float, vertex: UInt) -> Float:
    return dr.rcp(1 + others)


#: Of a strategy that is the only one.
alone = Weight(_all, lambda others, vertex: mi.Float(1))
#: Of the only one, but for the sum along rays, which finds light scattered once up to a surface.
alone_second_on_or_behind_glass = Weight(
    _second_on_or_behind_glass, lambda others, vertex: mi.Float(1)
)
#: Of all light.
balanced = Weight(_all, _balanced)
#: Of light scattered twice or more; the rest is found elsewhere.
second_on = Weight(_second_on, _balanced)
#: The same, and alone all light scattered once behind a surface that it went straight through: the
#: sum along rays ends at the first surface.
second_on_or_behind_glass = Weight(
    _second_on_or_behind_glass,
    lambda others, vertex: dr.select(vertex == 1, 1, _balanced(others, vertex)),
)
