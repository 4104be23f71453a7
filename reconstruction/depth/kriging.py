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

import numpy as np

from ..arrays import Floats
from .anchored_prior import AnchoredPrior
from .method import DepthEstimate
from .neighbours import around, between
from .rays import squared_distances


def anchored_depth(
    image: Floats, anchors: Floats, depth_m: Floats, sigma_m: Floats, prior: AnchoredPrior
) -> DepthEstimate | None:
    """Depth map in metres from an image (H, W) and depths (K,) at pixels (K, 2).

    ``anchors`` are fractional rows and columns, ``sigma_m`` (K,) the depths' standard deviations;
    depths that are not finite are ignored, and those that are uncertain count as little as they
    tell. None if there is none left or the image is dark.
    """
    usable = np.isfinite(depth_m) & (depth_m > 0)
    reference = float(np.percentile(image, 90))
    if not usable.any() or reference <= 0:
        return None
    anchors, depth_m, sigma_m = anchors[usable], depth_m[usable], sigma_m[usable]
    log_depth, log_sigma = np.log(depth_m), sigma_m / depth_m
    weight = 1 / (1 + (log_sigma / prior.log_depth_deviation) ** 2)
    mean = weight @ log_depth / weight.sum()
    scatter = weight @ (log_depth - mean) ** 2
    depth_variance = (prior.log_depth_deviation**2 + scatter) / max(weight.sum(), 1.0)
    share = 4 * depth_variance / (4 * depth_variance + prior.log_reflectance_deviation**2)

    brightness = np.log(np.maximum(image, prior.min_brightness * reference))
    smoothed = around(brightness)
    at_anchors = between(smoothed, anchors)
    residual = log_depth + share / 2 * at_anchors
    unexplained = (1 - share) * depth_variance
    kriged, variance = _krige(
        smoothed, anchors, at_anchors, residual, unexplained, log_sigma, prior
    )
    depth = np.exp(kriged - share / 2 * brightness)
    # An uncertain range may be anywhere within its deviation.
    factor = np.where(log_sigma > prior.uncertain, np.exp(log_sigma), 1.0)
    nearest, farthest = (depth_m / factor).min() / prior.max_nearer, (depth_m * factor).max()
    return DepthEstimate(np.clip(depth, nearest, farthest), prior.doubt * np.sqrt(variance))


def _krige(
    brightness: Floats,
    anchors: Floats,
    at_anchors: Floats,
    values: Floats,
    variance: float,
    sigma: Floats,
    prior: AnchoredPrior,
) -> tuple[Floats, Floats]:
    """Ordinary kriging of values at the anchors that are known up to ``sigma``; its variance."""
    length = prior.correlation_length * max(brightness.shape)

    def covariance(squared: Floats, contrast: Floats) -> Floats:
        unlike = squared / (2 * length**2) + contrast**2 / (2 * prior.similarity**2)
        return variance * np.exp(-unlike)

    count = len(values)
    squared = ((anchors[:, None] - anchors) ** 2).sum(axis=-1)
    system = np.ones((count + 1, count + 1))  # the last row makes the weights sum to one
    system[:count, :count] = covariance(squared, at_anchors[:, None] - at_anchors)
    system[:count, :count] += np.diag(sigma**2 + prior.nugget * variance)
    system[count, count] = 0
    to_pixels = np.ones((*brightness.shape, count + 1))
    to_pixels[..., :count] = covariance(
        squared_distances(brightness.shape, anchors), brightness[..., None] - at_anchors
    )
    weights = to_pixels @ np.linalg.inv(system)
    told = np.einsum("hwk,hwk->hw", weights, to_pixels)
    return weights @ np.append(values, 0), (1 + prior.nugget) * variance - told
