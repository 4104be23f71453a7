"""Frames recorded along a drone's motions, from light solved at key poses."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from datetime import UTC, datetime
from typing import Any, NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture import SURROGATE, Frames, Provenance, Setup
from reconstruction.reconstructor import Reconstructor
from spisim.base.config import LightSource, dump_yaml
from spisim.instrument import Instrument
from spisim.instrument.steering import Pointing
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene
from spisim.simulation.doubt import map_doubt
from spisim.simulation.flight.keys import Keys
from spisim.simulation.flight.motion import Motion, things_move
from spisim.simulation.light import Steered, Transport, solve, surrogate
from spisim.simulation.light.lattice import Lattice
from spisim.simulation.light.steered import of_frames, solve_spots_of
from spisim.simulation.light.surrogate import surrogate_spots_of
from spisim.simulation.measurement import Memory, record_frames, recorded_optics
from spisim.transport import Outputs, ground_truth
from spisim.transport.backend import activate, with_backend
from spisim.version import __version__

#: Random stream of the frames of a seed; other streams trace the light.
STREAM = 3


class LightSolver(NamedTuple):
    """Solves the light of a scene, with the same random numbers for each.

    `whole` is all light of a scene at a key pose; `spots` the light of the spots in several views
    of a scene, added to other light of each.
    """

    whole: Callable[[Scene], Transport]
    spots: Callable[[Scene, Sequence[InstrumentView], Sequence[Transport]], list[Transport]]


@dataclass(frozen=True, eq=False)
class Shot:
    """A frame, and its true image (H, W) with standard error, in electrons per exposure.

    `instrument` has the spots where they truly pointed, `after` is the electronics' last state.
    """

    number: int
    motion: Motion
    frame: Frames
    image: Floats
    image_error: Floats
    instrument: Instrument
    after: Memory | None


class Camera:
    """Records frames of an instrument in a scene, one after the other.

    The image's light is interpolated between key poses. That of the spots is solved for the middle
    of every frame: a spot that crosses an edge meets another surface at once.

    The electronics carry charge over from the previous frame, as `memory` has it after that; the
    first frame follows itself. Mirrors that follow the depth map have that of `last`, the previous
    frame.

    Parameters
    ----------
    scene, instrument
        What is recorded, and by what.
    keys
        Key poses, between which light is interpolated.
    light
        Solves the light, as `solver` does.
    seed
        Seed of the readings' noise and of the mirrors' errors.
    cached
        Number of key poses whose light is cached.
    """

    def __init__(
        self,
        scene: Scene,
        instrument: Instrument,
        keys: Keys,
        light: LightSolver,
        *,
        seed: int,
        cached: int,
    ) -> None:
        self.instrument = instrument
        self.scene = scene
        self.lattice = Lattice(lambda node: light.whole(keys.scene(node)), cached)
        self.memory: Memory | None = None
        self.last: Frames | None = None
        self._keys = keys
        self._light = light
        self._seed = seed
        times_s = instrument.exposure_times_s(1)[0]
        self._fractions = times_s / instrument.frame_time_s
        lasers = instrument.lasers
        self._steering = None if lasers is None else lasers.steering
        self._reconstruct: Reconstructor | None = None

    @with_backend
    def shoot(self, motions: Sequence[Motion], first: int) -> list[Shot]:
        """Record the next frames, during motions; equal numbers have equal noise.

        The light of their spots is solved together where nothing but the drone moves.
        """
        alone = things_move(self.scene) or self._follows or self.instrument.zones is not None
        step = 1 if alone else len(motions)
        shots = []
        for start in range(0, len(motions), step):
            shots += self._shoot(motions[start : start + step], first + start)
        return shots

    def _shoot(self, motions: Sequence[Motion], first: int) -> list[Shot]:
        lights = [
            self.lattice.light(self._keys.positions(motion, self._fractions)) for motion in motions
        ]
        numbers = range(first, first + len(motions))
        pointings = [self._pointing(number) for number in numbers]
        aimed = [
            self.instrument if each is None else self.instrument.aimed(each.true[0])
            for each in pointings
        ]
        middles = [motion.scene(self.scene, 0.5) for motion in motions]
        spots: Sequence[Steered | None] = [None] * len(motions)
        if self.instrument.ranges:
            views = [InstrumentView.placed(*each) for each in zip(middles, aimed, strict=True)]
            others = [light.transports[0] for light in lights]
            solved = self._light.spots(middles[0], views, others)
            spots = [
                of_frames([each], pointing, 1)
                for each, pointing in zip(solved, pointings, strict=True)
            ]
        shots = []
        for number, motion, light, own, middle, steered in zip(
            numbers, motions, lights, aimed, middles, spots, strict=True
        ):
            # Drops are visible only in front of the nearest surface.
            truths = [ground_truth(middle, own, subpixels=1)] if middle.precipitation else []
            streams = np.random.SeedSequence(self._seed, spawn_key=(STREAM, number))
            self.last, mean = record_frames(
                motion.scene(self.scene),
                self.instrument,
                light,
                truths,
                streams,
                first=number,
                before=self.memory,
                steered=steered,
            )
            self.memory = mean.after
            image, error = mean.image[0], mean.image_error[0]
            shots.append(Shot(number, motion, self.last, image, error, own, mean.after))
        return shots

    @property
    def _follows(self) -> bool:
        return self._steering is not None and self._steering.follows

    def _pointing(self, number: int) -> Pointing | None:
        """Directions of a frame; None without mirrors."""
        if self._steering is None:
            return None
        home_deg = np.array(self.instrument.ranging.lasers.directions_deg)
        doubt = None
        if self._follows and self.last is not None:
            if self._reconstruct is None:
                self._reconstruct = Reconstructor(self._setup(self.last))
            optics = recorded_optics(self.instrument)
            assert optics is not None
            doubt = map_doubt(self._reconstruct, self.last, optics)
        return self._steering.pointing(home_deg, number, self._seed, doubt)

    def setup(self, motion: Motion) -> Setup:
        """Setup of the frames, which is the same for every motion."""
        (shot,) = self.shoot([motion], 0)
        self.memory = self.last = None
        return self._setup(shot.frame)

    def _setup(self, frame: Frames) -> Setup:
        none = frame.between(0, 0)
        plan, *following_plans = self.instrument.recorded_plans
        return Setup(
            plan=plan,
            optics=recorded_optics(self.instrument),
            buckets=none.buckets,
            spots=none.spots,
            pattern_taps=none.pattern_taps,
            following_plans=tuple(following_plans),
        )


def solver(instrument: Instrument, light: LightSource, *, seed: int, **budget: Any) -> LightSolver:
    """Functions that solve the light of a scene.

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
        return LightSolver(
            lambda scene: surrogate(scene, instrument, seed=seed),
            lambda scene, views, others: surrogate_spots_of(
                scene, instrument, views, others, seed=seed
            ),
        )
    outputs = Outputs(orders=True, frequencies_hz=instrument.tap_frequencies_hz)
    return LightSolver(
        lambda scene: solve(scene, instrument, seed=seed, outputs=outputs, **budget),
        lambda scene, views, others: solve_spots_of(
            scene, instrument, views, others, seed=seed, **budget
        ),
    )


@with_backend
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
