"""Frames recorded along a drone's motions, from light solved at key poses."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture import SURROGATE, Frames, Provenance, Setup
from spisim.base.config import LightSource, dump_yaml
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.flight.keys import Keys
from spisim.simulation.flight.motion import Motion
from spisim.simulation.light import Transport, solve, surrogate
from spisim.simulation.light.lattice import Lattice
from spisim.simulation.measurement import Memory, record_frames, recorded_optics
from spisim.transport import Outputs, ground_truth
from spisim.transport.backend import activate
from spisim.version import __version__

#: Random stream of the frames of a seed; other streams trace the light.
STREAM = 3


@dataclass(frozen=True, eq=False)
class Shot:
    """A frame, and its true image (H, W) with standard error, in electrons per exposure."""

    number: int
    motion: Motion
    frame: Frames
    image: Floats
    image_error: Floats


class Camera:
    """Records frames of an instrument in a scene, one after the other.

    The electronics carry charge over from the previous frame, as `memory` has it after that; the
    first frame follows itself.

    Parameters
    ----------
    scene, instrument
        What is recorded, and by what.
    keys
        Key poses, between which light is interpolated.
    light
        Solves the light of a scene at a key pose, as `solver` does.
    seed
        Seed of the readings' noise.
    cached
        Number of key poses whose light is cached.
    """

    def __init__(
        self,
        scene: Scene,
        instrument: Instrument,
        keys: Keys,
        light: Callable[[Scene], Transport],
        *,
        seed: int,
        cached: int,
    ) -> None:
        self.instrument = instrument
        self.scene = scene
        self.lattice = Lattice(lambda node: light(keys.scene(node)), cached)
        self._keys = keys
        self._seed = seed
        times_s = instrument.exposure_times_s(1)[0]
        self._fractions = times_s / instrument.frame_time_s
        self.memory: Memory | None = None

    def shoot(self, motion: Motion, number: int) -> Shot:
        """Record the next frame, during a motion; equal numbers have equal noise."""
        shot, self.memory = self._shoot(motion, number, self.memory)
        return shot

    def _shoot(
        self, motion: Motion, number: int, before: Memory | None
    ) -> tuple[Shot, Memory | None]:
        light = self.lattice.light(self._keys.positions(motion, self._fractions))
        middle = motion.scene(self.scene, 0.5)
        # Drops are visible only in front of the nearest surface.
        truths = [ground_truth(middle, self.instrument, subpixels=1)] if _has_drops(middle) else []
        streams = np.random.SeedSequence(self._seed, spawn_key=(STREAM, number))
        frame, mean = record_frames(
            motion.scene(self.scene),
            self.instrument,
            light,
            truths,
            streams,
            first=number,
            before=before,
        )
        return Shot(number, motion, frame, mean.image[0], mean.image_error[0]), mean.after

    def setup(self, motion: Motion) -> Setup:
        """Setup of the frames, which is the same for every motion."""
        none = self._shoot(motion, 0, None)[0].frame.between(0, 0)
        plan, *following_plans = self.instrument.pattern_plans
        return Setup(
            plan=plan,
            optics=recorded_optics(self.instrument),
            buckets=none.buckets,
            spots=none.spots,
            pattern_taps=none.pattern_taps,
            following_plans=tuple(following_plans),
        )


def solver(
    instrument: Instrument, light: LightSource, *, seed: int, **budget: Any
) -> Callable[[Scene], Transport]:
    """Function that solves the light of a scene, with the same random numbers for each.

    Parameters
    ----------
    instrument
        Emits and receives the light.
    light
        "traced", or "surrogate" for a fast approximation.
    seed
        Seed of the light paths.
    **budget
        `spp` or `transport_noise_share` of traced light, as of `solve`.
    """
    if light == "surrogate":
        return lambda scene: surrogate(scene, instrument, seed=seed)
    outputs = Outputs(orders=True, frequencies_hz=instrument.tap_frequencies_hz)
    return lambda scene: solve(scene, instrument, seed=seed, outputs=outputs, **budget)


def provenance(
    scene: Scene, instrument: Instrument, light: LightSource, *, seed: int, settings: dict[str, Any]
) -> Provenance:
    """Provenance of stream and capture; `settings` are further entries for its settings."""
    software = f"spisim {__version__}"
    common = {"backend": activate(), "media": scene.media_summary(), "noise": True}
    return Provenance(
        source="simulation",
        software=software if light == "traced" else f"{software}, {SURROGATE}",
        created=datetime.now(UTC).isoformat(timespec="seconds"),
        instrument=instrument.text,
        scene=scene.text,
        seed=seed,
        settings=dump_yaml({"light": {"source": light}} | common | settings),
    )


def _has_drops(scene: Scene) -> bool:
    return bool(scene.precipitation)
