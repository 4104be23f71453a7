"""One figure of the scene and its reconstruction."""

from pathlib import Path

import numpy as np
from matplotlib.cm import ScalarMappable
from matplotlib.colors import Normalize
from matplotlib.figure import Figure
from numpy.typing import ArrayLike, NDArray

from reconstruction import Capture, Result
from reconstruction.base.files import write_atomically
from reconstruction.evaluation import method_title

from .pictures import Scale, depth_scale, intensity_scale, show, view_scale
from .style import file_of, plot_style


@plot_style()
def write_overview(
    path: str | Path, capture: Capture, result: Result, view: NDArray[np.floating]
) -> None:
    """Write a PNG strip: scene, reconstructed image, true depth, reconstructed depth.

    Needs a capture with truth and a depth map, and the transport image (h, w) of the scene with
    more pixels. Raises OSError if the file cannot be written.
    """
    assert capture.truth is not None
    truth = capture.truth.at(result.frame)
    method, depth_m = next(iter(result.depths.items()))
    depth = depth_scale(truth.depth_m)
    fraction = f"{100 * capture.plan.sampling_ratio:.3g} %"
    panels: list[tuple[str, ArrayLike, Scale]] = [
        ("scene, with more pixels", view, view_scale(view)),
        (f"image from {fraction} of the patterns", result.image, intensity_scale(truth.image)),
        ("true depth", truth.depth_m, depth),
        (f"depth {method_title('depths', method)}", depth_m, depth),
    ]
    height, width = result.image.shape
    sheet = Figure(figsize=(13, 3.0 * height / width + 0.3), layout="constrained")
    axes = sheet.subplots(1, 4)
    for axis, (title, image, scale) in zip(axes, panels, strict=True):
        show(axis, scale.rgba(image), (height, width))
        axis.set_title(title)
    depth_bar(sheet, axes, depth, shrink=0.75, aspect=16)
    write_atomically(path, file_of(sheet, "overview"))


def depth_bar(
    sheet: Figure, axes: NDArray[np.object_], scale: Scale, *, shrink: float, aspect: float
) -> None:
    """Add the scale of depth beside axes: `shrink` of their height, `aspect` times its width."""
    colours = ScalarMappable(Normalize(scale.low, scale.high), scale.colours)
    sheet.colorbar(colours, ax=axes, pad=0.01, label="depth, m", shrink=shrink, aspect=aspect)
