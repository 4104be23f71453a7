"""Light between the nodes of a lattice, each of which is solved once, when it is needed.

A position has one coordinate per degree of freedom. Between nodes the light is interpolated
linearly over the simplex that contains the position (Kuhn's triangulation, as of a colour cube in
tetrahedra): d + 1 nodes where d coordinates lie between nodes, and only two along an axis. The
light depends on the position alone, not on the way there.

Before they are added up, echoes of a surface are shifted to the interpolated range. Otherwise two
echoes a few centimetres apart would beat: at 240 MHz 5 cm would take 3 % of the amplitude, which is
many times its noise.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.simulation.drops import Interpolation
from spisim.simulation.light.solve import Transport

#: Decimal places of coordinates in steps, so that rounding errors require no further node.
ROUNDING = 6

#: Path lengths at two nodes that differ by more belong to two surfaces, and both are seen.
SAME_SURFACE_M = 0.5

#: Instants over which the mean of light within a frame is taken.
INSTANTS = 64

Node = tuple[int, ...]


def instants(start: float, stop: float) -> Floats:
    """Instants (n,) spread evenly over a part of a frame, of which 1 is the whole."""
    return start + (stop - start) * (np.arange(INSTANTS) + 0.5) / INSTANTS


@dataclass(frozen=True, eq=False)
class LatticeLight:
    """Light of a recording at the times of `interpolation`; see `Light`."""

    transports: tuple[Transport, ...]
    interpolation: Interpolation

    def between(self, times_s: Floats) -> Interpolation:
        """The light at the times that it was made for, (frames, M)."""
        assert times_s.shape == self.interpolation.keys.shape[:2]
        return self.interpolation

    def during(self, frames: int, start: float, stop: float) -> Interpolation:
        """See `Light`."""
        chosen = (instants(start, stop) * self.interpolation.keys.shape[1]).astype(np.intp)
        keys, fractions = self.interpolation
        return Interpolation(keys[:frames, chosen], fractions[:frames, chosen])


class Lattice:
    """Solutions at nodes, the last `cached` of which are cached; `solved` counts them all.

    A solution needs `spot_orders` among its `extra`.
    """

    def __init__(self, solve: Callable[[Node], Transport], cached: int) -> None:
        self.solved = 0
        self._solve = solve
        self._maximum = cached
        self._cache: OrderedDict[Node, _Key] = OrderedDict()

    def light(self, positions: Floats) -> LatticeLight:
        """Light of a frame with exposures at positions (M, d) in steps of the lattice."""
        nodes, fractions = simplices(positions)
        used = np.unique(nodes[fractions > 0], axis=0)
        numbers = {tuple(node): number for number, node in enumerate(used.tolist())}
        flat = nodes.reshape(-1, nodes.shape[-1]).tolist()
        # Any solved node stands in for those of weight 0.
        keys = np.array([numbers.get(tuple(node), 0) for node in flat], np.intp)
        weights = np.bincount(keys, fractions.ravel()) / len(positions)
        transports = _aligned([self.at(node) for node in numbers], weights)
        return LatticeLight(
            transports, Interpolation(keys.reshape(1, *fractions.shape), fractions[None])
        )

    def at(self, node: Node) -> _Key:
        """Light at a node, solved unless it is cached."""
        result = self._cache.pop(node, None)
        if result is None:
            result = _Key.of(self._solve(node))
            self.solved += 1
        self._cache[node] = result
        if len(self._cache) > self._maximum:
            self._cache.popitem(last=False)
        return result


def simplices(positions: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Nodes (M, d + 1, d) around positions (M, d), and their weights (M, d + 1) of sum 1."""
    positions = np.round(positions, ROUNDING)
    base = np.floor(positions)
    rest = positions - base
    order = np.argsort(-rest, axis=1, kind="stable")
    falling = np.take_along_axis(rest, order, axis=1)
    bounds = np.pad(falling, ((0, 0), (1, 1)), constant_values=0.0)
    bounds[:, 0] = 1.0
    # From corner to corner along the axes, those with the largest remainder first.
    steps = np.cumsum(np.eye(positions.shape[1], dtype=np.int64)[order], axis=1)
    corners = np.pad(steps, ((0, 0), (1, 0), (0, 0)))
    return base.astype(np.int64)[:, None] + corners, bounds[:, :-1] - bounds[:, 1:]


@dataclass(frozen=True, eq=False)
class _Key:
    """A solution, and the unscattered light (spots, bins) of the spots, which surfaces reflect.

    `path_m` (spots,) is its mean path length, nan without light.
    """

    transport: Transport
    surfaces: Floats
    path_m: Floats

    @classmethod
    def of(cls, transport: Transport) -> _Key:
        surfaces = transport.extra["spot_orders"][0]
        whole = surfaces.sum(axis=1)
        with np.errstate(invalid="ignore"):
            path_m = surfaces @ transport.path_length_m / whole
        extra = {name: each for name, each in transport.extra.items() if name == "phasors"}
        return cls(replace(transport, extra=extra), surfaces, path_m)

    def moved(self, by_m: Floats) -> Transport:
        """Solution whose surface echoes have paths that are longer by (spots,)."""
        histogram = self.transport.spot_histogram.copy()
        lengths = self.transport.path_length_m
        for spot in np.flatnonzero(by_m):
            bins = np.flatnonzero(self.surfaces[spot])
            light = self.surfaces[spot, bins]
            position = np.interp(lengths[bins] + by_m[spot], lengths, np.arange(lengths.size))
            before = np.minimum(position.astype(np.intp), lengths.size - 2)
            following = position - before
            histogram[spot, bins] -= light
            np.add.at(histogram[spot], before, (1 - following) * light)
            np.add.at(histogram[spot], before + 1, following * light)
        return replace(self.transport, spot_histogram=histogram)


def _aligned(keys: list[_Key], weights: Floats) -> tuple[Transport, ...]:
    """Solutions whose echoes of one surface are shifted to its mean path by weights (keys,)."""
    paths_m = np.array([key.path_m for key in keys])
    with np.errstate(invalid="ignore"):
        same = np.ptp(paths_m, axis=0) < SAME_SURFACE_M  # nan is not
    moved_m = np.where(same, weights @ paths_m - paths_m, 0.0)
    return tuple(key.moved(by_m) for key, by_m in zip(keys, moved_m, strict=True))
