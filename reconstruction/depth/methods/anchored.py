"""A depth map from an image and four ranges.

The light that returns from a surface of reflectance rho under the incidence angle theta at depth z
is proportional to rho cos(theta) / z^2, so log z = (log(rho cos theta) - log I) / 2 + constant.
Brightness tells depth as far as reflectance does not vary: the linear minimum-mean-square-error
estimate follows -log(I)/2 by the share that depth has in the variance of log I. How much depths
vary in a view is told by those of its anchors: where all are alike, it is the reflectance that
varies. What is left is interpolated between the anchors by ordinary kriging, with a covariance that
falls off with distance in the image and with difference in brightness, so that it does not cross
edges.

The constants are round values near the least error in 336 scenes drawn from the families. Half or
twice one of them changes that error by 4 % at most. The obliquity of the field, 1.5 % at 10
degrees, is left out.
"""

import numpy as np

from ...arrays import Floats
from ..method import Context, DepthEstimate, DepthSolver, Need, View
from ..neighbours import around, between
from ..rays import pixel_of, squared_distances

LOG_DEPTH_DEVIATION = 0.4
"""Spread of log depth within a view as far as known beforehand, which counts as one anchor."""
LOG_REFLECTANCE_DEVIATION = 0.7
"""Spread of log(rho cos theta): reflectances from 0.2 to 0.8 (0.45) and incidence angles (0.5)."""
CORRELATION_LENGTH = 0.5
"""Correlation length in the image, relative to its longer side."""
SIMILARITY = 0.7
"""Difference of log I beyond which two pixels tell little of each other."""
NUGGET = 0.05
"""Share of the variance that an anchor has to itself, whatever is around it."""
MIN_BRIGHTNESS = 0.2
"""Pixels are taken to be at least this bright, relative to the 90th percentile."""
UNCERTAIN = 0.05
"""Ranges of a larger relative deviation do not bound the map where they are."""
MAX_NEARER = 1.3
"""The map goes nearer than the nearest anchor by this factor at most, and not beyond the farthest:
what is bright must be near, what is dark may just be dark."""


class Anchored:
    """Depth by brightness and four ranges."""

    title = "anchored on the spots"
    needs: tuple[Need, ...] = ("optics", "spots")

    def compile(self, context: Context) -> DepthSolver:
        """Solver of one recording's frames."""
        setup = context.setup
        assert setup.optics is not None
        assert setup.spots is not None
        anchors = pixel_of(setup.spots.directions, setup.optics, setup.plan.shape)
        forward = setup.spots.directions[:, 2]

        def solve(view: View) -> DepthEstimate | None:
            ranges = view.ranges
            if ranges is None:
                return None
            depth_m, sigma_m = (each * forward for each in ranges.likeliest)
            found_m = anchored_depth(view.image, anchors, depth_m, sigma_m)
            return None if found_m is None else DepthEstimate(found_m)

        return solve


def anchored_depth(
    image: Floats, anchors: Floats, depth_m: Floats, sigma_m: Floats
) -> Floats | None:
    """Depth map (H, W) in metres from an image (H, W) and depths (K,) at pixels (K, 2).

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
    weight = 1 / (1 + (log_sigma / LOG_DEPTH_DEVIATION) ** 2)
    mean = weight @ log_depth / weight.sum()
    scatter = weight @ (log_depth - mean) ** 2
    depth_variance = (LOG_DEPTH_DEVIATION**2 + scatter) / max(weight.sum(), 1.0)
    share = 4 * depth_variance / (4 * depth_variance + LOG_REFLECTANCE_DEVIATION**2)

    brightness = np.log(np.maximum(image, MIN_BRIGHTNESS * reference))
    smoothed = around(brightness)
    at_anchors = between(smoothed, anchors)
    residual = log_depth + share / 2 * at_anchors
    unexplained = (1 - share) * depth_variance
    kriged = _krige(smoothed, anchors, at_anchors, residual, unexplained, log_sigma)
    depth = np.exp(kriged - share / 2 * brightness)
    # An uncertain range may be anywhere within its deviation.
    factor = np.where(log_sigma > UNCERTAIN, np.exp(log_sigma), 1.0)
    return np.clip(depth, (depth_m / factor).min() / MAX_NEARER, (depth_m * factor).max())


def _krige(
    brightness: Floats,
    anchors: Floats,
    at_anchors: Floats,
    values: Floats,
    variance: float,
    sigma: Floats,
) -> Floats:
    """Ordinary kriging of values at the anchors that are known up to ``sigma``."""
    length = CORRELATION_LENGTH * max(brightness.shape)

    def covariance(squared: Floats, contrast: Floats) -> Floats:
        return variance * np.exp(-squared / (2 * length**2) - contrast**2 / (2 * SIMILARITY**2))

    count = len(values)
    squared = ((anchors[:, None] - anchors) ** 2).sum(axis=-1)
    system = np.ones((count + 1, count + 1))  # the last row makes the weights sum to one
    system[:count, :count] = covariance(squared, at_anchors[:, None] - at_anchors)
    system[:count, :count] += np.diag(sigma**2 + NUGGET * variance)
    system[count, count] = 0
    to_pixels = np.ones((*brightness.shape, count + 1))
    to_pixels[..., :count] = covariance(
        squared_distances(brightness.shape, anchors), brightness[..., None] - at_anchors
    )
    return to_pixels @ np.linalg.solve(system, np.append(values, 0))


METHOD = Anchored()
