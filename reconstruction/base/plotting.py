"""What `plot` of captures, results and scenes draws on: axes of Matplotlib, side by side."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike

from .errors import InputError

SIDE_IN = 3.2
"""Of a panel."""


def panels(count: int) -> Any:
    """Axes of a new figure, (count,), which notebooks show and scripts by `pyplot.show`.

    InputError where there is no Matplotlib.
    """
    try:
        from matplotlib import pyplot
    except ModuleNotFoundError:
        raise InputError(
            "plots need Matplotlib: pip install 'spisim-reconstruction[window]', or matplotlib"
        ) from None
    size = (1.25 * SIDE_IN * count, SIDE_IN)
    _, axes = pyplot.subplots(1, count, figsize=size, squeeze=False, layout="constrained")
    return axes[0]


def draw_map(axes: Any, values: ArrayLike, title: str, unit: str, colours: str = "gray") -> None:
    """A map (H, W) from its 1st to its 99th percentile, with a bar; what is not known is white."""
    array = np.asarray(values, dtype=np.float64)
    finite = array[np.isfinite(array)]
    low, high = np.percentile(finite, (1, 99)) if finite.size else (0.0, 1.0)
    drawn = axes.imshow(array, cmap=colours, vmin=low, vmax=high, interpolation="nearest")
    axes.figure.colorbar(drawn, ax=axes, label=unit)
    axes.set(title=title, xticks=[], yticks=[])
