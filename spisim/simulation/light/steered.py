"""Light of steered spots: solved for every frame's directions, while the image's is solved once."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.instrument.steering import Doubt, Pointing
from spisim.scene import Scene
from spisim.simulation.light.lattice import LatticeLight
from spisim.simulation.light.sequence import KEYS_PER_FRAME, Light, LightSequence
from spisim.simulation.light.solve import Transport
from spisim.transport.drops import Interpolation

SpotSolver = Callable[[Scene, Floats, Transport], Transport]
"""From a scene, directions (spots, 3) and its other light to `Transport`, as `solve_spots`."""


@dataclass(frozen=True, eq=False)
class Steered:
    """Light of the spots in every frame, and where they point."""

    light: Light
    pointing: Pointing


def steered_light(
    scene: Scene,
    instrument: Instrument,
    light: LightSequence,
    spots: SpotSolver,
    *,
    frames: int,
    seed: int,
    doubt: Callable[[int, Steered], Doubt | None] | None = None,
) -> Steered:
    """Light of the spots of successive frames, whose other light is `light`.

    In a scene that moves it is solved twice a frame, a quarter before and after its middle; that
    makes the mean of anything that changes linearly. Falling drops are those of beams at rest.
    `doubt` makes that of the next frame from the light of a frame and its number.
    """
    per_frame = KEYS_PER_FRAME if scene.moves else 1
    every: list[Transport] = []
    pointings: list[Pointing] = []
    known: Doubt | None = None
    for frame in range(frames):
        pointing = instrument.pointing(frame, seed, known)
        assert pointing is not None
        keys = [
            spots(
                scene.at((frame + (part + 0.5) / per_frame) * instrument.frame_time_s),
                pointing.true[0],
                light.transports[frame * per_frame + part if scene.moves else 0],
            )
            for part in range(per_frame)
        ]
        if doubt is not None:
            known = doubt(frame, _together(instrument, keys, pointing))
        every += keys
        pointings.append(pointing)
    return _together(instrument, every, Pointing.joined(pointings))


def _together(instrument: Instrument, solved: list[Transport], pointing: Pointing) -> Steered:
    """Light whose keys are equally many for each frame, and count equally."""
    shape = (len(pointing.true), 1, len(solved) // len(pointing.true))
    exposures = instrument.exposure_times_s(1).shape[1]
    keys = np.arange(len(solved)).reshape(shape).repeat(exposures, axis=1)
    between = Interpolation(keys, np.full(keys.shape, 1 / shape[-1]))
    return Steered(LatticeLight(tuple(solved), between), pointing)
