"""Steady light on the detectors: sun, sky and lamps, and the projector on the ranging detectors.

The sun is parallel light and the sky a uniform upper hemisphere; the fog attenuates both. They are
never close to a path, so walks from the detectors alone have a finite variance, as those of
`gather` do for lamps. The projector is close. Its light is found like that of the image: summed
along the detectors' rays where it is scattered once, and by all strategies where it is scattered
more often.
"""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from functools import partial

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.instrument.views import DetectorView, ProjectorView
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.engine.apertures import Detectors
from spisim.transport.engine.direct import direct_light, mirrored_light
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.estimator import image_light
from spisim.transport.engine.gather import Gather
from spisim.transport.engine.lights import Lamp, Sun
from spisim.transport.engine.outputs import weighted
from spisim.transport.engine.path_weights import PathWeight
from spisim.transport.engine.rays import FogRays
from spisim.transport.engine.sampling import ErrorMetric, TargetError, repeat
from spisim.transport.engine.tally import Deposit, ImageTally, MakeTally, Sums, Tallies
from spisim.transport.engine.walk import MAX_VERTICES, Sky, Walk
from spisim.transport.engine.weights import alone, second_on, second_on_or_behind_glass
from spisim.transport.lamps import lamps_of
from spisim.transport.world import World

#: Target standard error of steady light, relative to it; half as much in the noise that it causes.
STEADY_ERROR = 0.05
#: Independent estimates in each launch, from which the error is taken.
REPLICAS = 16
#: Paths per detector and replica: in the first launch, and in total before giving up.
FIRST_PATHS, MAX_PATHS = 2**7, 2**20

#: Walks that end in the sky differ in their weight alone. Roulette keeps them until they carry less
#: than this fraction of it (5 times as efficient at an albedo of 0.99).
DAYLIGHT_ENDING = 0.25

Ends = Detectors | Projector
#: Traces `samples` paths per detector and replica, and deposits their light.
Trace = Callable[[Ends, int, Sequence[int], int, Deposit], None]


@dataclass(frozen=True, eq=False)
class Received:
    """In-band power on each detector's aperture, W, (detectors,), and its standard error."""

    power_w: Floats
    error_w: Floats
    dropped: int = 0  # contributions that were not finite numbers and are left out
    #: The same two of weighted light, by the name of the weight.
    weighted: Mapping[str, tuple[Floats, Floats]] = field(default_factory=dict)

    @classmethod
    def none(cls, detectors: int, path_weights: Sequence[PathWeight]) -> "Received":
        """No light on so many detectors."""
        dark = np.zeros(detectors)
        return cls(dark, dark, weighted={each.name: (dark, dark) for each in path_weights})

    def times(self, factor: float) -> "Received":
        """So much more light."""
        weighted = {
            name: (factor * power, factor * error) for name, (power, error) in self.weighted.items()
        }
        return Received(factor * self.power_w, factor * self.error_w, self.dropped, weighted)


def sun_of(scene: Scene, instrument: Instrument, world: World) -> Sun:
    """The sun's in-band light."""
    return Sun(
        irradiance=dr.opaque(mi.Float, instrument.daylight_irradiance(scene.ambient.sun_klx)),
        direction=dr.opaque(mi.Vector3f, list(scene.ambient.sun_direction)),
        distance_m=dr.opaque(mi.Float, 3 * world.radius_m),
    )


def sky_of(scene: Scene, instrument: Instrument) -> Sky:
    """In-band radiance of the sky by direction: E = π L for a uniform hemisphere, none below."""
    level = instrument.daylight_irradiance(scene.ambient.sky_klx) / np.pi
    radiance = dr.opaque(mi.Float, level)
    return lambda direction: dr.select(direction.z > 0, radiance, 0)


def has_daylight(scene: Scene) -> bool:
    """Whether there is sun or sky."""
    return scene.ambient.sun_klx > 0 or scene.ambient.sky_klx > 0


