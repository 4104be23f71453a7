"""Orders in which the rows of a pattern basis are displayed, one module each.

An order is a function from a `Basis` to all its row indices, in the order of display. A random
order is `Seeded`: it is requested by name and seed, as ``random:7``.
"""

from collections.abc import Callable
from dataclasses import dataclass
from functools import partial
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...base.registry import Registry
from ..basis import generator_of

Order = Callable[[Any], NDArray[np.int64]]


@dataclass(frozen=True)
class Seeded:
    """Order drawn by ``draw`` from a basis and a random generator."""

    draw: Callable[[Any, np.random.Generator], NDArray[np.int64]]

    def __call__(self, basis: Any, rng: np.random.Generator) -> NDArray[np.int64]:
        """All row indices."""
        return self.draw(basis, rng)


ORDERS: Registry[Order | Seeded] = Registry(
    "pattern order", package=__name__, attribute="ORDER", group="reconstruction.orders"
)


def pattern_order(name: str) -> Order:
    """Return an order by name, such as ``"sequency"`` or ``"random:7"``.

    Raises
    ------
    InputError
        If the name is unknown, or a seed is missing or superfluous.
    """
    order = ORDERS[name.partition(":")[0]]
    if not isinstance(order, Seeded):
        generator_of("pattern order", name, seeded=False)
        return order
    rng = generator_of("pattern order", name, seeded=True)
    assert rng is not None
    return partial(order, rng=rng)
