"""Light for very large data sets: singly scattered light, and an approximation of the rest.

It replaces `solve` and is about thirty times as fast. Light that is scattered once, by a surface or
by fog, is traced with few paths (`engine.direct`); the echo of the fog is smoothed over the image.
All other light is approximated by fractions of this:

* from surface to surface, `BOUNCED` of the light of the surfaces around;
* from surfaces through the fog, `FORWARD` of their light times the optical depth of its path: fog
  scatters forward, next to where the light was going;
* scattered in fog more often, `AGAIN_M` times the extinction of what is scattered there once.

The fractions are fitted by `tools/surrogate_fit.py`, which also measures the error of this
approximation. It fails where light reaches a surface round a corner or through a mirror, and where
the optical depth of a path is above about 3. Of paths through panes only the first surface counts,
as in `engine.direct`.
"""

from __future__ import annotations

import time
from collections.abc import Callable, Mapping, Sequence
from dataclasses import replace
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.instrument.views import InstrumentView, together
from spisim.scene import Scene
from spisim.simulation.light.path_bins import MIN_BIN_WIDTH_M, bins_for
from spisim.simulation.light.sequence import LightSequence, at_key_times
from spisim.simulation.light.solve import (
    Transport,
    streams_of,
)
from spisim.simulation.light.spots import ranging_histogram
from spisim.simulation.light.stated_error import image_error, spot_error
from spisim.simulation.light.steady import steady_light
from spisim.simulation.light.steered import by_view
from spisim.transport.backend import with_backend
from spisim.transport.engine.estimator import transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.sampling import Estimate, PathBudget
from spisim.transport.world import World, build_world

#: Paths of each virtual pixel, and of each laser.
PATHS, SPOT_PATHS = 8, 1024
#: Fractions of singly scattered light that are added to it; see above.
BOUNCED, FORWARD, AGAIN_M = 0.033, 0.64, 1.24
#: The same for the spots, whose detectors see little but the beam; zones see what bounces, too.
SPOT_FORWARD_M, SPOT_AGAIN_M = 0.33, 0.9
#: Standard deviations of the smoothing, over the longer side of the image: of light from all
#: around, of light that fog scatters forward, and of the fog's own echo.
AROUND, BESIDE, ECHO = 1 / 8, 1 / 32, 1 / 40
#: Frequency whose phase gives the mean path length, up to 30 km.
LONG_HZ = 1e4
#: Relative error of daylight, and of the projector's light on the spots' detectors.
STEADY_ERROR = 0.3


def surrogate_light(
    scene: Scene,
    instrument: Instrument,
    *,
    frames: int,
    seed: int,
    progress: Callable[[float], None] | None,
) -> LightSequence:
    """Light of a recording of `frames` frames; see `trace`."""
    return at_key_times(
        scene,
        instrument,
        lambda instant, _: surrogate(instant, instrument, seed=seed),
        frames=frames,
        progress=progress,
    )


@with_backend
def surrogate(scene: Scene, instrument: Instrument, *, seed: int = 0) -> Transport:
    """Approximate result of `solve`; its errors include all that is approximated.

    Raises InputError if the scene was made for another wavelength than the instrument's.
    """
    began = time.perf_counter()
    if instrument.ranges:
        instrument.ranging.tof.check_bins(MIN_BIN_WIDTH_M)
    placed = InstrumentView.placed(scene, instrument)
    streams = np.random.SeedSequence(seed, spawn_key=(1,)).spawn(5)
    world = build_world(scene)
    steady = steady_light(
        scene, instrument, world, placed, streams[2:], target=STEADY_ERROR, max_vertices=1
    )
    extinction = scene.atmosphere.extinction_per_m
    image = _image(instrument, world, placed, extinction, streams[0])
    spots = _spots(instrument, world, placed, extinction, streams[1])
    dropped = image.pop("dropped") + spots.pop("dropped") + steady.pop("dropped")
    extra = image.pop("extra") | spots.pop("extra") | steady.pop("extra")
    paths = image.pop("paths") + spots.pop("paths")
    return Transport(
        **image,
        **spots,
        **steady,
        noise_share=np.nan,
        spot_noise_share=np.nan,
        dropped=dropped,
        paths=paths,
        seconds=time.perf_counter() - began,
        extra=extra,
    )


@with_backend
def surrogate_spots(
    scene: Scene, instrument: Instrument, directions: Floats, light: Transport, *, seed: int = 0
) -> Transport:
    """Approximate result of `solve_spots`."""
    began = time.perf_counter()
    aimed = instrument.aimed(directions)
    placed, extinction = InstrumentView.placed(scene, aimed), scene.atmosphere.extinction_per_m
    stream = np.random.SeedSequence(seed, spawn_key=(1,)).spawn(5)[1]
    spots = _spots(aimed, build_world(scene), placed, extinction, stream)
    extra = {**light.extra, **spots.pop("extra")}
    return replace(light, **spots, seconds=time.perf_counter() - began, extra=extra)