@with_backend
def daylight_power(
    scene: Scene,
    instrument: Instrument,
    world: World,
    detectors: DetectorView | ProjectorView,
    *,
    floor_w: float = 0.0,
    target: float = STEADY_ERROR,
    seed: np.random.SeedSequence,
    path_weights: Sequence[PathWeight] = (),
) -> Received:
    """Power of sun, sky and lamps on the detectors, or in the pixels of a receiver.

    Its standard error is at most `target` times the sum of it and `floor_w`, other steady light.
    `path_weights` add weighted light.
    """
    lamps, outdoors = lamps_of(scene, instrument, world), has_daylight(scene)
    if not outdoors and lamps is None:
        return Received.none(_count(detectors), path_weights)
    sun, sky = sun_of(scene, instrument, world), sky_of(scene, instrument)

    def trace(
        ends: Ends, samples: int, seeds: Sequence[int], replicas: int, deposit: Deposit
    ) -> None:
        if lamps is not None:
            Gather(world, ends, lamps, deposit, replicas).run(seeds[1])
        if not outdoors:
            return
        walk = Walk(
            world,
            ends,
            sun,
            False,
            alone,
            deposit,
            sky=sky,
            ending=DAYLIGHT_ENDING,
            replicas=replicas,
        )
        walk.run(seeds[0])

    return _received(trace, detectors, floor_w, target, seed, path_weights)


@with_backend
def projector_power(
    world: World,
    projector: ProjectorView,
    power_w: Floats,
    detectors: DetectorView | ProjectorView,
    *,
    floor_w: float = 0.0,
    target: float = STEADY_ERROR,
    seed: np.random.SeedSequence,
    max_vertices: int = MAX_VERTICES,
    path_weights: Sequence[PathWeight] = (),
) -> Received:
    """Power of a projector that emits `power_w` (H, W); see `daylight_power`."""
    total_w = float(power_w.sum())
    if total_w == 0:
        return Received.none(_count(detectors), path_weights)

    def trace(
        ends: Ends, samples: int, seeds: Sequence[int], replicas: int, deposit: Deposit
    ) -> None:
        if isinstance(ends, Projector):
            lamp = Lamp.of(projector, power_w, ends.lanes)
            image_light(
                world, ends, lamp, seeds, deposit, max_vertices=max_vertices, replicas=replicas
            )
            return
        lamp = Lamp.of(projector, power_w, samples, ends.count)
        rays = FogRays(world, lamp) if world.media.parts else None
        direct_light(world, ends, lamp, seeds[2], deposit, replicas=replicas)
        mirrored_light(world, lamp, ends, seeds[2], deposit, replicas=replicas)
        walk = partial(Walk, world, deposit=deposit, rays=rays, replicas=replicas)
        if max_vertices > 1:
            out = walk(lamp, ends, True, second_on, mirrors=world.mirrors)
            out.run(seeds[0], max_vertices)
        if max_vertices > 1 or world.geometry.see_through:
            walk(ends, lamp, False, second_on_or_behind_glass).run(seeds[1], max_vertices)

    return _received(trace, detectors, floor_w / total_w, target, seed, path_weights).times(total_w)


def _count(view: DetectorView | ProjectorView) -> int:
    return view.pixels if isinstance(view, ProjectorView) else len(view.positions_m)


def _received(
    trace: Trace,
    view: DetectorView | ProjectorView,
    floor_w: float,
    target: float,
    seed: np.random.SeedSequence,
    path_weights: Sequence[PathWeight],
) -> Received:
    """Power on each detector or in each pixel, from independent replicas."""
    detectors = _count(view)
    kinds: list[MakeTally] = [ImageTally, *weighted([ImageTally], path_weights)]

    def launch(samples: float, seeds: Sequence[int], replicas: int) -> Sums:
        tallies = Tallies(detectors, kinds, replicas, weighted=bool(path_weights))
        whole = int(samples)
        ends: Ends
        if isinstance(view, ProjectorView):  # a pixel sees along the rays that it would emit
            ends = Projector.of(view, whole)
        else:
            ends = Detectors.of(view, whole)
        trace(ends, whole, seeds, replicas, tallies.add)
        return tallies.read(view.area_m2)

    def size(mean_w: Floats, error_w: Floats) -> float:
        tiny = float(np.finfo(np.float64).tiny)
        return float(np.max(error_w / np.maximum(mean_w + floor_w, tiny)))

    error_metric = ErrorMetric(lambda sums: sums["image"], size)
    budget = TargetError(target, error_metric, FIRST_PATHS, REPLICAS * MAX_PATHS, REPLICAS)
    result = repeat(launch, budget, detectors, seed, None, replicas=REPLICAS)
    light = {
        each.name: (result.mean[f"image_{each.name}"], result.error[f"image_{each.name}"])
        for each in path_weights
    }
    return Received(result.mean["image"], result.error["image"], result.dropped, light)
