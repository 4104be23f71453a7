"""Light of a twin and how it changes with parameters, with common random numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from spisim.simulation.light import Transport, solve
from spisim.simulation.light.parameters import Derivative
from spisim.simulation.light.sensitivity import sensitivities, weights_of
from spisim.transport import Outputs
from spisim_inverse.fit.parameters import MATERIAL, Parameter
from spisim_inverse.fit.twin import Twin

STREAM = 6
"""Random stream of a fit's light: not that of a simulated recording of the same seed."""


@dataclass(frozen=True, eq=False)
class Traced:
    """Light, and its change per unit of the coordinate of each parameter that changes it."""

    light: Transport
    changes: dict[str, Transport]


class Tracer:
    """Traces light with the same random numbers every time; remembers the last."""

    def __init__(self, seed: int) -> None:
        stream = np.random.SeedSequence(seed, spawn_key=(STREAM,))
        self._seed = int(stream.generate_state(1)[0])
        self._last: tuple[object, Traced] | None = None

    def __call__(self, twin: Twin, parameters: Sequence[Parameter], spp: int) -> Traced:
        """Light of a twin at its present values."""
        free = [each for each in parameters if each.changes_light]
        key = spp, tuple(twin.values[each.name] for each in free)
        if self._last is None or self._last[0] != key:
            self._last = key, self._traced(twin, free, spp)
        return self._last[1]

    def _traced(self, twin: Twin, free: Sequence[Parameter], spp: int) -> Traced:
        scores = sensitivities(twin.scene, [each.name for each in free])
        outputs = Outputs(
            frequencies_hz=twin.instrument.tap_frequencies_hz, weights=weights_of(scores)
        )
        light = solve(twin.scene, twin.instrument, spp=spp, seed=self._seed, outputs=outputs)
        changes = {
            each.name: _change(twin, light, score, _slope(each, twin))
            for each, score in zip(free, scores, strict=True)
        }
        return Traced(light, changes)


def _slope(parameter: Parameter, twin: Twin) -> float:
    """Change of what a sensitivity is by per unit of the coordinate; a factor on reflectances."""
    if parameter.name.startswith(MATERIAL):
        return 1.0
    return parameter.slope(twin.values[parameter.name])


def _change(twin: Twin, light: Transport, score: Derivative, slope: float) -> Transport:
    """Change of image and echoes; steady light, which counts as hardly known, is left out."""
    names = ["image"] if twin.instrument.images else []
    names += ["spot_histogram"] if twin.instrument.ranges else []
    arrays: dict[str, Any] = {name: slope * score.of(light, name)[0] for name in names}
    return replace(light, **arrays)


def moved(light: Transport, change: Transport, step: float) -> Transport:
    """Light with a step along a change; steady light stays."""
    return replace(
        light,
        image=light.image + step * change.image,
        spot_histogram=light.spot_histogram + step * change.spot_histogram,
    )
