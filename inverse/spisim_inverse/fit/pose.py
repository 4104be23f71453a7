"""Errors of readings by that of the pose of a frame."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.simulation.light import solve
from spisim.simulation.light.displacement import AXES, DIRECTIONS, coordinates_of
from spisim_inverse.fit.readings import Readings
from spisim_inverse.fit.twin import Twin

STEP_M, STEP_RAD = 0.01, np.radians(0.1)
"""Half the steps of differences."""
MAX_SPP = 16
"""Light paths per pixel of their ends."""
SAME = 0.1
"""Change of the coordinates of parameters up to which the last differences are used again."""


class PoseErrors:
    """Changes of readings by the standard deviation of a pose; remembers the last.

    ``sigma`` is that along each axis in metres, and about each in radians. Changes are linear: an
    image that turns by more than its pixels is not.
    """

    def __init__(self, sigma: tuple[float, float], seed: int) -> None:
        self.sigma, self._seed = sigma, seed
        self._last: tuple[Floats, Floats] | None = None

    def __call__(self, readings: Readings, twin: Twin, coordinates: Floats, spp: int) -> Floats:
        """Columns (n, 6) by differences with common random numbers; (n, 0) of an exact pose."""
        if not any(self.sigma):
            return np.zeros((readings.mean.size, 0))
        if self._last is None or np.abs(self._last[0] - coordinates).max() > SAME:
            columns = [self._column(name, readings, twin, spp) for name in (*DIRECTIONS, *AXES)]
            self._last = coordinates, np.column_stack(columns)
        return self._last[1]

    def _column(self, name: str, readings: Readings, twin: Twin, spp: int) -> Floats:
        turns = name in AXES
        step = STEP_RAD if turns else STEP_M
        moved = coordinates_of(twin.scene)[f"drone.{name}"]
        ends = []
        for by in (step, -step):
            scene = moved(float(np.degrees(by) if turns else by))
            light = solve(scene, twin.instrument, spp=min(spp, MAX_SPP), seed=self._seed)
            ends.append(readings.expected(replace(twin, scene=scene), light).counts)
        return np.asarray(self.sigma[turns] * (ends[0] - ends[1]) / (2 * step))
