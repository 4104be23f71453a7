"""Image and depth, with their truth, side by side."""

from __future__ import annotations

from typing import Any

import numpy as np
from numpy.typing import NDArray

from spisim.report.viewer.views import View


def draw_pictures(rerun: Any, stream: Any, view: View) -> None:
    """Log images in grey, on one scale with the truth, and depth maps in metres."""
    truth, depth_m = view.truth, view.shot.depth_m
    brightest = float(np.max(view.shot.image if truth is None else truth.image))
    _draw_image(rerun, stream, "images/image", view.shot.image, brightest)
    if truth is not None:
        _draw_image(rerun, stream, "images/truth", truth.image, brightest)
    finite = [map_m for map_m in (depth_m, None if truth is None else truth.depth_m)
             if map_m is not None and np.isfinite(map_m).any()]  # fmt: skip
    farthest_m = max((float(np.nanmax(map_m)) for map_m in finite), default=1.0)
    maps = {"depth/depth": depth_m, "depth/truth": None if truth is None else truth.depth_m}
    for name, map_m in maps.items():
        if map_m is not None:
            displayed = rerun.DepthImage(
                np.nan_to_num(map_m).astype(np.float32), meter=1.0, depth_range=(0.0, farthest_m)
            )
            stream.log(name, displayed)


def _draw_image(
    rerun: Any, stream: Any, name: str, image: NDArray[np.floating], brightest: float
) -> None:
    grey = np.clip(255 * image / max(brightest, np.finfo(np.float64).tiny), 0, 255)
    stream.log(name, rerun.Image(grey.astype(np.uint8), color_model="L"))
