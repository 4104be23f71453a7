"""Light of steered spots: solved for every frame's directions, while the image's is solved once."""

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.instrument.steering import Doubt, Pointing
from spisim.instrument.views import InstrumentView, together
from spisim.scene import Scene
from spisim.simulation.drops import Interpolation
from spisim.simulation.light.lattice import LatticeLight
from spisim.simulation.light.path_bins import MIN_BIN_WIDTH_M
from spisim.simulation.light.sequence import Light, LightSequence
from spisim.simulation.light.solve import Transport, spot_fields, streams_of
from spisim.simulation.light.spots import trace_spots
from spisim.transport.backend import with_backend
from spisim.transport.glints import warn_of_glints
from spisim.transport.world import build_world

#: Fields of `Transport` with a row per spot that the lasers' light decides.
HISTOGRAMS = ("spot_histogram", "spot_histogram_error")
SpotSolver = Callable[..., Transport]
"""`solve_spots`, or what takes its place; called without the effort."""


@dataclass(frozen=True, eq=False)
class Steered:
    """Light of the spots in every frame, and where they point."""

    light: Light
    pointing: Pointing | None  # None where mirrors rest or there are none


@with_backend
def solve_spots(
    scene: Scene,
    instrument: Instrument,
    directions: Floats,
    light: Transport,
    *,
    spp: int = 256,
    transport_noise_share: float | None = None,
    seed: int = 0,
) -> Transport:
    """`light` of a scene with its spots along other directions, whose light alone is traced.

    Daylight and the projector's light on their detectors are taken from `light`: they hardly decide
    about the noise of ranges, which is that of echo and electronics.

    Parameters
    ----------
    scene, instrument, spp, transport_noise_share, seed
        As of `solve`.
    directions
        Unit vectors (spots, 3) in the optical frame.
    light
        Light of the same scene, with any directions.

    Raises
    ------
    InputError
        As `solve`, and for an instrument without lasers.
    """
    began = time.perf_counter()
    aimed = instrument.aimed(directions)
    aimed.ranging.tof.check_bins(MIN_BIN_WIDTH_M)
    placed, world = InstrumentView.placed(scene, aimed), build_world(scene)
    warn_of_glints(world, placed.beams, placed.tof)
    budget = (spp, transport_noise_share)
    spots, lengths_m = trace_spots(
        aimed, world, placed, vars(light), budget, streams_of(seed)[1], None
    )
    return replace(
        light,
        **spot_fields(spots, lengths_m),
        dropped=spots.dropped,
        paths=spots.paths,
        seconds=time.perf_counter() - began,
        extra={**light.extra, "spot_orders": spots.mean["histogram_orders"]},
    )


@with_backend
def solve_spots_of(
    scene: Scene,
    instrument: Instrument,
    views: Sequence[InstrumentView],
    light: Sequence[Transport],
    *,
    spp: int = 256,
    transport_noise_share: float | None = None,
    seed: int = 0,
) -> list[Transport]:
    """`light` of each of several views of a scene with that of its spots, all traced at once.

    Each view may have another pose and other directions. See `solve_spots`.
    """
    steady = {
        name: np.concatenate([getattr(each, name) for each in light])
        for name in ("spot_daylight_w", "spot_crosstalk_w")
    }
    budget = (spp, transport_noise_share)
    spots, lengths_m = trace_spots(
        instrument, build_world(scene), together(views), steady, budget, streams_of(seed)[1], None
    )
    return by_view(spot_fields(spots, lengths_m), spots.mean["histogram_orders"], light)


def by_view(
    solved: Mapping[str, Any], orders: Floats, light: Sequence[Transport]
) -> list[Transport]:
    """`light` of each view with its part of the `solved` fields of the spots of all."""
    count = len(orders[0]) // len(light)
    parts = [slice(count * number, count * (number + 1)) for number in range(len(light))]
    return [
        replace(
            each,
            **{**solved, **{name: solved[name][part] for name in HISTOGRAMS}},
            extra={**each.extra, "spot_orders": orders[:, part]},
        )
        for part, each in zip(parts, light, strict=True)
    ]


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

    In a scene that moves it is solved in the middle of every part of a frame between two solutions
    of `light`. Falling drops are those of beams at rest.
    `doubt` makes that of the next frame from the light of a frame and its number.
    """
    lasers = instrument.ranging.lasers
    assert lasers.steering is not None
    home_deg, steering = np.array(lasers.directions_deg), lasers.steering
    per_frame = (len(light.transports) - 1) // frames or 1
    every: list[Transport] = []
    pointings: list[Pointing] = []
    known: Doubt | None = None
    for frame in range(frames):
        pointing = steering.pointing(home_deg, frame, seed, known)
        keys = [
            spots(
                scene.at((frame + (part + 0.5) / per_frame) * instrument.frame_time_s),
                instrument,
                pointing.true[0],
                light.transports[frame * per_frame + part if scene.moves else 0],
                seed=seed,
            )
            for part in range(per_frame)
        ]
        if doubt is not None:
            known = doubt(frame, of_frames(keys, pointing, 1))
        every += keys
        pointings.append(pointing)
    return of_frames(every, Pointing.joined(pointings), frames)


def of_frames(solved: Sequence[Transport], pointing: Pointing | None, frames: int) -> Steered:
    """Light whose keys are equally many for each frame, one after the other."""
    per_frame = len(solved) // frames
    keys = np.arange(len(solved)).reshape(frames, per_frame, 1)
    between = Interpolation(keys, np.ones(keys.shape))
    return Steered(LatticeLight(tuple(solved), between), pointing)
