"""Is a wall ever called free? Corridors, ranges, memory and noise in their worst corners.

    python benchmarks/corridor_corners.py [--quick] [--json] [--markdown] [--recorded FOLDER]

Averages over drawn worlds hide corners, and a drone acts on one frame at a time: here stand walls
as dark as ice and as near as the lens, people and poles between the spots, fog in banks, sensors
with nothing in reach, people who cross the view, and recordings whose noise is not stated. Nothing
was fitted to any of them. FOLDER holds the flights of a nano-drone (see `flight_measured`).
"""

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from functools import cache
from multiprocessing import get_context
from pathlib import Path

import numpy as np
from corner_moving import crossing_checks, crossings, crossings_table
from corner_phantoms import phantom_checks, phantoms
from corner_ranges import even_and_uneven, range_checks
from corner_ranges import table as ranges_table
from corner_worlds import (
    BETWEEN_SPOTS,
    HARD,
    LENS,
    Corner,
    between_spots,
    dark_walls,
    hard_views,
    near_walls,
    walls,
)
from depth_corridor import off
from flight_measured import nano_drone_checks
from flight_sets import POSE_ERRORS, clear_path, with_error
from intervals import of_fraction
from options import benchmark_options, finish
from unstated_noise import unstated_noise_checks

from reconstruction import Capture, InputError, Reconstructor, Result, read_capture
from reconstruction.base.arrays import Floats
from reconstruction.depth import (
    DISTANCES_M,
    FORWARD,
    Corridor,
    CorridorPosterior,
    nearest_obstacle_m,
    pixel_rays,
)
from spisim import load_instrument, simulate
from spisim.base.config import LightSource
from spisim.instrument import Instrument
from spisim.simulation.flight import record_flight
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "depth.md"
PACKAGES = ("mitsuba", "drjit", "numpy", "scipy")
SEED = 20261128
FOUR = ("paper", "fog", "fog-spad", "hybrid", "apd", "spad", "fga015")
"""Presets of four fixed spots, of which a frame has a corridor;"""
STEERED = ("paper-steered", "fog-steered")
FOG = ("fog", "fog-spad", "fog-steered")
"""and those made for fog."""
BEHIND_M = 0.5
"""The corridor is judged so far behind what stands in it."""
CLOSE = 1.25
NEAR_M = 1.0
WALLS, NEAR, BETWEEN, HARD_VIEWS = 80, 24, 32, 16
"""Scenes of each preset."""
HARD_PATHS = 32
"""Light paths for glass and metal, which the surrogate does not know."""
FREE, HALF = 0.9, 0.5
FROM_M, NEAR_TO_M = 0.5, 3.0
STEERED_S, STEERED_TRUTHS, LIGHT_SPACING_M = 1.0, 29, 0.08
STEERED_SCENES = 16


@dataclass(frozen=True, eq=False)
class Seen:
    """What one frame says of a corner; ``free`` (K,) up to each of `DISTANCES_M`.

    ``all_seen`` (K,) leaves out what is assumed to stand between rays, which by itself keeps the
    probability below 0.9.
    """

    kind: str
    preset: str
    air: str
    obstacle_m: float
    free: Floats
    all_seen: Floats
    refused: bool = False

    def free_to(self, distance_m: float) -> float:
        """Probability of a free corridor up to a distance."""
        return float(np.interp(distance_m, DISTANCES_M, self.free))

    @property
    def called_free(self) -> bool:
        """Whether the way past the obstacle is called free."""
        return self.free_to(self.obstacle_m + BEHIND_M) > FREE

    @property
    def seen_free(self) -> bool:
        """Whether it would be without the assumption of what stands between rays."""
        return float(np.interp(self.obstacle_m + BEHIND_M, DISTANCES_M, self.all_seen)) > FREE

    @property
    def missed(self) -> bool:
        """Whether the obstacle is missed at the default probability."""
        return not nearest_obstacle_m(self.free) <= CLOSE * self.obstacle_m


@cache
def instrument(preset: str) -> Instrument:
    """A preset, loaded once."""
    return load_instrument(preset)


def seen(corner: Corner, preset: str, seed: int) -> Seen:
    """One frame of a corner; a frame that is refused lets nobody fly."""
    light: LightSource = "traced" if corner.kind in HARD else "surrogate"
    capture = simulate(
        corner.scene, instrument(preset), light=light, spp=HARD_PATHS, seed=seed
    ).capture
    try:
        result = Reconstructor(capture.setup)(capture.frame(0))
    except InputError:
        blocked = np.zeros(DISTANCES_M.size)
        return Seen(
            corner.kind, preset, corner.air, corner.obstacle_m, blocked, blocked, refused=True
        )
    return of_result(corner, preset, result, capture)


