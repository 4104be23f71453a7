"""Weights of strategies that find the same light (balance heuristic, Veach 1997, §9.2).

A strategy takes part in some of the light, depending on the index of the contributing vertex and on
whether the path has passed straight through a surface before. Its weight there follows from
`others`, the sum of the other strategies' densities relative to its own.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.jit import Bool, Float, UInt


class Weight(NamedTuple):
    """Of one strategy: the light in which it takes part, and its fraction there."""

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


#: The only strategy.
alone = Weight(_all, lambda others, vertex: mi.Float(1))
#: The only strategy besides the sum along rays, which finds singly scattered light up to a surface.
alone_second_on_or_behind_glass = Weight(
    _second_on_or_behind_glass, lambda others, vertex: mi.Float(1)
)
#: All light.
balanced = Weight(_all, _balanced)
#: Light scattered twice or more; the rest is found elsewhere.
second_on = Weight(_second_on, _balanced)
#: The same, and alone all singly scattered light behind a surface that it went straight through,
#: because the sum along rays ends at the first surface.
second_on_or_behind_glass = Weight(
    _second_on_or_behind_glass,
    lambda others, vertex: dr.select(vertex == 1, 1, _balanced(others, vertex)),
)
