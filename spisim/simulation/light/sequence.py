"""Light over the time of a recording: solved at key times, or once if nothing moves."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.scene import Scene, check_clear_of_sensor
from spisim.simulation.drops import Interpolation
from spisim.simulation.light.solve import Transport, solve
from spisim.transport.engine.outputs import Outputs

#: Solutions per frame of a scene that moves; between them the light is interpolated linearly.
KEYS_PER_FRAME = 2


class Light(Protocol):
    """Light of a recording, solved at some keys (K,) and interpolated between them."""

    @property
    def transports(self) -> tuple[Transport, ...]:
        """Light at the keys."""

    def between(self, times_s: Floats) -> Interpolation:
        """The light at times (frames, M), in seconds from the first exposure's start."""


@dataclass(frozen=True, eq=False)
class LightSequence:
    """Light transport at key times (K,), in seconds from the first exposure's start."""

    times_s: Floats
    transports: tuple[Transport, ...]

    def between(self, times_s: Floats) -> Interpolation:
        """The light at other times (frames, M)."""
        last = len(self.times_s) - 1
        position = np.interp(times_s, self.times_s, np.arange(last + 1)) if last else 0 * times_s
        before = np.floor(position).astype(np.intp)
        keys = np.stack([before, np.minimum(before + 1, last)], axis=-1)
        following = position - before
        return Interpolation(keys, np.stack([1 - following, following], axis=-1))


Progress = Callable[[float], None] | None


def at_key_times(
    scene: Scene,
    instrument: Instrument,
    light: Callable[[Scene, Progress], Transport],
    *,
    frames: int,
    progress: Progress,
) -> LightSequence:
    """The `light` of a scene at the key times of a recording of `frames` frames.

    Raises InputError if an object would pass through the instrument.
    """
    duration = frames * instrument.frame_time_s
    check_clear_of_sensor(scene, duration)
    keys = KEYS_PER_FRAME * frames + 1 if scene.moves else 1
    times = np.linspace(0, duration, keys) if scene.moves else np.zeros(1)

    def part(number: int) -> Progress:
        if progress is None:
            return None
        return lambda done: progress((number + done) / keys)

    transports = tuple(light(scene.at(time), part(number)) for number, time in enumerate(times))
    return LightSequence(times, transports)


def trace(
    scene: Scene,
    instrument: Instrument,
    *,
    frames: int,
    spp: int,
    transport_noise_share: float | None,
    seed: int,
    progress: Progress,
) -> LightSequence:
    """Solve the light transport for a recording of `frames` frames.

    Every key time uses the same random numbers, so that only the motion makes a difference.
    Raises InputError as `at_key_times` does.
    """

    def solved(instant: Scene, progress: Progress) -> Transport:
        return solve(
            instant,
            instrument,
            spp=spp,
            transport_noise_share=transport_noise_share,
            seed=seed,
            outputs=Outputs(frequencies_hz=instrument.tap_frequencies_hz),
            progress=progress,
        )

    return at_key_times(scene, instrument, solved, frames=frames, progress=progress)
