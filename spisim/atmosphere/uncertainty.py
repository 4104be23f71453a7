"""What the counts of a measured spectrum leave unsure of a medium."""

from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats


@dataclass(frozen=True, eq=False)
class Uncertainty:
    """Standard deviations of a medium's properties.

    ``extinction``, ``backscatter`` and ``phase``, at the angles of the Mie table, are relative.
    """

    extinction: float
    albedo: float
    g: float
    backscatter: float
    phase: Floats

    def summary(self) -> dict[str, float]:
        """In plain numbers, by name."""
        return {
            "extinction_relative_sigma": self.extinction,
            "albedo_sigma": self.albedo,
            "g_sigma": self.g,
            "backscatter_relative_sigma": self.backscatter,
        }


def propagated(
    numbers: Floats,
    sigma: Floats,
    extinction: Floats,
    scattering: Floats,
    forward: Floats,
    per_steradian: Floats,
    amount: Floats | None,
) -> Uncertainty:
    """Uncertainty from independent numbers of droplets, to first order.

    Parameters
    ----------
    numbers, sigma : (classes,) array
        Numbers and their standard deviations.
    extinction, scattering, forward : (classes,) array
        Cross sections of one droplet; `forward` is scattering times the mean cosine.
    per_steradian : (classes, angles) array
        Scattering per solid angle, up to 180°.
    amount : (classes,) array, optional
        What of one droplet adds up to the given visibility or rate; None if numbers are absolute.
    """
    scattered = numbers @ scattering
    weight = per_steradian / (numbers @ per_steradian) - (scattering / scattered)[:, None]
    phase = np.sqrt(sigma**2 @ weight**2)
    relative = extinction / (numbers @ extinction)
    if amount is not None:
        relative = relative - amount / (numbers @ amount)
    return Uncertainty(
        float(np.sqrt(sigma**2 @ relative**2)),
        _of_ratio(numbers, sigma, scattering, extinction),
        _of_ratio(numbers, sigma, forward, scattering),
        float(phase[-1]),
        np.asarray(phase),
    )


def _of_ratio(numbers: Floats, sigma: Floats, above: Floats, below: Floats) -> float:
    """Sigma of the ratio of two sums over droplets."""
    whole = numbers @ below
    slope = (above - (numbers @ above) / whole * below) / whole
    return float(np.sqrt(sigma**2 @ slope**2))
