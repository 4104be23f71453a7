"""One picture that shows what went in and what came out."""

import io
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from reconstruction import Capture, Result
from reconstruction.files import write_atomically

from .pictures import Scale, depth_scale, intensity_scale, view_scale


def write_overview(
    path: str | Path, capture: Capture, result: Result, view: NDArray[np.floating]
) -> None:
    """Write a PNG strip: scene, reconstructed image, true depth, reconstructed depth.

    Needs a capture with truth and spots, and the (h, w) transport image of the scene with more
    pixels.
    Raises OSError where the file cannot be written.
    """
    assert capture.truth is not None
    truth = capture.truth.at(result.frame)
    assert result.depth_m is not None
    depth = depth_scale(truth.depth_m)
    height, width = result.image.shape
    panels: list[tuple[str, ArrayLike, Scale]] = [
        ("scene, with more pixels", view, view_scale(view)),
        (
            f"image from {100 * capture.plan.sampling_ratio:.3g} % of the patterns",
            result.image,
            intensity_scale(truth.image, unit=""),
        ),
        ("true depth", truth.depth_m, depth),
        ("depth from four spots", result.depth_m, depth),
    ]
    sheet = Figure(figsize=(13, 3.0 * height / width + 0.3), dpi=150, layout="constrained")
    axes = sheet.subplots(1, 4)
    for axis, (title, image, scale) in zip(axes, panels, strict=True):
        axis.imshow(scale.rgba(image), extent=(0, width, height, 0), interpolation="nearest")
        axis.set_title(title, fontsize=11)
        axis.set_axis_off()
    shown = axes[-1].imshow(np.full((1, 1), np.nan), vmin=depth.low, vmax=depth.high)
    shown.set_cmap(depth.colours)
    shown.set_extent((0, width, height, 0))
    sheet.colorbar(shown, ax=axes, shrink=0.75, aspect=16, pad=0.01, label="depth, m")
    buffer = io.BytesIO()
    sheet.savefig(buffer, format="png", metadata={"Software": None})
    write_atomically(path, buffer.getvalue())
