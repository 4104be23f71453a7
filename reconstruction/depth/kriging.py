"""A depth map from an image and four ranges, by brightness and kriging.

The light that returns from a surface of reflectance rho under the incidence angle theta at depth z
is proportional to rho cos(theta) / z^2, so log z = (log(rho cos theta) - log I) / 2 + constant.
Brightness tells depth as far as reflectance does not vary: the linear minimum-mean-square-error
estimate follows -log(I)/2 by the share that depth has in the variance of log I. How much depths
vary in a view is told by those of its anchors: where all are alike, it is the reflectance that
varies. What is left is interpolated between the anchors by ordinary kriging, with a covariance that
falls off with distance in the image and with difference in brightness, so that it does not cross
edges. Its variance is that of the estimate (N. Cressie, Statistics for Spatial Data, 1993, ch. 3).

The constants are those of an `AnchoredPrior`. The obliquity of the field, 1.5 % at 10 degrees, is
left out.
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
"""Percentile of bright pixels."""
FITTED = Path(__file__).with_name("anchored_prior.json")


@dataclass(frozen=True)
class AnchoredPrior:
    """Constants of `reconstruction.depth.kriging`.

    ``log_depth_sigma``: spread of ln depth within a view as far as known beforehand, which
    counts as one anchor. ``log_reflectance_sigma``: spread of ln(rho cos theta).
    ``correlation_length``: in the image, relative to its longer side; ``similarity``: difference of
    ln I beyond which two pixels tell little of each other. ``nugget``: share of the variance that a
    pixel has to itself, whatever is around it. ``min_brightness``: pixels are taken to be at least
    this bright, relative to the 90th percentile. ``uncertain``: ranges of a larger relative
    deviation do not bound the map where they are. ``max_nearer``: the map goes nearer than the
    nearest anchor by this factor at most, and not beyond the farthest: what is bright must be near,
    what is dark may just be dark. ``sigma_factor``: factor of the deviation told over that of the model.
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
    """The constants that are fitted to drawn scenes."""
    return AnchoredPrior(**json.loads(FITTED.read_text())["prior"])


def anchored_depth(
    image: Floats, anchors: Floats, depth_m: Floats, sigma_m: Floats, prior: AnchoredPrior
) -> DepthEstimate | None:
    """Depth map in metres from an image (H, W) and depths (K,) at pixels (K, 2).

    ``anchors`` are fractional rows and columns, ``sigma_m`` (K,) the depths' standard deviations;
    depths that are not finite are ignored, and those that are uncertain count as little as they
    tell. None if there is none left or the image is dark.
    """
    reference = float(np.percentile(image, BRIGHT))
    if reference <= 0:
        return None
    return AnchoredImage(image, reference, anchors, prior)(depth_m, sigma_m)


class AnchoredImage:
    """An image (H, W) whose bright pixels are as bright as a ``reference`` above 0.

    With ``anchors`` at pixels (K, 2), of which the depths may be told more than once.
    """

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
        """The map of these depths (K,), None where there are none."""
        result = self.log_depth(depth_m, sigma_m)
        return None if result is None else DepthEstimate(np.exp(result.mean), result.sigma())

    def log_depth(self, depth_m: Floats, sigma_m: Floats) -> "LogDepth | None":
        """Its logarithm."""
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
        # An uncertain range may be anywhere within its deviation.
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
        """Ordinary kriging of n values that are known up to ``sigma``.

        Weights (n + 1, N) of each for each pixel, and their covariances; the last of both is that
        of the mean.
        """
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
    """Log depth of a map (H, W), and what tells its deviation."""

    mean: Floats
    sigma: Callable[[], Floats]
