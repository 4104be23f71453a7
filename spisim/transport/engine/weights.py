"""Weights of strategies that find the same light (balance heuristic, Veach 1997, §9.2).

A strategy takes part in some of the light, depending on the index of the contributing vertex and on
whether the path has passed straight through a surface before. Its weight there follows from
`others`, the sum of the other strategies' densities relative to its own.
"""

from collections.abc import Callable
from typing import NamedTuple

import drjit as dr
import mitsuba as mi

from spisim.transport.jit import Bool, Float, UInt


class Weight(NamedTuple):
    """Of one strategy: the light in which it takes part, and its fraction there."""

    part: Callable[[UInt, Bool], Bool]  # (vertex, crossed)
    fraction: Callable[[Float, UInt], Float]  # (others, vertex)


#: The only strategy.
alone = Weight(lambda vertex, crossed: mi.Bool(True), lambda others, vertex: mi.Float(1))
#: The only strategy besides the sum along rays, which finds singly scattered light up to a surface.
alone_second_on_or_behind_glass = alone._replace(
    part=lambda vertex, crossed: (vertex > 1) | crossed
)
#: All light.
balanced = alone._replace(fraction=lambda others, vertex: dr.rcp(1 + others))
#: Light scattered twice or more; the rest is found elsewhere.
second_on = balanced._replace(part=lambda vertex, crossed: vertex > 1)
#: The same, and alone all singly scattered light behind a surface that it went straight through,
#: because the sum along rays ends at the first surface.
second_on_or_behind_glass = alone_second_on_or_behind_glass._replace(
    fraction=lambda others, vertex: dr.select(vertex == 1, 1, dr.rcp(1 + others))
)
