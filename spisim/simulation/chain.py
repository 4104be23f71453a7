"""The whole chain: scene and instrument become light, counts and a capture."""

from collections.abc import Callable, Iterable
from dataclasses import dataclass, replace
from functools import partial
from typing import Any

import numpy as np

from reconstruction.capture import SURROGATE, Capture
from spisim.base.config import LightSource
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.simulation.doubt import MapDoubt
from spisim.simulation.light import (
    LightSequence,
    Steered,
    Transport,
    solve_spots,
    steered_light,
    surrogate_light,
    surrogate_spots,
    trace,
)
from spisim.simulation.light.sequence import at_key_times
from spisim.simulation.measurement import record
from spisim.transport import GroundTruth, ground_truth
from spisim.transport.backend import activate, with_backend


@dataclass(frozen=True, eq=False)
class Simulation:
    """A capture, and the light it was made from.

    Attributes
    ----------
    capture
        The readings, as a rig would record them, and the truth.
    transport
        Light at the first key time.
    truths
        Truth at the middle of each frame, or one for all frames if nothing moves.
    """

    capture: Capture
    transport: Transport
    truths: tuple[GroundTruth, ...]

    def __repr__(self) -> str:
        return f"Simulation of {self.capture!r}"


@with_backend
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
    """Simulate a recording.

    If anything moves, light is solved at key times and interpolated at the exposures; the truth of
    a frame is that at its middle. The light of steered spots is solved for every frame.

    Parameters
    ----------
    scene, instrument
        As of `spisim.load_scene` and `spisim.load_instrument`.
    light
        "traced", or "surrogate" for an approximation, thirty times as fast, for training data; it
        ignores `spp` and `transport_noise_share`.
    spp
        Light paths per virtual pixel and strategy.
    transport_noise_share
        Instead of `spp`: standard error of the light to reach, as a fraction of the detectors'
        noise; see `spisim.simulation.light.solve`.
    seed
        Equal seeds give equal captures on the same machine and backend.
    noise
        False for the expected readings of an ideal converter, as floating-point counts.
    frames
        Number of frames, one after the other.
    progress
        Called with the completed fraction of the light transport.

    Raises
    ------
    InputError
        If an object would pass through the instrument, if scene and instrument have different
        wavelengths, or if no backend for the light transport works.
    """
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

    steering = None if instrument.lasers is None else instrument.lasers.steering
    steered = None
    if steering is not None:
        steered = steered_light(
            scene,
            instrument,
            result,
            surrogate_spots
            if light == "surrogate"
            else partial(solve_spots, spp=spp, transport_noise_share=fraction),
            frames=frames,
            seed=seed,
            doubt=MapDoubt(scene, instrument, result, seed) if steering.follows else None,
        )
    simulation = _recorded(
        scene,
        instrument,
        result,
        budget,
        {"source": light},
        seed=seed,
        noise=noise,
        frames=frames,
        steered=steered,
    )
    if light == "surrogate":
        capture = simulation.capture
        provenance = capture.provenance
        text = f"{provenance.software}, {SURROGATE}"
        capture = replace(capture, provenance=replace(provenance, software=text))
        simulation = replace(simulation, capture=capture)
    return simulation


@with_backend
def simulate_from(
    scene: Scene,
    instrument: Instrument,
    light: Transport,
    *,
    transport_noise_share: float,
    seed: int = 0,
    noise: bool = True,
    frames: int = 1,
) -> Simulation:
    """Simulate a recording of a scene where nothing moves, from its light.

    Parameters
    ----------
    scene, instrument, seed, noise, frames
        As of `simulate`; nothing of the instrument is steered.
    light
        As traced by `spisim.simulation.light.fogs.trace_fogs` for `transport_noise_share`.

    Raises
    ------
    InputError
        As `simulate`.
    """
    sequence = at_key_times(scene, instrument, lambda *_: light, frames=frames, progress=None)
    source: dict[str, Any] = {"source": "traced"}
    if (how := light.reweighted) is not None:
        source["reweighted"] = {"ratio": how.ratio, "carried": float(f"{how.carried:.3g}")}
    budget = {"transport_noise_share": transport_noise_share}
    return _recorded(
        scene, instrument, sequence, budget, source, seed=seed, noise=noise, frames=frames
    )


def _recorded(
    scene: Scene,
    instrument: Instrument,
    light: LightSequence,
    budget: dict[str, Any],
    source: dict[str, Any],
    *,
    seed: int,
    noise: bool,
    frames: int,
    steered: Steered | None = None,
) -> Simulation:
    """A recording of light from a `source`, as accurate as the `budget` says."""
    truths = _truths(scene, instrument, frames, steered)
    keys = light.transports + (() if steered is None else steered.light.transports)
    how = {**budget, "backend": activate(), "light": {**source, **_accuracy(keys)}}
    capture = record(
        scene,
        instrument,
        light,
        truths,
        seed=seed,
        noise=noise,
        frames=frames,
        settings=how,
        steered=steered,
    )
    return Simulation(capture, light.transports[0], truths)


def _truths(
    scene: Scene, instrument: Instrument, frames: int, steered: Steered | None
) -> tuple[GroundTruth, ...]:
    """Truth at the middle of each frame; one for all if nothing moves."""
    different = frames if scene.moves or steered is not None else 1
    middles_s = (np.arange(different) + 0.5) * instrument.frame_time_s
    aimed = [instrument] * different
    if steered is not None and steered.pointing is not None:
        aimed = [instrument.aimed(each) for each in steered.pointing.true]
    return tuple(
        ground_truth(scene.at(time_s), own, subpixels=1)
        for time_s, own in zip(middles_s.tolist(), aimed, strict=True)
    )


def _accuracy(keys: tuple[Transport, ...]) -> dict[str, Any]:
    """Accuracy of the light at the worst key time."""

    def worst(values: Iterable[float]) -> float:
        return float(f"{max(values):.3g}")

    accuracy: dict[str, Any] = {
        name: sum(getattr(key, name) for key in keys) for name in ("paths", "dropped")
    }
    accuracy["noise_share"] = worst(key.noise_share for key in keys)
    accuracy["spot_noise_share"] = worst(key.spot_noise_share for key in keys)
    of_spots = np.array([np.sqrt((key.spot_histogram_error**2).sum(axis=1)) for key in keys])
    accuracy["spot_errors"] = [worst(of_spot) for of_spot in of_spots.T]
    for name in ("daylight", "spot_daylight", "spot_crosstalk"):
        powers = (
            (
                np.atleast_1d(getattr(key, f"{name}_w")),
                np.atleast_1d(getattr(key, f"{name}_error_w")),
            )
            for key in keys
        )
        tiny = np.finfo(np.float64).tiny
        accuracy[f"{name}_relative_error"] = worst(
            float(np.max(error / np.maximum(power, tiny), initial=0.0)) for power, error in powers
        )
    return accuracy
