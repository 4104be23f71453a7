"""Readings of all views of a recording as a function of free parameters."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property

import numpy as np
from numpy.typing import NDArray
from scipy.linalg import block_diag

from reconstruction.base.arrays import Floats, Mask
from spisim_compare.gaussian import Covariance
from spisim_inverse.fit.parameters import Parameter
from spisim_inverse.fit.twin import Twin
from spisim_inverse.fit.view import View

GAUGE = 1e-4
"""Standard deviation of the mean throughput about 1."""


@dataclass(frozen=True, eq=False)
class Model:
    """Views with the same free parameters: one of a drone at rest, several of a flight."""

    views: Sequence[View]

    @property
    def parameters(self) -> Sequence[Parameter]:
        """The free ones."""
        return self.views[0].parameters

    def fixed(self, some: Sequence[Parameter]) -> Model:
        """The model with some of the parameters at their starts."""
        return Model([each.fixed(some) for each in self.views])

    def at(self, coordinates: Floats) -> Twin:
        """The twin of the first view with these coordinates (k,)."""
        return self.views[0].at(coordinates)

    @cached_property
    def mean(self) -> Floats:
        """Recorded counts (n,) of all views."""
        return np.concatenate([each.readings.mean for each in self.views])

    @cached_property
    def usable(self) -> Mask:
        """Which readings (n,) may be used."""
        return np.concatenate([each.readings.usable for each in self.views])

    @cached_property
    def group(self) -> NDArray[np.intp]:
        """Group (n,) of each reading: patterns, and each spot."""
        return np.concatenate([each.readings.group for each in self.views])

    @property
    def groups(self) -> list[str]:
        """Names of the groups."""
        return self.views[0].readings.groups

    @cached_property
    def cluster(self) -> NDArray[np.intp]:
        """Readings (n,) that may be off together: of a view, or of a group of the only one."""
        if len(self.views) == 1:
            return self.group
        return np.repeat(np.arange(len(self.views)), [v.readings.mean.size for v in self.views])

    @cached_property
    def names(self) -> list[str]:
        """Names (n,) of the readings."""
        if len(self.views) == 1:
            return self.views[0].readings.names
        return [
            f"frame {view.frame}, {name}" for view in self.views for name in view.readings.names
        ]

    def expected(self, coordinates: Floats, spp: int) -> Floats:
        """Expected counts (n,)."""
        return np.concatenate([each.expected(coordinates, spp).counts for each in self.views])

    def jacobian(self, coordinates: Floats, spp: int) -> Floats:
        """Change (n, k) of the readings' means per unit of each coordinate."""
        return np.vstack([each.jacobian(coordinates, spp) for each in self.views])

    def noise(self, coordinates: Floats, spp: int) -> Covariance:
        """Covariance (n, n) of the readings about what they should be."""
        return _joined([each.noise(coordinates, spp) for each in self.views])

    def covariance(self, coordinates: Floats, spp: int) -> Covariance:
        """Covariance (n, n) of recorded less expected readings: noise, error of light and pose."""
        return _joined([each.covariance(coordinates, spp) for each in self.views])

    def gauge(self, coordinates: Floats) -> tuple[Floats, Floats]:
        """Residual (1,) and slope (1, k) that keep the mean throughput at 1; none without any.

        The readings do not depend on that mean, as the instrument scales it to 1.
        """
        factors = np.array(
            [
                0.0 if each.exposures is None else each.value(x)
                for each, x in zip(self.parameters, coordinates.tolist(), strict=True)
            ]
        )
        if not factors.any():
            return np.zeros(0), np.zeros((0, coordinates.size))
        count = np.count_nonzero(factors)
        off = (factors.sum() / count - 1) / GAUGE
        return np.array([off]), factors[None] / (count * GAUGE)


def _joined(parts: Sequence[Covariance]) -> Covariance:
    """Covariance of readings of views, which have no errors in common."""
    variance = np.concatenate([each.variance for each in parts])
    return Covariance(variance, block_diag(*(each.factors for each in parts)))
