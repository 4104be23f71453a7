"""An image method: the inverse transform, smoothed."""

from scipy.ndimage import gaussian_filter

from reconstruction.image import Estimate


class Smoothed:
    title = "smoothed inverse"

    def compile(self, operator):
        def solve(coefficients):
            return Estimate(gaussian_filter(operator.min_norm(coefficients.values), 1))

        return solve


METHOD = Smoothed()
