"""An image method: the inverse transform, smoothed."""

from scipy.ndimage import gaussian_filter


class Smoothed:
    title = "smoothed inverse"

    def compile(self, operator):
        return lambda coefficients: gaussian_filter(operator.least_energy(coefficients.values), 1)


METHOD = Smoothed()
