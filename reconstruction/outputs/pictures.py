"""Pictures of images and depth maps, as PNG. Needs Matplotlib."""

import io
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from ..capture import Setup
from ..depth import pixel_of
from ..files import mark
from ..ranging import Ranges


def image_picture(image: NDArray[np.float32], title: str, unit: str) -> bytes:
    """An image in grey with its scale."""
    figure, axes = _figure(title)
    # Single bright pixels do not dim the rest.
    low, high = np.percentile(image, (0.5, 99.5))
    shown = axes.imshow(image, cmap="gray", vmin=low, vmax=max(high, low + 1e-12))
    figure.colorbar(shown, ax=axes, label=f"{unit}s per exposure", shrink=0.85)
    return _png(figure, "image")


def depth_picture(
    depth_m: NDArray[np.float32], title: str, setup: Setup, ranges: Ranges | None
) -> bytes:
    """A depth map with its scale, and the spots with their depths where there are any."""
    figure, axes = _figure(title)
    finite = depth_m[np.isfinite(depth_m)]
    low, high = np.percentile(finite, (1, 99)) if finite.size else (0.0, 1.0)
    axes.set_facecolor("0.5")  # where there is no depth
    axes.set_axis_on()
    axes.set(xticks=[], yticks=[])
    shown = axes.imshow(depth_m, cmap="viridis_r", vmin=low, vmax=max(high, low + 1e-6))
    figure.colorbar(shown, ax=axes, label="depth along the optical axis / m", shrink=0.85)
    if ranges is not None:
        _mark_spots(axes, setup, ranges)
    return _png(figure, "depth")


def _mark_spots(axes: Any, setup: Setup, ranges: Ranges) -> None:
    assert setup.spots is not None
    if setup.optics is None:
        return
    anchors = pixel_of(setup.spots.directions, setup.optics, setup.plan.shape)
    depths = ranges.range_m * setup.spots.directions[:, 2]
    for (row, column), depth_m, status in zip(anchors, depths, ranges.status, strict=True):
        axes.plot(column, row, "+", color="white", markersize=9)
        axes.annotate(
            f" {depth_m:.2f} m" if status == "ok" else f" {status}",
            (column, row),
            color="white",
            fontsize=9,
            bbox={"facecolor": "black", "alpha": 0.5, "edgecolor": "none", "pad": 1},
        )


def _figure(title: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(6, 5), dpi=120, layout="constrained")
    axes = figure.subplots()
    axes.set_axis_off()
    axes.set_title(title, fontsize=11)
    return figure, axes


def _png(figure: Figure, kind: str) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": mark(kind)})
    return buffer.getvalue()
