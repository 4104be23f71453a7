"""Expected readings of one view as a function of free parameters, with their Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_compare.gaussian import Covariance
from spisim_inverse.fit.covariance import detector_noise, with_light_error
from spisim_inverse.fit.parameters import Parameter, with_field
from spisim_inverse.fit.pose import PoseErrors
from spisim_inverse.fit.readings import Expected, Readings
from spisim_inverse.fit.tracing import Traced, Tracer, moved
from spisim_inverse.fit.twin import Twin

STEP = 1e-3
"""Step of a coordinate along which the measurement, cheap and nearly linear, is differenced."""


@dataclass(frozen=True, eq=False)
class View:
    """A twin of a recording, or of one frame of it, with free parameters."""

    readings: Readings
    twin: Twin
    parameters: Sequence[Parameter]
    tracer: Tracer
    seed: int
    pose: PoseErrors
    frame: int = 0

    def fixed(self, some: Sequence[Parameter]) -> View:
        """The view with some of the parameters at their starts."""
        twin = self.twin
        for each in some:
            twin = each.applied(twin, each.start)
        kept = [each for each in self.parameters if each not in some]
        return replace(self, twin=twin, parameters=kept)

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
        power: Floats | None = None
        columns = []
        for parameter in self.parameters:
            if parameter.exposures is None:
                columns.append(self._column(twin, traced, parameter))
                continue
            if power is None:
                power = self._by_power(twin, traced)
            own = np.zeros_like(power)
            own[: parameter.exposures.size] = parameter.exposures
            columns.append(own * power)
        return np.column_stack(columns)

    def _column(self, twin: Twin, traced: Traced, parameter: Parameter) -> Floats:
        ends = []
        for step in (STEP, -STEP):
            if parameter.changes_light:
                light = moved(traced.light, traced.changes[parameter.name], step)
                ends.append(self.readings.expected(twin, light).counts)
            else:
                own = parameter.coordinate(twin.values[parameter.name])
                other = parameter.applied(twin, parameter.value(own + step))
                ends.append(self.readings.expected(other, traced.light).counts)
        return np.asarray((ends[0] - ends[1]) / (2 * STEP))

    def _by_power(self, twin: Twin, traced: Traced) -> Floats:
        """Change (n,) per unit of the logarithm of the projector's power."""
        ends = []
        for step in (STEP, -STEP):
            power_w = np.exp(step) * twin.instrument.imaging.projector.power_w
            brighter = with_field(twin.instrument, "projector.power_w", float(power_w))
            other = replace(twin, instrument=brighter)
            ends.append(self.readings.expected(other, traced.light).counts)
        return np.asarray((ends[0] - ends[1]) / (2 * STEP))

    def noise(self, coordinates: Floats, spp: int) -> Covariance:
        """Covariance (n, n) of the readings about what they should be."""
        twin = self.at(coordinates)
        light = self.tracer(twin, self.parameters, spp).light
        return detector_noise(self.readings, twin, light, self.readings.expected(twin, light))

    def covariance(self, coordinates: Floats, spp: int) -> Covariance:
        """Covariance (n, n) of recorded less expected readings: noise, and error of the light."""
        twin = self.at(coordinates)
        light = self.tracer(twin, self.parameters, spp).light
        expected = self.readings.expected(twin, light)
        noise = detector_noise(self.readings, twin, light, expected)
        noise = with_light_error(noise, self.readings, twin, light, expected, self.seed)
        return noise.plus([self.pose(self.readings, twin, coordinates, spp)])
