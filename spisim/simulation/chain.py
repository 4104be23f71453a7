"""The whole chain: scene and instrument become light, counts and a capture."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from reconstruction.capture import SURROGATE, Capture
from spisim.base.config import LightSource
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.light import LightSequence, Transport, surrogate_light, trace
from spisim.simulation.measurement import record
from spisim.transport import GroundTruth, ground_truth
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

    def __repr__(self) -> str:
        return f"Simulation of {self.capture!r}"


def simulate(
    scene: Scene,
    instrument: Instrument,
    *,
    light: LightSource = "traced",
    spp: int = 256,
    transport_noise_share: float | None = None,
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
    light
        "surrogate": not traced but guessed, thirty times as fast, for data sets to learn from; spp
        and transport_noise_share are of no account then.
    spp
        Light paths per virtual pixel and strategy.
    transport_noise_share
        Instead of `spp`: standard error of the light to be reached, as a share of the detectors'
        noise; see `spisim.simulation.light.solve`.
    seed
        Equal seeds give equal captures on the same machine and backend.
    noise
        False: the expected readings of an ideal converter, as floating-point counts.
    progress
        Called with the fraction of the light transport that is done.

    Raises
    ------
    InputError
        If an object would pass through the instrument, the scene was made for another wavelength
        than the instrument's, or no backend for the light transport works.
    """
    middles_s = (np.arange(frames if scene.moves else 1) + 0.5) * instrument.frame_time_s
    truths = tuple(
        ground_truth(scene.at(time_s), instrument, subpixels=1) for time_s in middles_s.tolist()
    )
    fraction = transport_noise_share
    budget: dict[str, Any] = {}
    if light == "surrogate":
        result = surrogate_light(scene, instrument, frames=frames, seed=seed, progress=progress)
    else:
        budget = {"spp": spp} if fraction is None else {"transport_noise_share": fraction}
        result = trace(
            scene,
            instrument,
            frames=frames,
            spp=spp,
            transport_noise_share=fraction,
            seed=seed,
            progress=progress,
        )
    how = {**budget, "backend": activate(), "light": {"source": light, **_reported(result)}}
    capture = record(
        scene, instrument, result, truths, seed=seed, noise=noise, frames=frames, settings=how
    )
    if light == "surrogate":
        provenance = capture.provenance
        text = f"{provenance.software}, {SURROGATE}"
        capture = replace(capture, provenance=replace(provenance, software=text))
    return Simulation(capture, result.transports[0], truths)


def _reported(light: LightSequence) -> dict[str, Any]:
    """How well the light is known, at the worst of the key times."""

    def worst(values: Iterable[float]) -> float:
        return float(f"{max(values):.3g}")

    keys = light.transports
    reported: dict[str, Any] = {
        name: sum(getattr(key, name) for key in keys) for name in ("paths", "dropped")
    }
    reported["noise_share"] = worst(key.noise_share for key in keys)
    reported["spot_noise_share"] = worst(key.spot_noise_share for key in keys)
    for name in ("daylight", "spot_daylight", "spot_crosstalk"):
        powers = (
            (
                np.atleast_1d(getattr(key, f"{name}_w")),
                np.atleast_1d(getattr(key, f"{name}_error_w")),
            )
            for key in keys
        )
        tiny = np.finfo(np.float64).tiny
        reported[f"{name}_relative_error"] = worst(
            float(np.max(error / np.maximum(power, tiny), initial=0.0)) for power, error in powers
        )
    return reported