def of_result(
    corner: Corner, preset: str, result: Result, capture: Capture, frame: int = 0
) -> Seen:
    """What a result says; the truth is what shows enough of itself in the corridor."""
    assert capture.truth is not None
    assert capture.setup.optics is not None
    depth_m = capture.truth.at(frame).depth_m
    true_m = Corridor(pixel_rays(capture.setup.optics, depth_m.shape)).nearest_m(depth_m)
    free, corridors = result.free_probability, next(iter(result.corridors.values()), None)
    assert corridors is None or isinstance(corridors, CorridorPosterior)
    return Seen(
        corner.kind,
        preset,
        corner.air,
        true_m if np.isfinite(true_m) else corner.obstacle_m,
        np.ones(DISTANCES_M.size) if free is None else free,
        np.ones(DISTANCES_M.size) if corridors is None else corridors.of_all_seen(FORWARD),
    )


def steered(corner: Corner, preset: str, seed: int) -> Seen:
    """The last frame of a second of steering with the memory of the flight, hovering.

    The poses are those of an autopilot with an error.
    """
    path = clear_path(corner.scene, "hover", 0.0, STEERED_S)
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "flight.h5"
        record_flight(file, corner.scene, path, instrument(preset), light="surrogate",
                      seed=seed, truths=STEERED_TRUTHS, spacing_m=LIGHT_SPACING_M)  # fmt: skip
        capture = with_error(read_capture(file), POSE_ERRORS["correlated"], seed)
    assert capture.truth is not None
    reconstructor = Reconstructor(capture.setup)
    for number in range(capture.truth.frame[-1] + 1):
        result = reconstructor(capture.frame(number))
    return of_result(corner, preset, result, capture, number)


Job = tuple[Callable[[Corner, str, int], Seen], Corner, str, int]


def jobs(quick: bool) -> Iterator[Job]:
    """All frames, and seconds of steering."""
    walls_, near, between, hard = (4, 2, 2, 2) if quick else (WALLS, NEAR, BETWEEN, HARD_VIEWS)
    for number, preset in enumerate(("paper", "fog") if quick else (*FOUR, *STEERED)):
        scenes = [*walls(walls_, SEED + number), *near_walls(near, SEED + number)]
        scenes += [*between_spots(between, SEED + number), *hard_views(hard, SEED + number)]
        scenes += [] if quick else list(dark_walls())
        for place, corner in enumerate(scenes):
            yield seen, corner, preset, SEED + 1000 * number + place
    for number, corner in enumerate(between_spots(1 if quick else STEERED_SCENES, SEED + 99)):
        yield steered, corner, "fog-steered", SEED + 99_000 + number


def judged(quick: bool) -> tuple[list[Seen], list[Seen]]:
    """What single frames say, and what a second of steering does."""
    every = list(jobs(quick))
    with ProcessPoolExecutor(2, mp_context=get_context("spawn")) as pool:
        results = list(pool.map(_run, every, chunksize=8))
    frames = [result for job, result in zip(every, results, strict=True) if job[0] is seen]
    return frames, results[len(frames) :]


def _run(job: Job) -> Seen:
    function, corner, preset, seed = job
    return function(corner, preset, seed)


def table_of(frames: Sequence[Seen], flown: Sequence[Seen]) -> Table:
    """Fractions by preset and corner."""
    body = []
    for preset in dict.fromkeys(each.preset for each in frames):
        own = [each for each in frames if each.preset == preset]
        far, near, between = (of_kind(own, *kinds) for kinds in (("wall",), (LENS,), BETWEEN_SPOTS))
        cells = (
            f"{fraction(far, lambda each: each.seen_free):.3f}",
            f"{fraction(far, lambda each: each.missed):.3f}",
            f"{fraction(near, lambda each: each.free_to(NEAR_M) > HALF):.3f}",
            f"{fraction(between, lambda each: each.called_free):.3f}",
            f"{fraction(between, lambda each: each.missed):.3f}",
            f"{fraction(of_kind(own, *HARD), lambda each: each.called_free):.3f}",
            "{:.3f} / {:.3f}".format(*reliability(own)),
        )
        body.append((preset, str(len(own)), *cells))
    if flown:
        body.append(
            (
                "fog-steered, 1 s",
                str(len(flown)),
                *("–",) * 3,
                f"{fraction(flown, lambda each: each.called_free):.3f}",
                f"{fraction(flown, lambda each: each.missed):.3f}",
                *("–",) * 2,
            )
        )
    return Table(
        "Corners: walls of R .01 to .9 at .3 to 6 m, in clear air and fog of 20 to 100 m; walls "
        f"at .05 to .3 m; people and poles between four spots. Called free: P > {FREE:g} to "
        f"{BEHIND_M:g} m behind; of walls without the assumption of things between rays, which "
        "alone keeps P below 0.9 beyond 1.4 m.",
        (
            *("preset", "frames", "walls called free", "walls missed"),
            *(f"against the lens: P(free to {NEAR_M:g} m) > {HALF:g}", "between: called free"),
            *("between: missed", "half walls, nets, panes, mirrors: called free"),
            *("reliability / over-confidence within 3 m",),
        ),
        body,
    )


