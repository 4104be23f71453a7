"""The whole chain: scene and instrument become light, counts and a capture."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from reconstruction.capture import Capture
from spisim.instrument import Instrument
from spisim.measurement import record
from spisim.scene import Scene
from spisim.transport import GroundTruth, Transport, ground_truth, trace
from spisim.transport.backend import activate


@dataclass(frozen=True, eq=False)
class Simulation:
    """A capture, and the light it was made from.

    `transport` is that of the first key time; `truths` are those of the middle of every frame, or
    one of all where nothing moves.
    """

    capture: Capture
    transport: Transport
    truths: tuple[GroundTruth, ...]


def simulate(
    scene: Scene,
    instrument: Instrument,
    *,
    spp: int = 256,
    transport_error: float | None = None,
    seed: int = 0,
    noise: bool = True,
    frames: int = 1,
    progress: Callable[[float], None] | None = None,
) -> Simulation:
    """Simulate a recording of `frames` frames, one after the other.

    Where something moves, the light is solved at key times and interpolated between exposures;
    the truth of a frame is that of its middle.

    Parameters
    ----------
    spp
        Light paths per virtual pixel and strategy.
    transport_error
        Instead of `spp`: relative standard error of the bucket vector to be reached.
    seed
        Equal seeds give equal captures on the same machine and backend.
    noise
        False: the expected readings of an ideal converter, as floating-point counts.
    progress
        Called with the fraction of the light transport that is done.

    Raises
    ------
    InputError
        If a laser beam hits nothing, an object would pass through the instrument, the scene was
        made for another wavelength than the instrument's, or no backend for the light transport
        works.
    """
    middles_s = (np.arange(frames if scene.moves else 1) + 0.5) * instrument.frame_time_s
    truths = tuple(ground_truth(scene.at(time_s), instrument) for time_s in middles_s.tolist())
    light = trace(
        scene,
        instrument,
        frames=frames,
        spp=spp,
        transport_error=transport_error,
        seed=seed,
        progress=progress,
    )
    budget = {"spp": spp} if transport_error is None else {"transport_error": transport_error}
    how = {**budget, "backend": activate()}
    capture = record(
        scene, instrument, light, truths, seed=seed, noise=noise, frames=frames, settings=how
    )
    return Simulation(capture, light.transports[0], truths)
