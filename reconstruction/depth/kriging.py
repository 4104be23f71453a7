"""Depth map from an image and a few ranges, by brightness and kriging.

The light that returns from a surface of reflectance rho at incidence angle theta and depth z is
proportional to rho cos(theta) / z^2, so log z = (log(rho cos theta) - log I) / 2 + constant.
Brightness determines depth as far as reflectance is constant: the linear minimum-mean-square-error
estimate follows -log(I)/2 by the fraction of the variance of log I that is due to depth. The
anchors show how much depth varies in a view: if their depths are equal, it is the reflectance that
varies. The residual is interpolated between the anchors by ordinary kriging, with a covariance that
decays with distance in the image and with difference in brightness, so that it does not cross
edges. The kriging variance is that of the estimate (N. Cressie, Statistics for Spatial Data, 1993,
ch. 3).

The constants are those of an `AnchoredPrior`. The obliquity of the field, 1.5 % at 10 degrees, is
neglected.
"""

import json
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from pathlib import Path
from typing import NamedTuple

import numpy as np

from ..base.arrays import Floats, Mask
from .method import DepthEstimate
from .pixels import around, between

BRIGHT = 90
"""Percentile that represents bright pixels."""
FITTED = Path(__file__).with_name("anchored_prior.json")


@dataclass(frozen=True)
class AnchoredPrior:
    """Constants of the depth map, fitted by `tools/anchored_prior.py`.

    ``log_depth_sigma``: prior spread of ln depth within a view, which counts as one anchor.
    ``log_reflectance_sigma``: spread of ln(rho cos theta). ``correlation_length``: in the image,
    relative to its longer side. ``similarity``: difference of ln I that decorrelates two pixels.
    ``nugget``: fraction of the variance that is uncorrelated between pixels. ``min_brightness``:
    lower limit of brightness, relative to the 90th percentile. ``uncertain``: relative sigma above
    which a range does not bound the map. ``max_nearer``: factor by which the map may be nearer than
    the nearest anchor; it is never beyond the farthest, since what is bright must be near, but what
    is dark may just be dark. ``sigma_factor``: factor of the reported over the kriging sigma.
    """

    log_depth_sigma: float
    log_reflectance_sigma: float
    correlation_length: float
    similarity: float
    nugget: float
    min_brightness: float
    uncertain: float
    max_nearer: float
    sigma_factor: float


@cache
def fitted_prior() -> AnchoredPrior:
    """Constants fitted to synthetic scenes."""
    return AnchoredPrior(**json.loads(FITTED.read_text())["prior"])


def anchored_depth(
    image: Floats, anchors: Floats, depth_m: Floats, sigma_m: Floats, prior: AnchoredPrior
) -> DepthEstimate | None:
    """Depth map in metres from an image (H, W) and depths (K,) at pixels (K, 2).

    ``anchors`` are fractional rows and columns, ``sigma_m`` (K,) the standard deviations of the
    depths. Depths that are not finite are ignored, and uncertain ones count less. None without any
    depth, or if the image is dark.
    """
    reference = float(np.percentile(image, BRIGHT))
    if reference <= 0:
        return None
    return AnchoredImage(image, reference, anchors, prior)(depth_m, sigma_m)


class AnchoredImage:
    """Image (H, W) of bright pixels at ``reference`` > 0, with ``anchors`` (K, 2) of any depths."""

    def __init__(
        self, image: Floats, reference: float, anchors: Floats, prior: AnchoredPrior
    ) -> None:
        self._prior = prior
        self._brightness = np.log(np.maximum(image, prior.min_brightness * reference))
        smoothed = around(self._brightness)
        self._at_anchors = between(smoothed, anchors)
        twice = 2 * (prior.correlation_length * max(image.shape)) ** 2

        def likeness(squared: Floats, contrast: Floats) -> Floats:
            return np.exp(-(squared / twice + contrast**2 / (2 * prior.similarity**2)))

        between_anchors = ((anchors[:, None] - anchors) ** 2).sum(axis=-1)
        self._of_anchors = likeness(between_anchors, self._at_anchors[:, None] - self._at_anchors)
        rows, columns = (
            (np.arange(side) - position[:, None]) ** 2
            for side, position in zip(image.shape, anchors.T, strict=True)
        )
        self._of_pixels = likeness(
            rows[:, :, None] + columns[:, None], smoothed - self._at_anchors[:, None, None]
        )

    def __call__(self, depth_m: Floats, sigma_m: Floats) -> DepthEstimate | None:
        """Map from these depths (K,), None without any."""
        result = self.log_depth(depth_m, sigma_m)
        return None if result is None else DepthEstimate(np.exp(result.mean), result.sigma())

    def log_depth(self, depth_m: Floats, sigma_m: Floats) -> "LogDepth | None":
        """Logarithm of the map."""
        usable, prior = np.isfinite(depth_m) & (depth_m > 0), self._prior
        if not usable.any():
            return None
        depth_m, sigma_m = depth_m[usable], sigma_m[usable]
        log_depth, log_sigma = np.log(depth_m), sigma_m / depth_m
        weight = 1 / (1 + (log_sigma / prior.log_depth_sigma) ** 2)
        mean = weight @ log_depth / weight.sum()
        scatter = weight @ (log_depth - mean) ** 2
        depth_variance = (prior.log_depth_sigma**2 + scatter) / max(weight.sum(), 1.0)
        fraction = 4 * depth_variance / (4 * depth_variance + prior.log_reflectance_sigma**2)
        residual = log_depth + fraction / 2 * self._at_anchors[usable]
        unexplained = (1 - fraction) * depth_variance
        weights, to_pixels = self._krige(usable, unexplained, log_sigma)
        shape = self._brightness.shape
        kriged = (residual @ weights[:-1]).reshape(shape) - fraction / 2 * self._brightness
        # An uncertain range may be off by its sigma.
        log_factor = np.where(log_sigma > prior.uncertain, log_sigma, 0.0)
        nearest = (log_depth - log_factor).min() - np.log(prior.max_nearer)
        farthest = (log_depth + log_factor).max()

        def sigma() -> Floats:
            explained = (weights * to_pixels).sum(axis=0).reshape(shape)
            return np.asarray(
                prior.sigma_factor * np.sqrt((1 + prior.nugget) * unexplained - explained)
            )

        return LogDepth(np.clip(kriged, nearest, farthest), sigma)

    def _krige(self, usable: Mask, variance: float, sigma: Floats) -> tuple[Floats, Floats]:
        """Ordinary kriging weights (n + 1, N) of n values and a mean, and their covariances."""
        count, nugget = len(sigma), self._prior.nugget
        system = np.ones((count + 1, count + 1))  # the last row makes the weights sum to one
        of_anchors, of_pixels = self._of_anchors, self._of_pixels
        if not usable.all():
            of_anchors, of_pixels = of_anchors[usable][:, usable], of_pixels[usable]
        system[:count, :count] = variance * of_anchors
        system.flat[: -1 : count + 2] += sigma**2 + nugget * variance
        system[count, count] = 0
        to_pixels = np.ones((count + 1, self._brightness.size))
        np.multiply(of_pixels.reshape(count, -1), variance, out=to_pixels[:count])
        return np.linalg.inv(system) @ to_pixels, to_pixels


class LogDepth(NamedTuple):
    """Log depth (H, W), and a function that computes its standard deviation."""

    mean: Floats
    sigma: Callable[[], Floats]
