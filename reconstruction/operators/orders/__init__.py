"""Orders in which the rows of a pattern basis are shown, one module each.

An order is a function from a `Basis` to all its row numbers, the first to be shown first; one that
is drawn by chance is a `Seeded` one, asked for by name and seed, as ``random:7``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.registry import Registry
from ..seeds import generator_of

Order = Callable[[Any], NDArray[np.int64]]


@dataclass(frozen=True)
class Seeded:
    """An order that ``draw`` makes of a basis and a random generator."""

    draw: Callable[[Any, np.random.Generator], NDArray[np.int64]]

    def __call__(self, basis: Any, rng: np.random.Generator) -> NDArray[np.int64]:
        """All row numbers."""
        return self.draw(basis, rng)


ORDERS: Registry[Order | Seeded] = Registry(
    "pattern order", package=__name__, attribute="ORDER", group="reconstruction.orders"
)


def pattern_order(name: str) -> Order:
    """The order of this name, of a seeded one with its seed.

    Raises InputError for an unknown name, a seed that is missing, and one that is not needed.
    """
    order = ORDERS[name.partition(":")[0]]
    if not isinstance(order, Seeded):
        generator_of("pattern order", name, seeded=False)
        return order
    rng = generator_of("pattern order", name, seeded=True)
    assert rng is not None
    return partial(order, rng=rng)
