"""Spots: as many as a rig has, zones, steered, and flown at frame rate.

    python benchmarks/spots.py [--quick] [--json] [--markdown]

Zones against direct integrals, steered spots in fog, processor time of frames of 4, 16 and 64
spots, tracing of many spots, flights at frame rate, and what more and steered spots could add.
"""

import sys
import time
from pathlib import Path

import numpy as np
from options import benchmark_options, finish
from spots_flight import flight_benchmark, scene
from spots_steered import frame_times, judged, of_spots
from spots_steered import promises as steered_promises
from spots_steered import table as steered_tables
from spots_study import draw, study
from spots_study import promises as study_promises
from spots_study import tables as study_tables
from spots_zones import zones_benchmark

from reconstruction.capture.schema import between
from reconstruction.ranging import RANGING_METHODS
from spisim.instrument import Instrument
from spisim.simulation import simulate
from spisim.simulation.light import solve
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "spots.md"
PICTURE = PAGE.parents[1] / "images" / "steering.png"
SPOTS, FRAME_MS = (4, 16, 64), (6.0, 10.0, 25.0)
PACKAGES = ("spisim", "mitsuba", "drjit", "numpy", "scipy")
SHARE, ROUNDS, TIMED = 0.1, 5, 8


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "fewer frames, flights and draws", PAGE)
    tables, checks = zones_benchmark()
    for made, promised in (
        steered(quick=options.quick),
        traced(quick=options.quick),
        flight_benchmark(quick=options.quick),
        bound(quick=options.quick, keep=options.markdown),
    ):
        tables += made
        checks += promised
    return finish(options, PAGE, "spots", surroundings(PACKAGES), tables, checks)


def steered(*, quick: bool) -> tuple[list[Table], list[Check]]:
    """Ranges along steered directions, and times of frames."""
    result = judged(quick=quick)
    times = {spots: frame_times(spots) for spots in SPOTS}
    alone = {spots: ranging_s(spots) for spots in SPOTS}
    body = [(f"{spots}", f"{1e3 * seconds:.1f}") for spots, seconds in alone.items()]
    title = "Processor time of the ranges of a frame alone, by `fog`, three frequencies."
    checks = [
        Check(f"ms of the ranges of a frame, {spots} spots", 1e3 * alone[spots], limit)
        for spots, limit in zip(SPOTS, FRAME_MS, strict=True)
    ]
    tables = [*steered_tables(result, times), Table(title, ("spots", "ms"), body)]
    return tables, steered_promises(result, times) + checks


def ranging_s(spots: int) -> float:
    """Median processor time of the ranges of a frame of fixed spots."""
    instrument = fixed(spots)
    capture = simulate(scene(), instrument, light="surrogate", frames=TIMED, seed=1).capture
    assert capture.spots is not None
    solve_ranges = RANGING_METHODS["fog"].compile(between(capture.spots, 0, 0), capture.optics)
    taken = []
    for number in range(4 * TIMED):
        readings = between(capture.spots, number % TIMED, number % TIMED + 1)
        began = time.thread_time()
        solve_ranges(readings)
        taken.append(time.thread_time() - began)
    return float(np.median(taken[TIMED:]))


def fixed(spots: int) -> Instrument:
    """`fog` with a square grid of spots."""
    instrument = of_spots(spots)
    lasers = instrument.ranging.lasers.model_copy(update={"steering": None})
    return instrument.model_copy(update={"lasers": lasers})


def traced(*, quick: bool) -> tuple[list[Table], list[Check]]:
    """Time of tracing 4 and 64 spots to the same error, whole and of the spots alone."""
    few, many = (_tracing_s(spots, 2 if quick else ROUNDS) for spots in (4, 64))
    body = [(f"{spots}", f"{whole:.2f}") for spots, whole in ((4, few), (64, many))]
    table = Table(
        f"Time of the light of a frame in 50 m of fog to a noise fraction of {SHARE:g}, image "
        "included.",
        ("spots", "s"),
        body,
    )
    return [table], [Check("tracing 64 spots over 4, at equal error", many / few, 4.0)]


def _tracing_s(spots: int, rounds: int) -> float:
    instrument, seconds = fixed(spots), []
    for number in range(rounds + 1):
        began = time.perf_counter()
        solve(scene(), instrument, transport_noise_share=SHARE, seed=number)
        seconds.append(time.perf_counter() - began)
    return float(np.median(seconds[1:]))


def bound(*, quick: bool, keep: bool) -> tuple[list[Table], list[Check]]:
    """What more and steered spots could add, with its picture."""
    errors, names = study(quick=quick, progress=lambda text: print(text, file=sys.stderr))
    if keep:
        draw(errors, PICTURE)
    return study_tables(errors, names), study_promises(errors)


if __name__ == "__main__":
    sys.exit(main())
