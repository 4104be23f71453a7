"""Two-ended light transport: one image and one set of path-length histograms for all patterns.

Paths from the projector and paths from the detector estimate the same light. Each strategy alone is
unbiased, but noisy where a path scatters close to the opposite end. A third strategy joins a
detector's path to a ray of the projector. Weighted against each other, the three cover each other's
weaknesses (`walk`). Light scattered only once, or once by fog and once by a surface, needs no walk:
it is summed along the projector's rays (`direct`, `double_scattering`).
"""

from collections.abc import Callable, Sequence
from enum import Enum
from functools import partial

import numpy as np

from spisim.instrument.views import BeamView, DetectorView, ProjectorView
from spisim.transport.engine import weights
from spisim.transport.engine.apertures import Detectors, JointDetectors
from spisim.transport.engine.beams import Beams
from spisim.transport.engine.direct import direct_light, direct_light_in_mirrors, mirrored_light
from spisim.transport.engine.double_scattering import double_scattering_light
from spisim.transport.engine.ends import Projector
from spisim.transport.engine.footprint import Footprint
from spisim.transport.engine.lights import Lamp
from spisim.transport.engine.outputs import Outputs, weighted
from spisim.transport.engine.path_weights import PathWeight, Score
from spisim.transport.engine.rays import FogRays
from spisim.transport.engine.sampling import Estimate, SamplingBudget, repeat, replicas_of
from spisim.transport.engine.tally import (
    Deposit,
    HistogramTally,
    MakeTally,
    OrderTally,
    PathLengthBins,
    Sums,
    Tallies,
)
from spisim.transport.engine.walk import MAX_VERTICES, Walk
from spisim.transport.world import World

#: Rays per walk path along which singly scattered light is summed. A ray costs a tenth of a walk
#: and has a tenth to two times its variance.
DIRECT_RAYS = 8
#: Rays per walk path for light scattered once by fog and once by a surface.
DOUBLE_SCATTERING_RAYS = 2
#: The same where something retro-reflects: fog scatters most of its return on the way, and few rays
#: find that (twice as efficient for safety vests in fog of 40 m).
DOUBLE_SCATTERING_RAYS_TO_RETRO = 12
#: The same two numbers for lasers, whose spots outshine multiply scattered light. The second also
#: applies to light by mirrors.
SPOT_RAYS, SPOT_DOUBLE_SCATTERING_RAYS = 8, 2


class Strategy(Enum):
    """Which ends launch paths. `BOTH` is the estimator to use; the others are checks on it."""

    BOTH = "two-ended"
    PROJECTOR = "projector"
    DETECTOR = "detector"


