"""Orders in which the rows of a pattern basis are shown, one module each.

An order is a function from a `Basis` to all its row numbers, the first to be shown first.
"""

from collections.abc import Callable
from typing import Any

import numpy as np
from numpy.typing import NDArray

from ...registry import Registry

Order = Callable[[Any], NDArray[np.int64]]

ORDERS: Registry[Order] = Registry(
    "pattern order", package=__name__, attribute="ORDER", group="reconstruction.orders"
)
