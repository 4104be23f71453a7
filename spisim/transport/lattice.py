"""Light at places between the nodes of a lattice, of which each is solved once, when it is needed.

A place has as many coordinates as there are ways to move. Between nodes the light is interpolated
linearly over the simplex that the place lies in (Kuhn's triangulation, as of a colour cube in
tetrahedra): d + 1 nodes where d coordinates lie between nodes, and only two on the way along an
axis. It depends on the place alone, not on how one came there.
"""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.arrays import Floats
from spisim.transport.sequence import Interpolation
from spisim.transport.solve import Transport

#: Coordinates are known to this share of a step, so that rounding asks for no further node.
ROUNDING = 6

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
    """Solutions at nodes, the last ones of which are kept; `solved` counts them all."""

    def __init__(self, solve: Callable[[Node], Transport], kept: int) -> None:
        self.solved = 0
        self._solve = solve
        self._most = kept
        self._kept: OrderedDict[Node, Transport] = OrderedDict()

    def light(self, places: Floats) -> LatticeLight:
        """That of one frame, whose exposures happen at places (M, d) in steps of the lattice."""
        nodes, shares = simplices(places)
        used = np.unique(nodes[shares > 0], axis=0)
        numbers = {tuple(node): number for number, node in enumerate(used.tolist())}
        flat = nodes.reshape(-1, nodes.shape[-1]).tolist()
        # Nodes without a share may be any that is there.
        keys = np.array([numbers.get(tuple(node), 0) for node in flat], np.intp)
        transports = tuple(map(self.at, numbers))
        return LatticeLight(transports, Interpolation(keys.reshape(1, *shares.shape), shares[None]))

    def at(self, node: Node) -> Transport:
        """Light at a node, solved where it is not kept."""
        found = self._kept.pop(node, None)
        if found is None:
            found = self._solve(node)
            self.solved += 1
        self._kept[node] = found
        if len(self._kept) > self._most:
            self._kept.popitem(last=False)
        return found


def simplices(places: Floats) -> tuple[NDArray[np.int64], Floats]:
    """Nodes (M, d + 1, d) around places (M, d), and their shares (M, d + 1), which add up to 1."""
    places = np.round(places, ROUNDING)
    base = np.floor(places)
    rest = places - base
    order = np.argsort(-rest, axis=1, kind="stable")
    falling = np.take_along_axis(rest, order, axis=1)
    bounds = np.pad(falling, ((0, 0), (1, 1)), constant_values=0.0)
    bounds[:, 0] = 1.0
    # From one corner to the next along the axes, the one with the largest rest first.
    steps = np.cumsum(np.eye(places.shape[1], dtype=np.int64)[order], axis=1)
    corners = np.pad(steps, ((0, 0), (1, 0), (0, 0)))
    return base.astype(np.int64)[:, None] + corners, bounds[:, :-1] - bounds[:, 1:]