def transport_image(
    world: World,
    projector: ProjectorView,
    detector: DetectorView,
    budget: SamplingBudget,
    *,
    seed: np.random.SeedSequence,
    outputs: Outputs = Outputs(),  # noqa: B008
    strategy: Strategy = Strategy.BOTH,
    max_vertices: int = MAX_VERTICES,
    progress: Callable[[float], None] | None = None,
) -> Estimate:
    """Fraction of each virtual pixel's power that reaches the detectors: `image` (H·W,).

    The light of several detectors, which are alike, is added up. `budget` counts paths per virtual
    pixel from each end that takes part: both, except in a plain world. `outputs` adds values under
    the names of `spisim.transport.engine.tally`.
    """
    pixels = projector.pixels
    replicas = 1 if outputs.bins is not None else replicas_of(pixels)  # cubes fill the memory

    def launch(samples: float, seeds: Sequence[int], replicas: int) -> Sums:
        tallies = outputs.tallies(pixels, replicas)
        near = Projector.of(projector, samples)
        far = JointDetectors.of(detector, -(-near.lanes // len(detector.positions_m)))
        image_light(world, near, far, seeds, tallies.add, strategy, max_vertices, replicas=replicas)
        return tallies.read(detector.area_m2)

    ends = 2 if strategy is Strategy.BOTH and not world.plain else 1
    return repeat(launch, budget, pixels, seed, progress, replicas=replicas, ends=ends)


def image_light(
    world: World,
    near: Projector,
    far: JointDetectors | Lamp,
    seeds: Sequence[int],
    deposit: Deposit,
    strategy: Strategy = Strategy.BOTH,
    max_vertices: int = MAX_VERTICES,
    replicas: int = 1,
) -> None:
    """Deposit one launch of all light between the pixels of one end and the whole of the other.

    Light is the same both ways: the `near` end may be a camera and the `far` one a lamp.
    """
    # In clear air there is no fog to connect to.
    bridged = strategy is Strategy.BOTH and bool(world.media.parts)
    rays, footprint = FogRays(world, near) if bridged else None, None
    double_scattering = strategy is Strategy.BOTH and world.hazy
    outward = inward = weights.alone
    if strategy is Strategy.BOTH:
        outward, inward = weights.second_on_or_behind_glass, weights.second_on
        if world.plain:
            strategy, outward = Strategy.PROJECTOR, weights.alone_second_on_or_behind_glass
            if not world.geometry.see_through:
                footprint, outward = Footprint(world, far), weights.second_on
        rays_alone = near.times(DIRECT_RAYS)
        direct_light(world, rays_alone, far, seeds[2], deposit, replicas=replicas)
        mirrored_light(world, rays_alone, far, seeds[2], deposit, replicas=replicas)
        if max_vertices == 1:
            if not world.geometry.see_through:
                return
            strategy = Strategy.PROJECTOR  # which finds what lies behind panes
        if double_scattering:
            rays_alone = near.times(
                DOUBLE_SCATTERING_RAYS_TO_RETRO if world.retroreflects else DOUBLE_SCATTERING_RAYS
            )
            double_scattering_light(world, rays_alone, far, seeds[2], deposit, replicas=replicas)
    walk = partial(
        Walk,
        world,
        deposit=deposit,
        rays=rays,
        double_scattering=double_scattering,
        replicas=replicas,
    )
    if strategy is not Strategy.DETECTOR:
        out = walk(near, far, True, outward, mirrors=world.mirrors, footprint=footprint)
        out.run(seeds[0], max_vertices)
    if strategy is not Strategy.PROJECTOR:
        walk(far, near, False, inward).run(seeds[1], max_vertices)


def spot_histogram(
    world: World,
    beams: BeamView,
    detectors: DetectorView,
    bins: PathLengthBins,
    budget: SamplingBudget,
    *,
    seed: np.random.SeedSequence,
    strategy: Strategy = Strategy.BOTH,
    max_vertices: int = MAX_VERTICES,
    path_weights: Sequence[PathWeight] = (),
    progress: Callable[[float], None] | None = None,
) -> Estimate:
    """Fraction of each laser's power on its detector: `histogram` (beams, bins).

    `histogram_orders` (3, beams, bins) splits it by scattering; `path_weights` add both of weighted
    light, scores the first alone. `budget` counts paths per beam from each end.
    """
    count = len(beams.origins_m)
    replicas = replicas_of(count)
    histograms: MakeTally = partial(HistogramTally, bins=bins)
    by_order: MakeTally = partial(OrderTally, make=histograms)
    scores = [each for each in path_weights if isinstance(each, Score)]
    others = [each for each in path_weights if not isinstance(each, Score)]
    kinds = [by_order, *weighted([by_order], others), *weighted([histograms], scores)]

    def launch(samples: float, seeds: Sequence[int], replicas: int) -> Sums:
        tallies = Tallies(count, kinds, replicas, weighted=bool(path_weights))
        near = Beams.of(world, beams, int(samples))
        far = Detectors.of(detectors, int(samples))
        rays = near.times(SPOT_RAYS)
        direct_light(world, rays, far, seeds[2], tallies.add, replicas=replicas)
        rays = near.times(SPOT_DOUBLE_SCATTERING_RAYS)
        direct_light_in_mirrors(world, rays, far, seeds[2], tallies.add, replicas=replicas)
        if max_vertices > 1 or world.geometry.see_through:
            weight, double_scattering = weights.alone, False
            if strategy is Strategy.BOTH:
                weight, double_scattering = weights.balanced, world.hazy
            if double_scattering:
                double_scattering_light(world, rays, far, seeds[2], tallies.add, replicas=replicas)
            walk = partial(
                Walk,
                world,
                deposit=tallies.add,
                double_scattering=double_scattering,
                replicas=replicas,
            )
            if strategy is not Strategy.DETECTOR:
                out = walk(near, far, True, weight, mirrors=world.smooth)
                out.run(seeds[0], max_vertices - 1)
            if strategy is not Strategy.PROJECTOR and max_vertices > 1:
                walk(far, near, False, weight).run(seeds[1], max_vertices - 1)
        return tallies.read(detectors.area_m2)

    return repeat(launch, budget, count, seed, progress, replicas=replicas)
