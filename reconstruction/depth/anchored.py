"""A range map from an image and four ranges.

The light that returns from a surface of reflectance rho under the incidence angle theta at range r
is proportional to rho cos(theta) / r^2, so log r = (log(rho cos theta) - log I) / 2 + constant.
Brightness tells range as far as reflectance does not vary: the linear minimum-mean-square-error
estimate follows -log(I)/2 by the share that range has in the variance of log I. What is left is
interpolated between the anchors by ordinary kriging, with a covariance that falls off with
distance in the image and with difference in brightness, so that it does not cross edges.
"""

import numpy as np
from numpy.typing import NDArray
from scipy.ndimage import map_coordinates, uniform_filter

Floats = NDArray[np.float64]

LOG_RANGE_DEVIATION = 0.4
"""Spread of log range within a view: a factor of 1.5 either way."""
LOG_REFLECTANCE_DEVIATION = 0.7
"""Spread of log(rho cos theta): reflectances from 0.2 to 0.8 (0.45) and incidence angles (0.5)."""
REACH = 1.0
"""Correlation length in the image, relative to its longer side."""
SIMILARITY = 1.0
"""Difference of log I beyond which two pixels tell little of each other."""
BEYOND = 1.15
"""The map stays within this factor of the nearest and of the farthest anchor."""
DARKEST = 0.1
"""Pixels are taken to be at least this bright, relative to the 90th percentile."""


def anchored_range(
    image: Floats, anchors: Floats, range_m: Floats, sigma_m: Floats
) -> Floats | None:
    """Range map (H, W) in metres from an image (H, W) and ranges (K,) at pixels (K, 2).

    ``anchors`` are fractional rows and columns; ranges that are not finite are ignored. None if
    there is none left or the image is dark.
    """
    usable = np.isfinite(range_m) & (range_m > 0)
    reference = float(np.percentile(image, 90))
    if not usable.any() or reference <= 0:
        return None
    brightness = np.log(np.maximum(image, DARKEST * reference))
    share = 4 * LOG_RANGE_DEVIATION**2
    share /= share + LOG_REFLECTANCE_DEVIATION**2
    trend = -share / 2 * brightness

    anchors, range_m, sigma_m = anchors[usable], range_m[usable], sigma_m[usable]
    around = uniform_filter(brightness, 3)
    at_anchors = map_coordinates(around, anchors.T, order=1, mode="nearest")
    residual = np.log(range_m) + share / 2 * at_anchors
    log_range = trend + _krige(around, anchors, at_anchors, residual, sigma_m / range_m)
    return np.clip(np.exp(log_range), range_m.min() / BEYOND, range_m.max() * BEYOND)


def nearest_range(shape: tuple[int, int], anchors: Floats, range_m: Floats) -> Floats | None:
    """The baseline: each pixel takes the range of the nearest valid anchor. None without one."""
    usable = np.isfinite(range_m) & (range_m > 0)
    if not usable.any():
        return None
    return range_m[usable][np.argmin(_squared_distances(shape, anchors[usable]), axis=-1)]


def _krige(
    brightness: Floats, anchors: Floats, at_anchors: Floats, values: Floats, sigma: Floats
) -> Floats:
    """Ordinary kriging of values at the anchors, with standard deviations ``sigma``."""
    reach = REACH * max(brightness.shape)
    prior = 1 / (4 / LOG_REFLECTANCE_DEVIATION**2 + 1 / LOG_RANGE_DEVIATION**2)

    def covariance(squared: Floats, contrast: Floats) -> Floats:
        return prior * np.exp(-squared / (2 * reach**2) - contrast**2 / (2 * SIMILARITY**2))

    count = len(values)
    squared = ((anchors[:, None] - anchors) ** 2).sum(axis=-1)
    system = np.ones((count + 1, count + 1))  # the last row makes the weights sum to one
    system[:count, :count] = covariance(squared, at_anchors[:, None] - at_anchors)
    system[:count, :count] += np.diag(sigma**2 + 1e-3 * prior)
    system[count, count] = 0
    to_pixels = np.ones((*brightness.shape, count + 1))
    to_pixels[..., :count] = covariance(
        _squared_distances(brightness.shape, anchors), brightness[..., None] - at_anchors
    )
    return to_pixels @ np.linalg.solve(system, np.append(values, 0))


def _squared_distances(shape: tuple[int, ...], anchors: Floats) -> Floats:
    """Squared distance in pixels from each pixel to each anchor, (H, W, K)."""
    rows, columns = np.arange(shape[0])[:, None, None], np.arange(shape[1])[:, None]
    return (rows - anchors[:, 0]) ** 2 + (columns - anchors[:, 1]) ** 2
