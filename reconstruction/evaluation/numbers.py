"""Numbers as JSON has them."""

from typing import Any

import numpy as np


def number(value: Any) -> float | None:
    """A float, None where there is no finite one."""
    return float(value) if np.isfinite(value) else None
