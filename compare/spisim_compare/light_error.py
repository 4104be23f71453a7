"""Error of a simulation's light, which its captures state: noise when they are compared."""

from dataclasses import replace
from typing import Any

import numpy as np
import yaml

from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture

from .gaussian import Covariance
from .midpoint import Midpoint
from .patterns import constant, exposed

FEW_PATHS = 2.0
"""Factor on the error of steady light: few paths find the sky, and the error of a few is unsure."""


def with_light_error(noise: Covariance, capture: Capture, midpoint: Midpoint) -> Covariance:
    """Noise of patterns and spots, with the error of a capture's light, if it is a simulation."""
    if capture.provenance.source != "simulation":
        return noise
    stated = _stated(capture)
    patterns, spots = midpoint.patterns.size, midpoint.spots
    variance = noise.variance.copy()
    own, total = _of_image(capture)
    variance[:patterns] += own
    on = constant(capture.setup.plans)
    steady = FEW_PATHS * stated("daylight_relative_error") * abs(midpoint.background) * on
    factors = np.zeros((variance.size, 2))
    factors[:patterns] = np.column_stack([total, steady])
    added = [factors]
    if spots is not None:
        mean = spots.means[0 if capture is midpoint.real else 1]
        variance[patterns:] += stated("spot_noise_share") ** 2 * mean.variance * mean.frames
        relative = FEW_PATHS * np.hypot(
            stated("spot_daylight_relative_error"), stated("spot_crosstalk_relative_error")
        )
        of_spots = spots.steady_of_spots
        added.append(np.vstack([np.zeros((patterns, of_spots.shape[1])), relative * of_spots]))
    return replace(noise, variance=variance).plus(added)


def _of_image(capture: Capture) -> tuple[Floats, Floats]:
    """Variance (n,) of each reading of a pattern, and standard error (n,) common to all.

    The errors of pixels are independent; that of the sum of all is common to all patterns.
    """
    plans = capture.setup.plans
    on = constant(plans)
    if capture.truth is None or not capture.plan.shows_image:
        return np.zeros(on.size), np.zeros(on.size)
    squares = np.nan_to_num(capture.truth.image_error[0].astype(np.float64)) ** 2
    half = np.where(on > 0, squares.sum() / 4, 0.0)
    whole = np.where(on > 0, exposed(plans, squares), squares.sum())
    return np.maximum(whole - half, 0.0), np.sqrt(half)


def _stated(capture: Capture) -> Any:
    """Accuracy of the light by name, 0 where it is not stated."""
    try:
        light = yaml.safe_load(capture.provenance.settings)["light"]
    except (yaml.YAMLError, KeyError, TypeError):
        light = {}

    def value(name: str) -> float:
        number = light.get(name) if isinstance(light, dict) else None
        return float(number) if isinstance(number, int | float) and np.isfinite(number) else 0.0

    return value