def of_kind(frames: Sequence[Seen], *kinds: str) -> list[Seen]:
    """Those of some kinds of corners."""
    return [each for each in frames if each.kind in kinds]


def fraction(frames: Sequence[Seen], of: Callable[[Seen], bool]) -> float:
    """Fraction of the frames, nan without any."""
    return float(np.mean([of(each) for each in frames])) if frames else np.nan


def reliability(frames: Sequence[Seen]) -> tuple[float, float]:
    """Mean difference of stated probability and frequency, and by how much it is stated too high
    within `NEAR_TO_M`, on average."""
    usable = [each for each in frames if not each.refused]
    stated = np.array([each.free for each in usable])
    free = np.array([each.obstacle_m for each in usable])[:, None] > DISTANCES_M
    far = DISTANCES_M >= FROM_M
    near = far & (DISTANCES_M <= NEAR_TO_M)
    return off(stated[:, far], free[:, far]), float((stated[:, near] - free[:, near]).mean())


def corridor_checks(frames: Sequence[Seen], flown: Sequence[Seen]) -> Iterator[Check]:
    """What is promised of corridors."""

    def check(
        name: str, some: Sequence[Seen], of: Callable[[Seen], bool], limit: float
    ) -> Iterator[Check]:
        if some:
            hits = np.array([of(each) for each in some])
            interval = of_fraction(hits, np.arange(len(hits)))
            yield Check(name, float(hits.mean()), limit, interval=interval if limit else None)

    far = of_kind(frames, "wall")
    yield from check(
        f"walls called free, P > {FREE:g}, by what is seen", far, lambda each: each.seen_free, 0.01
    )
    fogs = [each for each in far if each.preset in FOG]
    yield from check("walls missed, presets for fog", fogs, lambda each: each.missed, 0.01)
    yield from check(
        f"walls against the lens, P(free to {NEAR_M:g} m) > {HALF:g}",
        of_kind(frames, LENS),
        lambda each: each.free_to(NEAR_M) > HALF,
        0.0,
    )
    yield from check(
        "between the spots, called free",
        of_kind(frames, *BETWEEN_SPOTS),
        lambda each: each.called_free,
        0.05,
    )
    yield from check(
        "half walls, nets, panes and mirrors called free",
        of_kind(frames, *HARD),
        lambda each: each.called_free,
        0.05,
    )
    yield from check("between the spots, missed after 1 s", flown, lambda each: each.missed, 0.15)
    for preset in dict.fromkeys(each.preset for each in frames):
        mean, over = reliability([each for each in frames if each.preset == preset])
        yield Check(f"reliability in corners, {preset}", mean, 0.10)
        yield Check(f"over-confidence within {NEAR_TO_M:g} m, {preset}", over, 0.0)


def main() -> int:
    """Measure, print and check."""
    options = benchmark_options(
        __doc__,
        "a few of each",
        PAGE,
        others={"--recorded": {"type": Path, "help": "flights of the nano-drone"}},
    )
    frames, flown = judged(options.quick)
    ranges, moving = even_and_uneven(options.quick), crossings(options.quick)
    checks = [
        *corridor_checks(frames, flown),
        *phantom_checks(phantoms(options.quick)),
        *range_checks(ranges),
        *crossing_checks(moving),
        *unstated_noise_checks(options.quick),
        *(nano_drone_checks(options.recorded) if options.recorded else ()),
    ]
    tables = [table_of(frames, flown), ranges_table(ranges), crossings_table(moving)]
    return finish(options, PAGE, "corridor corners", surroundings(PACKAGES), tables, checks)


if __name__ == "__main__":
    sys.exit(main())
