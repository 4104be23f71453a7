"""Expected readings as a function of free parameters, with their Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_compare.gaussian import Covariance
from spisim_inverse.fit.covariance import covariance
from spisim_inverse.fit.parameters import Parameter
from spisim_inverse.fit.readings import Expected, Readings
from spisim_inverse.fit.tracing import Tracer, moved
from spisim_inverse.fit.twin import Twin

STEP = 1e-3
"""Step of a coordinate along which the measurement, cheap and nearly linear, is differenced."""


@dataclass(frozen=True, eq=False)
class Model:
    """A twin of a recording with free parameters."""

    readings: Readings
    twin: Twin
    parameters: Sequence[Parameter]
    tracer: Tracer
    seed: int

    def at(self, coordinates: Floats) -> Twin:
        """The twin with these coordinates (k,)."""
        twin = self.twin
        for parameter, coordinate in zip(self.parameters, coordinates.tolist(), strict=True):
            twin = parameter.applied(twin, parameter.value(coordinate))
        return twin

    def expected(self, coordinates: Floats, spp: int) -> Expected:
        """Expected readings."""
        twin = self.at(coordinates)
        return self.readings.expected(twin, self.tracer(twin, self.parameters, spp).light)

    def jacobian(self, coordinates: Floats, spp: int) -> Floats:
        """Change (n, k) of the readings' means per unit of each coordinate.

        Light changes by the derivatives that were traced with it. The measurement follows by
        central differences: those of a linear one are exact.
        """
        twin = self.at(coordinates)
        traced = self.tracer(twin, self.parameters, spp)
        columns = []
        for parameter in self.parameters:
            ends = []
            for step in (STEP, -STEP):
                if parameter.changes_light:
                    light = moved(traced.light, traced.changes[parameter.name], step)
                    ends.append(self.readings.expected(twin, light).counts)
                else:
                    own = parameter.coordinate(twin.values[parameter.name])
                    other = parameter.applied(twin, parameter.value(own + step))
                    ends.append(self.readings.expected(other, traced.light).counts)
            columns.append((ends[0] - ends[1]) / (2 * STEP))
        return np.column_stack(columns)

    def covariance(self, coordinates: Floats, spp: int) -> Covariance:
        """Covariance (n, n) of recorded less expected readings."""
        twin = self.at(coordinates)
        light = self.tracer(twin, self.parameters, spp).light
        expected = self.readings.expected(twin, light)
        return covariance(self.readings, twin, light, expected, self.seed)
