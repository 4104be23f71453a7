"""Depth completion: a depth map of all pixels, corrected by points whose depth is known better."""

from dataclasses import replace

import numpy as np

from ..method import DepthEstimate
from .correction import MapCorrector, fitted_kernel
from .points import MAX_LOG_SIGMA, Rows, Seen

__all__ = ["MAX_LOG_SIGMA", "MapCompletion", "Rows", "Seen"]


class MapCompletion:
    """Completes maps (H, W) of one shape."""

    def __init__(self, shape: tuple[int, int]) -> None:
        self._correct = MapCorrector(shape)

    def __call__(self, estimate: DepthEstimate, seen: Seen) -> DepthEstimate:
        """The estimate, of a depth and a sigma for each pixel, with points; itself without any."""
        assert estimate.sigma is not None
        log_depth, no_return = np.log(estimate.depth_m), estimate.no_return
        by_points = self._correct(log_depth, estimate.sigma, seen)
        if by_points is None:
            return estimate
        return replace(
            estimate,
            depth_m=np.exp(log_depth + by_points.error),
            sigma=fitted_kernel().sigma_factor * estimate.sigma * np.sqrt(by_points.remaining),
            no_return=None if no_return is None else no_return * by_points.remaining,
        )
