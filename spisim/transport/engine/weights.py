"""Weights of the strategies that find the same light (balance heuristic, Veach 1997, §9.2).

A weight follows from `others`, the sum of the other strategies' densities relative to that of the
one that found the light, the number of the vertex at which it did, and whether the path has passed
straight through a surface before.
"""

from __future__ import annotations

from collections.abc import Callable
from typing import Any

import drjit as dr
import mitsuba as mi

Weight = Callable[[Any, Any, Any], Any]


def alone(others: Any, vertex: Any, crossed: Any) -> Any:
    """Of a strategy that is the only one."""
    return mi.Float(1)


def balanced(others: Any, vertex: Any, crossed: Any) -> Any:
    """Of all light."""
    return dr.rcp(1 + others)


def second_on(others: Any, vertex: Any, crossed: Any) -> Any:
    """Of light scattered twice or more; the rest is found elsewhere."""
    return dr.select(vertex == 1, 0, balanced(others, vertex, crossed))


def second_on_or_behind_glass(others: Any, vertex: Any, crossed: Any) -> Any:
    """The same, and all light scattered once behind a surface that it went straight through.

    The sum along the projector's rays ends at the first surface.
    """
    once = dr.select(crossed, 1, 0)
    return dr.select(vertex == 1, once, balanced(others, vertex, crossed))
