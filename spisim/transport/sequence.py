"""Light over the time of a recording: one solution where nothing moves, key times where it does."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spisim.instrument import Instrument
from spisim.scene import Scene, check_clear_of_sensor
from spisim.transport.engine.outputs import Outputs
from spisim.transport.solve import Transport, solve

Floats = NDArray[np.float64]

#: Solutions per frame of a scene that moves; between them the light is interpolated linearly.
KEYS_PER_FRAME = 2


@dataclass(frozen=True, eq=False)
class LightSequence:
    """Light transport at key times (K,), in seconds from the first exposure's start."""

    times_s: Floats
    transports: tuple[Transport, ...]

    def weights(self, times_s: Floats) -> Floats:
        """Share of each key time in the light at other times: (..., K), rows sum to one."""
        keys = len(self.times_s)
        place = np.interp(times_s, self.times_s, np.arange(keys)) if keys > 1 else 0 * times_s
        apart: Floats = np.abs(place[..., None] - np.arange(keys))
        shares: Floats = np.maximum(1 - apart, 0)
        return shares


def trace(
    scene: Scene,
    instrument: Instrument,
    *,
    frames: int,
    spp: int,
    transport_error: float | None,
    seed: int,
    progress: Callable[[float], None] | None,
) -> LightSequence:
    """Solve the light transport for a recording of `frames` frames.

    Every key time uses the same random numbers, so that only the motion makes a difference.

    Raises
    ------
    InputError
        If an object would pass through the instrument.
    """
    duration = frames * instrument.frame_time_s
    check_clear_of_sensor(scene, duration)
    keys = KEYS_PER_FRAME * frames + 1 if scene.moves else 1
    times = np.linspace(0, duration, keys) if scene.moves else np.zeros(1)

    def part(number: int) -> Callable[[float], None] | None:
        if progress is None:
            return None
        return lambda done: progress((number + done) / keys)

    transports = tuple(
        solve(
            scene.at(time),
            instrument,
            spp=spp,
            transport_error=transport_error,
            seed=seed,
            outputs=Outputs(frequencies_hz=instrument.tap_frequencies_hz),
            progress=part(number),
        )
        for number, time in enumerate(times)
    )
    return LightSequence(times, transports)
