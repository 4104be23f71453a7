"""Light of a twin and how it changes with parameters, with common random numbers."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from spisim.simulation.light import Transport, solve
from spisim.simulation.light.sensitivity import Sensitivity, sensitivities, weights_of
from spisim.transport import Outputs
from spisim_inverse.fit.parameters import MATERIAL, Parameter
from spisim_inverse.fit.twin import Twin

STREAM = 6
"""Random stream of a fit's light: not that of a simulated recording of the same seed."""
STEP = 0.1
"""Relative step of a reflectance. Light is nearly proportional to it, so that any step will do."""


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
        by_score = [each for each in free if not each.name.startswith(MATERIAL)]
        scores = sensitivities(twin.scene, [each.name for each in by_score])
        light = self._solved(twin, spp, scores)
        changes = {
            each.name: _change(light, score, each.slope(twin.values[each.name]))
            for each, score in zip(by_score, scores, strict=True)
        }
        for each in free:
            if each not in by_score:
                changes[each.name] = self._difference(twin, each, light, spp)
        return Traced(light, changes)

    def _solved(self, twin: Twin, spp: int, scores: Sequence[Sensitivity] = ()) -> Transport:
        outputs = Outputs(
            frequencies_hz=twin.instrument.tap_frequencies_hz, weights=weights_of(scores)
        )
        return solve(twin.scene, twin.instrument, spp=spp, seed=self._seed, outputs=outputs)

    def _difference(
        self, twin: Twin, parameter: Parameter, light: Transport, spp: int
    ) -> Transport:
        own = twin.values[parameter.name]
        step = STEP if own * (1 + STEP) <= parameter.bounds[1] else -STEP
        other = self._solved(parameter.applied(twin, own * (1 + step)), spp)
        return replace(
            light,
            image=(other.image - light.image) / step,
            spot_histogram=(other.spot_histogram - light.spot_histogram) / step,
        )


def _change(light: Transport, score: Sensitivity, slope: float) -> Transport:
    image = score.of(light, "image")[0] if "image_" + score.weight.name in light.extra else 0.0
    spots = light.spot_histogram
    if f"spot_histogram_{score.weight.name}" in light.extra:
        spots = score.of(light, "spot_histogram")[0]
    return replace(light, image=slope * (image + 0 * light.image), spot_histogram=slope * spots)


def moved(light: Transport, change: Transport, step: float) -> Transport:
    """Light with a step along a change; steady light stays."""
    return replace(
        light,
        image=light.image + step * change.image,
        spot_histogram=light.spot_histogram + step * change.spot_histogram,
    )
