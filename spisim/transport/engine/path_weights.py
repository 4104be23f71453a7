"""Weights of paths by what they have met: derivatives, and fog of other extinctions.

Contributions times a path's score (`spisim.transport.scores`), summed beside the light itself, are
unbiased estimates of its derivative from the same paths: perturbation Monte Carlo (C. K. Hayakawa
et al., Opt. Lett. 26, 1335 (2001)). Fog of extinction σ alone gives a path of length L with n
scatterings the factor σⁿ exp(−σ L), whatever strategy has built the path, so that

    f(r σ) / f(σ) = rⁿ exp(−(r − 1) σ L)

makes it light at another extinction. Weights of an extinction far away vary so much between paths
that few of them carry the estimate.
"""

from collections.abc import Callable, Iterable, Mapping
from dataclasses import dataclass
from functools import cached_property
from typing import Protocol

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.transport.engine.accumulator import MAX_SUM_PER_M2, MAX_WEIGHT
from spisim.transport.engine.tally import Contribution, MakeTally
from spisim.transport.jit import Float
from spisim.transport.scores import Parameter

#: Weight of a path.
OfPath = Callable[[Contribution], Float]


class PathWeight(Protocol):
    """A weight of paths; sums of weighted light are named ``<sum>_<name>``."""

    @property
    def name(self) -> str:
        """Ending of the names of its sums."""

    def compiled(self) -> OfPath:
        """The weight, whose constants are opaque: other values need no other kernel."""


@dataclass(frozen=True)
class Score:
    """The score by a parameter, which the world keeps track of under the same name."""

    name: str
    parameter: Parameter

    def compiled(self) -> OfPath:
        """See `PathWeight`."""
        return lambda light: light.scores.get(self.name, mi.Float(0))


@dataclass(frozen=True)
class ExtinctionRatio:
    """rⁿ exp(−(r − 1) σ L), to the power ``power``: fog of ``ratio`` r times its extinction σ."""

    name: str
    ratio: float
    extinction_per_m: float
    power: int = 1

    def compiled(self) -> OfPath:
        """See `PathWeight`."""
        each = dr.opaque(mi.Float, self.power * np.log(self.ratio))
        per_m = dr.opaque(mi.Float, self.power * (self.ratio - 1) * self.extinction_per_m)
        return lambda light: dr.exp(each * light.scatterings - per_m * light.length_m)


def tracked_by(weights: Iterable[PathWeight]) -> dict[str, Parameter]:
    """Parameters that a world must keep track of, by name."""
    return {each.name: each.parameter for each in weights if isinstance(each, Score)}


class WeightedTally:
    """Another tally of weighted light; nan if that is too much to be summed exactly."""

    def __init__(self, cells: int, make: MakeTally, weight: PathWeight) -> None:
        self._tally, self._name, self._of_path = make(cells), weight.name, weight.compiled()
        self._beyond = dr.zeros(mi.Float, 1)  # per m²: all light of weights above `MAX_WEIGHT`

    def add(self, light: Contribution) -> None:
        weight = self._of_path(light)
        size: Float = dr.abs(weight)
        value: Float = light.value * weight
        beyond = light.active & ~(size <= MAX_WEIGHT)
        dr.scatter_reduce(dr.ReduceOp.Add, self._beyond, dr.abs(value), 0, beyond)
        counted = light.active & dr.isfinite(value) & (size > 0)
        self._tally.add(light._replace(value=value, active=counted))

    @cached_property
    def _is_exact(self) -> bool:
        return float(self._beyond.numpy()[0]) < MAX_SUM_PER_M2 / 2

    def read(self, part: int, parts: int) -> Mapping[str, Floats]:
        """See `Tally`."""
        scale = 1.0 if self._is_exact else np.nan
        sums = self._tally.read(part, parts)
        return {f"{name}_{self._name}": scale * values for name, values in sums.items()}
