"""Depth completion: a depth map of all pixels, corrected by points whose depth is known better.

A Gaussian process carries what the points say into their surroundings; a network then corrects the
result, where the map is a learned one.
"""

from dataclasses import replace

import numpy as np

from ...base.arrays import Floats
from ...capture import Optics
from ..method import DepthEstimate
from .correction import MapCorrector, fitted_kernel
from .network import CompletionNetwork, brightness_of
from .points import MAX_LOG_SIGMA, Rows, Seen

__all__ = ["MAX_LOG_SIGMA", "MapCompletion", "Rows", "Seen"]


class MapCompletion:
    """Completes maps (H, W) of one camera."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._correct, self._network = MapCorrector(shape), CompletionNetwork(optics, shape)

    def __call__(self, image: Floats, estimate: DepthEstimate, seen: Seen) -> DepthEstimate:
        """The estimate, of a depth and a sigma for each pixel, with points; itself without any.

        The network is asked of lit images (H, W) and maps that state where nothing returns.
        """
        assert estimate.sigma is not None
        log_depth, no_return = np.log(estimate.depth_m), estimate.no_return
        correction = self._correct(log_depth, estimate.sigma, seen)
        if correction is None:
            return estimate
        brightness = None if no_return is None else brightness_of(image)
        if brightness is not None:
            log_depth, sigma = self._network(brightness, estimate, correction)
        else:
            log_depth = log_depth + correction.error
            sigma = fitted_kernel().sigma_factor * estimate.sigma * np.sqrt(correction.remaining)
        if no_return is not None:
            no_return = no_return * correction.remaining
        return replace(estimate, depth_m=np.exp(log_depth), sigma=sigma, no_return=no_return)
