"""Steady light on the detectors: sun and sky, and the projector on the ranging detectors.

The sun is parallel light, the sky a uniform upper hemisphere; both come through the fog like all
light.
"""

from __future__ import annotations

from collections.abc import Sequence
from typing import Any

import drjit as dr
import mitsuba as mi
import numpy as np

from reconstruction.arrays import Floats
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.backend import with_backend
from spisim.transport.engine.ends import Detectors, Lamp, Sun
from spisim.transport.engine.sampling import Paths, repeat
from spisim.transport.engine.tally import Contribution, ImageTally, Sums, Tallies
from spisim.transport.engine.walk import Sink, Sky, Walk
from spisim.transport.engine.weights import alone
from spisim.transport.views import DetectorView, ProjectorView
from spisim.transport.world import World


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


@with_backend
def daylight_power(
    scene: Scene,
    instrument: Instrument,
    world: World,
    detectors: DetectorView,
    *,
    paths: int,
    seed: np.random.SeedSequence,
) -> Floats:
    """In-band power of sun and sky on each detector's aperture, W, (detectors,)."""
    if scene.ambient.sun_klx == 0 and scene.ambient.sky_klx == 0:
        return np.zeros(len(detectors.positions_m))
    sun, sky = sun_of(scene, instrument, world), sky_of(scene, instrument)
    return _received(world, detectors, sun, sky, paths, seed)


@with_backend
def projector_power(
    world: World,
    projector: ProjectorView,
    power_w: Floats,
    detectors: DetectorView,
    *,
    paths: int,
    seed: np.random.SeedSequence,
) -> Floats:
    """Power that a projector which emits `power_w` (H, W) sends onto each detector, W."""
    total = power_w.sum()
    return total * _received(
        world, detectors, Lamp.of(projector, power_w / total), None, paths, seed
    )


def _received(
    world: World,
    detectors: DetectorView,
    source: Sink,
    sky: Sky | None,
    paths: int,
    seed: np.random.SeedSequence,
) -> Floats:
    count = len(detectors.positions_m)

    def launch(samples: int, seeds: Sequence[int]) -> Sums:
        tallies = Tallies(count, [ImageTally], 1)
        ends = Detectors.of(detectors, samples)

        def deposit(light: Contribution) -> None:
            lane: Any = dr.arange(mi.UInt32, ends.lanes)
            tallies.add(light._replace(cell=lane % count))

        Walk(world, ends, source, False, alone, deposit, sky=sky).run(seeds[0])
        return tallies.read(detectors.area_m2)

    return repeat(launch, Paths(paths, launches=1), count, seed, None).mean["image"]
