"""Light over the time of a recording: solved at key times, or once if nothing moves."""

from __future__ import annotations

import math
from collections.abc import Callable
from dataclasses import dataclass
from typing import Protocol

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.scene import Scene, check_clear_of_sensor
from spisim.simulation.drops import Interpolation
from spisim.simulation.light.lattice import instants
from spisim.simulation.light.solve import Transport, solve
from spisim.transport.engine.outputs import Outputs

#: Distance that anything moves between two solutions, between which light is interpolated
#: linearly. Over 5 cm at 2 m light changes by 5 %, and interpolation is off by 0.05 %; edges are
#: blended over a few pixels.
SPACING_M = 0.05
#: Rotation between two solutions: a pixel or two.
TURN_RAD = np.radians(0.5)
#: Bounds of the solutions per frame of a scene that moves. More than the maximum would take
#: minutes; at it things move by up to 1.6 m per frame.
MIN_KEYS_PER_FRAME, MAX_KEYS_PER_FRAME = 2, 32


class Light(Protocol):
    """Light of a recording, solved at some keys (K,) and interpolated between them."""

    @property
    def transports(self) -> tuple[Transport, ...]:
        """Light at the keys."""

    def between(self, times_s: Floats) -> Interpolation:
        """The light at times (frames, M), in seconds from the first exposure's start."""

    def during(self, frames: int, start: float, stop: float) -> Interpolation:
        """The light at instants spread over a part of each frame, of which 1 is the whole."""


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

    def during(self, frames: int, start: float, stop: float) -> Interpolation:
        """See `Light`; keys extend over all `frames`."""
        elapsed = np.arange(frames)[:, None] + instants(start, stop)  # in frames
        return self.between(elapsed * self.times_s[-1] / frames)


Progress = Callable[[float], None] | None


def keys_per_frame(scene: Scene, frame_time_s: float) -> int:
    """Solutions per frame: so many that nothing moves or turns too far between two of them."""
    velocity_m_s, spin_rad_s = scene.drone_velocity_m_s, scene.drone_angular_velocity_rad_s
    rates = [math.dist(each.velocity_m_s, velocity_m_s) / SPACING_M for each in scene.objects]
    spins = [spin_rad_s, *(each.angular_velocity_rad_s for each in scene.objects)]
    rates += [math.hypot(*spin) / TURN_RAD for spin in spins]
    steps = math.ceil(min(max(rates) * frame_time_s, MAX_KEYS_PER_FRAME))
    return max(steps, MIN_KEYS_PER_FRAME)


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
    keys = keys_per_frame(scene, instrument.frame_time_s) * frames + 1 if scene.moves else 1
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
