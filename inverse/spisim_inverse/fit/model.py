"""Expected readings as a function of free parameters, with their Jacobian."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from reconstruction.base.arrays import Floats
from spisim_compare.gaussian import Covariance
from spisim_inverse.fit.covariance import detector_noise, with_light_error
from spisim_inverse.fit.parameters import Parameter, with_field
from spisim_inverse.fit.readings import Expected, Readings
from spisim_inverse.fit.tracing import Traced, Tracer, moved
from spisim_inverse.fit.twin import Twin

STEP = 1e-3
"""Step of a coordinate along which the measurement, cheap and nearly linear, is differenced."""
GAUGE = 1e-4
"""Standard deviation of the mean throughput about 1."""


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
        return with_light_error(noise, self.readings, twin, light, expected, self.seed)