@with_backend
def surrogate_spots_of(
    scene: Scene,
    instrument: Instrument,
    views: Sequence[InstrumentView],
    light: Sequence[Transport],
    *,
    seed: int = 0,
) -> list[Transport]:
    """Approximate result of `solve_spots_of`."""
    extinction, stream = scene.atmosphere.extinction_per_m, streams_of(seed)[1]
    spots = _spots(instrument, build_world(scene), together(views), extinction, stream)
    orders = spots.pop("extra")["spot_orders"]
    return by_view(spots, orders, light)


def _image(
    instrument: Instrument,
    world: World,
    placed: InstrumentView,
    extinction_per_m: float,
    seed: np.random.SeedSequence,
) -> dict[str, Any]:
    """Fields of the image; one dark pixel without a projector."""
    shape = placed.projector.shape
    if not instrument.images:
        dark = np.zeros(shape)
        return {"image": dark, "image_error": dark, "dropped": 0, "paths": 0, "extra": {}}
    result = image_once(world, placed, instrument.tap_frequencies_hz, seed)
    once, waves = by_order(result.mean, shape)
    depth = extinction_per_m * mean_path_m(waves[0, -1])
    light, guessed = _completed(once[0], once[1], depth, extinction_per_m)
    phasors = [
        _completed(wave[0], wave[1], depth, extinction_per_m)[0]
        for wave in waves[:, :-1].swapaxes(0, 1)
    ]
    return {
        "image": light,
        "image_error": np.hypot(image_error(result, light.shape), guessed),
        "dropped": result.dropped,
        "paths": result.paths,
        "extra": {"phasors": np.array(phasors)} if phasors else {},
    }


def _spots(
    instrument: Instrument,
    world: World,
    placed: InstrumentView,
    extinction_per_m: float,
    seed: np.random.SeedSequence,
) -> dict[str, Any]:
    """Fields of the spots; empty without lasers."""
    if not instrument.ranges:
        none = {name: np.zeros((0, 0)) for name in ("spot_histogram", "spot_histogram_error")}
        extra = {"spot_orders": np.zeros((3, 0, 0))}
        return none | {"path_length_m": np.zeros(0), "dropped": 0, "paths": 0, "extra": extra}
    bins = bins_for(instrument.ranging.tof, world.axis_distances_m(placed.beams))
    result = ranging_histogram(
        world, placed, bins, PathBudget(SPOT_PATHS), seed=seed, max_vertices=1
    )
    surfaces, echo = result.mean["histogram_orders"][:2]
    guessed = extinction_per_m * (SPOT_FORWARD_M * surfaces + SPOT_AGAIN_M * echo)
    if placed.zones is not None:
        guessed += BOUNCED * surfaces
    return {
        "spot_histogram": surfaces + echo + guessed,
        "spot_histogram_error": np.hypot(spot_error(result), guessed),
        "path_length_m": bins.centres_m,
        "dropped": result.dropped,
        "paths": result.paths,
        "extra": {"spot_orders": np.stack([surfaces, echo, guessed])},
    }


def image_once(
    world: World,
    placed: InstrumentView,
    frequencies_hz: tuple[float, ...],
    seed: np.random.SeedSequence,
) -> Estimate:
    """Light of the image that is scattered once, with phasors of these and of LONG_HZ."""
    return transport_image(
        world,
        placed.projector,
        placed.bucket,
        PathBudget(PATHS),
        seed=seed,
        outputs=Outputs(orders=True, frequencies_hz=(*frequencies_hz, LONG_HZ)),
        max_vertices=1,
    )


def by_order(
    sums: Mapping[str, Floats], shape: tuple[int, int]
) -> tuple[Floats, NDArray[np.complex128]]:
    """Light by the number of scatterings in fog: image (3, H, W), and phasors (3, F, H, W)."""
    parts = sums["phasors_orders"]
    waves = np.moveaxis(parts[..., 0] + 1j * parts[..., 1], -1, -2)
    return sums["image_orders"].reshape(-1, *shape), waves.reshape(*waves.shape[:-1], *shape)


def mean_path_m(long_wave: NDArray[np.complex128]) -> Floats:
    """Mean path length of light, from its phasor at LONG_HZ."""
    return np.asarray(np.mod(np.angle(long_wave), 2 * np.pi) * c / (2 * np.pi * LONG_HZ))


def _completed(
    surfaces: NDArray[Any], echo: NDArray[Any], depth: Floats, extinction_per_m: float
) -> tuple[NDArray[Any], NDArray[Any]]:
    """All light, and its approximated part, from singly scattered light (H, W), real or complex.

    `depth` (H, W) is the optical depth of the way to the surface and back.
    """
    from scipy.ndimage import gaussian_filter  # slow to import

    side = max(surfaces.shape)
    echo = gaussian_filter(echo, ECHO * side)
    guessed = BOUNCED * gaussian_filter(surfaces, AROUND * side)
    guessed += FORWARD * gaussian_filter(depth * surfaces, BESIDE * side)
    guessed += AGAIN_M * extinction_per_m * echo
    return surfaces + echo + guessed, guessed
