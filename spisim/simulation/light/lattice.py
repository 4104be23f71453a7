"""Light at places between the nodes of a lattice, of which each is solved once, when it is needed.

A place has as many coordinates as there are ways to move. Between nodes the light is interpolated
linearly over the simplex that the place lies in (Kuhn's triangulation, as of a colour cube in
tetrahedra): d + 1 nodes where d coordinates lie between nodes, and only two on the way along an
axis. It depends on the place alone, not on how one came there.

Echoes of surfaces come with the range that lies between those at the nodes. If they were added up
where they are, two a few centimetres apart would beat: at 240 MHz 5 cm would take 3 % of the
amplitude, which is many times its noise.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.simulation.light.solve import Transport
from spisim.transport.drops import Interpolation

#: Coordinates are known to this share of a step, so that rounding asks for no further node.
ROUNDING = 6

#: Of path lengths between nodes: farther apart they are those of two surfaces, and both are seen.
SAME_SURFACE_M = 0.5

Node = tuple[int, ...]


@dataclass(frozen=True, eq=False)
class LatticeLight:
    """Light of a recording whose times are told by `interpolation`; see `Light`."""

    transports: tuple[Transport, ...]
    interpolation: Interpolation

    def between(self, times_s: Floats) -> Interpolation:
        """The light at the times that it was made for, (frames, M)."""
        assert times_s.shape == self.interpolation.keys.shape[:2]
        return self.interpolation


class Lattice:
    """Solutions at nodes, the last ones of which are kept; `solved` counts them all.

    A solution needs `spot_orders` among its `extra`.
    """

    def __init__(self, solve: Callable[[Node], Transport], retained: int) -> None:
        self.solved = 0
        self._solve = solve
        self._maximum = retained
        self._retained: OrderedDict[Node, _Key] = OrderedDict()

    def light(self, positions: Floats) -> LatticeLight:
        """That of one frame, whose exposures happen at places (M, d) in steps of the lattice."""
        nodes, fractions = simplices(positions)
        used = np.unique(nodes[fractions > 0], axis=0)
        numbers = {tuple(node): number for number, node in enumerate(used.tolist())}
        flat = nodes.reshape(-1, nodes.shape[-1]).tolist()
        # Nodes without a share may be any that is there.
        keys = np.array([numbers.get(tuple(node), 0) for node in flat], np.intp)
        weights = np.bincount(keys, fractions.ravel()) / len(positions)
        transports = _aligned([self.at(node) for node in numbers], weights)
        return LatticeLight(
            transports, Interpolation(keys.reshape(1, *fractions.shape), fractions[None])
        )

    def at(self, node: Node) -> _Key:
        """Light at a node, solved where it is not kept."""
        result = self._retained.pop(node, None)
        if result is None:
            result = _Key.of(self._solve(node))
            self.solved += 1
        self._retained[node] = result
        if len(self._retained) > self._maximum:
            self._retained.popitem(last=False)
        return result


def simplices(positions: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Nodes (M, d + 1, d) around places (M, d), and their shares (M, d + 1), which add up to 1."""
    positions = np.round(positions, ROUNDING)
    base = np.floor(positions)
    rest = positions - base
    order = np.argsort(-rest, axis=1, kind="stable")
    falling = np.take_along_axis(rest, order, axis=1)
    bounds = np.pad(falling, ((0, 0), (1, 1)), constant_values=0.0)
    bounds[:, 0] = 1.0
    # From one corner to the next along the axes, the one with the largest rest first.
    steps = np.cumsum(np.eye(positions.shape[1], dtype=np.int64)[order], axis=1)
    corners = np.pad(steps, ((0, 0), (1, 0), (0, 0)))
    return base.astype(np.int64)[:, None] + corners, bounds[:, :-1] - bounds[:, 1:]


@dataclass(frozen=True, eq=False)
class _Key:
    """A solution, and of the spots what comes straight from surfaces, (4, bins).

    `path_m` (4,) is its mean path length, nan for none.
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
        retained = {name: each for name, each in transport.extra.items() if name == "phasors"}
        return cls(replace(transport, extra=retained), surfaces, path_m)

    def moved(self, by_m: Floats) -> Transport:
        """With the surfaces' echoes of each spot at paths that are longer by (4,)."""
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
    """Solutions with echoes of the same surface at the mean path by weights (keys,)."""
    paths_m = np.array([key.path_m for key in keys])
    with np.errstate(invalid="ignore"):
        same = np.ptp(paths_m, axis=0) < SAME_SURFACE_M  # nan is not
    moved_m = np.where(same, weights @ paths_m - paths_m, 0.0)
    return tuple(key.moved(by_m) for key, by_m in zip(keys, moved_m, strict=True))
