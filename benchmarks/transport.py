"""Light transport once for all patterns, against one render per pattern and one dual render.

    python benchmarks/transport.py [--quick] [--json] [--markdown]

The scene is a closed room with a box and a ball; the instrument is the paper's, with a detector
that sees 12° around its axis. `--markdown` pastes the tables into docs/results/transport.md.
"""

import multiprocessing
import resource
import sys
import time
from collections.abc import Callable
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import cycle
from pathlib import Path

import numpy as np
from alternatives import DualVolpath, TransientSpots
from efficiency import Method, Series, measure, ratio, z_score
from error_coverage import HALF_ANGLE_RAD, stated_errors
from mitsuba_reference import Renderer, bucket_powers, pattern_emitter
from options import benchmark_options, finish
from room import FOG_KIND, air, box_pose, room
from scipy.constants import c

import spisim
from reconstruction.base.arrays import Floats
from reconstruction.operators import expose, illumination, make_plan
from spisim.atmosphere import CLEAR
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene, Volume
from spisim.simulation.light import solve
from spisim.transport.daylight import projector_power
from spisim.transport.engine.estimator import spot_histogram, transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.world import build_world
from spisim_paper.checks import Check, Table, surroundings

DOCS = Path(__file__).parents[1] / "docs" / "results" / "transport.md"
PROMISED_VISIBILITY_M = 50

INSTRUMENT = spisim.load_instrument("paper")
PLAN = INSTRUMENT.pattern_plan
LIT = PLAN.exposures - 1  # the last exposure is dark
PLACED = InstrumentView.of(INSTRUMENT, np.eye(4))
PROJECTOR = PLACED.projector
DETECTOR = replace(PLACED.bucket, half_angle_rad=HALF_ANGLE_RAD)


@dataclass(frozen=True)
class Amounts:
    """How much work each part does."""

    visibilities_m: tuple[float | None, ...]  # None: clear air
    repetitions: int
    paths_per_pixel: int  # two-ended, from either end
    dual_paths_per_pixel: int
    paths_per_pattern: int
    patterns: int  # of the per-pattern render, spread over all
    spot_repetitions: int
    spot_paths: int  # of mitransient; two-ended half of them from either end
    path_counts: tuple[int, ...]
    memory_spp: int
    steady_runs: int
    coverage: tuple[int, tuple[int, int]]  # runs, and pixels of the image


FULL = Amounts(
    (None, 200, 50, 20, 10),
    20,
    128,
    256,
    2**17,
    8,
    20,
    2**17,
    (64, 256, 1024),
    1000,
    32,
    (24, (64, 64)),
)
QUICK = Amounts((None, 50), 10, 64, 256, 2**16, 4, 4, 2**15, (16, 64), 64, 32, (12, (32, 32)))

Section = tuple[Table, list[Check]]


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "rougher, in under a minute", DOCS)
    amounts = QUICK if options.quick else FULL

    around = surroundings(("spisim", "mitsuba", "drjit", "mitransient", "numpy"))
    tables: list[Table] = []
    checks: list[Check] = []
    # Memory comes first: a process starts with the peak of the one that starts it.
    sections: tuple[Callable[[Amounts], Section], ...] = (
        peak_memory,
        patterns,
        spots,
        steady,
        honesty,
        cost_of_paths,
        cost_of_patterns,
    )
    for section in sections:
        began = time.perf_counter()
        table, promises = section(amounts)
        tables.append(table)
        checks.extend(promises)
        print(f"{section.__name__}: {time.perf_counter() - began:.0f} s", file=sys.stderr)
    return finish(options, DOCS, "benchmark", around, [*tables[1:], tables[0]], checks)


def patterns(amounts: Amounts) -> Section:
    """Error² × time of the bucket vector."""
    chosen = np.linspace(1, LIT - 1, amounts.patterns).astype(int)
    rows: list[tuple[str, ...]] = []
    checks: list[Check] = []
    largest_z = 0.0
    for visibility_m in amounts.visibilities_m:
        name = "clear" if visibility_m is None else f"{visibility_m} m"
        methods = bucket_methods(room(air(visibility_m)), amounts, chosen)
        ours, dual, per_pattern = measure(methods, amounts.repetitions)
        rows.append((name, *described(methods[0], ours), "", "", ""))
        for method, series, displayed in (
            (methods[1], dual, np.arange(PLAN.exposures)),
            (methods[2], per_pattern, chosen),
        ):
            z = z_score(ours.readings[:, displayed], series.readings)
            largest_z = max(largest_z, z)
            rows.append((name, *described(method, series), *gains(ours, series), f"{z:.1f}"))
        if visibility_m == PROMISED_VISIBILITY_M:
            checks = [
                Check(
                    "ratio_per_pattern", ratio(ours, per_pattern, np.mean)[0], 3000, at_least=True
                ),
                Check("ratio_dual", ratio(ours, dual, np.mean)[0], 50, at_least=True),
            ]
    title = (
        f"Readings of {LIT} patterns of {PLAN.shape[0]} × {PLAN.shape[1]} pixels (one render per "
        f"pattern: {amounts.patterns} of them, time scaled to all); fog: {FOG_KIND}, "
        f"Henyey–Greenstein; {amounts.repetitions} runs of each method, in turns."
    )
    columns = ("visibility", "method", "paths", *_EFFICIENCY, *_GAINS, "z")
    return Table(title, columns, rows), [*checks, Check("largest_z", largest_z, 4)]


def bucket_methods(
    scene: Scene, amounts: Amounts, chosen: np.ndarray
) -> tuple[Method, Method, Method]:
    """Two-ended, dual and per pattern; the last renders the `chosen` patterns only."""
    world, dual = build_world(scene), DualVolpath(scene, PROJECTOR, DETECTOR)
    pixel, dual_pixel = amounts.paths_per_pixel, amounts.dual_paths_per_pixel
    pattern = amounts.paths_per_pattern
    displayed = [illumination(PLAN, k) for k in chosen]
    powers = bucket_powers(
        scene, PROJECTOR, DETECTOR, cycle(displayed), samples=pattern, seed=1_000_000
    )

    def two_ended(seed: int) -> Floats:
        entropy = np.random.SeedSequence(seed)
        estimate = transport_image(world, PROJECTOR, DETECTOR, PathBudget(pixel), seed=entropy)
        return expose(PLAN, estimate.mean["image"].reshape(PLAN.shape))

    return (
        Method("two-ended", f"2 × {pixel} per pixel", two_ended),
        Method(
            "dual `volpath`",
            f"{dual_pixel} per pixel",
            lambda seed: expose(PLAN, dual.image(dual_pixel, seed)),
        ),
        Method(
            "`volpath` per pattern",
            f"{pattern} per pattern",
            lambda seed: np.array([next(powers) for _ in displayed]),
            fraction=len(displayed) / LIT,
        ),
    )


def spots(amounts: Amounts) -> Section:
    """Error² × time of the four laser spots, where mitransient is right about them."""
    bank = Volume("bank", air(20), box_pose((5.8, 5.8, 5.5), (0, 0, 5)))
    rows: list[tuple[str, ...]] = []
    largest_z = 0.0
    title = (
        "Power and phasor at the modulation frequency of four spots; mitransient's "
        "`transient_prbvolpath` renders each dual, from the laser with a lamp at the detector. "
        "The fog bank (visibility 20 m) begins 2 m ahead of the instrument: mitransient starts "
        "every path in clear air, so fog around the instrument cannot be compared. Nor can density "
        "grids, where its null collisions leave out path length."
    )
    columns = ("air", "method", "paths", *_EFFICIENCY, *_GAINS, "z")
    for name, scene in (
        ("clear", room(CLEAR)),
        ("fog bank", replace(room(CLEAR), volumes=(bank,))),
    ):
        try:
            methods = spot_methods(scene, amounts.spot_paths)
        except ImportError as error:
            return Table(f"Spots are not compared: {error} (`pip install mitransient`)."), []
        ours, theirs = measure(methods, amounts.spot_repetitions)
        z = z_score(ours.readings, theirs.readings)
        largest_z = max(largest_z, z)
        rows.append((name, *described(methods[0], ours), "", "", ""))
        rows.append((name, *described(methods[1], theirs), *gains(ours, theirs), f"{z:.1f}"))
    return Table(title, columns, rows), [Check("largest_z_spots", largest_z, 4)]


def spot_methods(scene: Scene, paths: int) -> tuple[Method, Method]:
    """Two-ended and mitransient; raises ImportError where there is no mitransient."""
    frequency_hz = INSTRUMENT.tof.modulation.frequencies_hz[0]
    # mitransient's lamp is a point, so the apertures have to be small too.
    tof = replace(PLACED.tof, area_m2=DETECTOR.area_m2)
    theirs = TransientSpots(scene, PLACED.beams, tof, frequency_hz)
    world, half = build_world(scene), paths // 2
    bins = PathLengthBins(4001, 0.02)
    wave = np.exp(2j * np.pi * frequency_hz / c * bins.centres_m)

    def two_ended(seed: int) -> Floats:
        entropy = np.random.SeedSequence(seed)
        estimate = spot_histogram(world, PLACED.beams, tof, bins, PathBudget(half), seed=entropy)
        histogram = estimate.mean["histogram"]
        phasor = histogram @ wave
        return np.stack([histogram.sum(axis=1), phasor.real, phasor.imag], axis=1)

    return (
        Method("two-ended", f"2 × {half} per spot", two_ended),
        Method("mitransient", f"{paths} per spot", lambda seed: theirs.readings(paths, seed)),
    )


def steady(amounts: Amounts) -> Section:
    """Reported and true error of the projector's mean light on the ranging detectors."""
    rows, largest_z, reported = [], 0.0, []
    for visibility_m in (50, 10, 5):
        # The fog begins 1 m ahead: `volpath` has no finite variance in fog around both ends.
        bank = Volume("bank", air(visibility_m), box_pose((5.9, 5.9, 6.9), (0, 0, 4.45)))
        scene = replace(room(CLEAR), volumes=(bank,))
        world, seeds = build_world(scene), range(amounts.steady_runs)
        power_w = np.full(PROJECTOR.shape, 1 / PROJECTOR.pixels)
        ours = []
        began = time.process_time()
        for seed in seeds:
            entropy = np.random.SeedSequence(seed)
            ours.append(projector_power(world, PROJECTOR, power_w, PLACED.tof, seed=entropy))
        seconds = (time.process_time() - began) / len(ours)
        power = np.array([each.power_w for each in ours])
        error = np.array([each.error_w for each in ours])
        emitter = pattern_emitter(PROJECTOR, 1 / PROJECTOR.pixels)
        theirs = lit_evenly(scene, emitter, amounts.paths_per_pattern)
        z = z_score(power, theirs)
        chi2 = float(np.mean(power.var(axis=0, ddof=1) / np.mean(error**2, axis=0)))
        largest_z, reported = max(largest_z, z), [*reported, chi2]
        spread = float(np.mean(power.std(axis=0, ddof=1) / power.mean(axis=0)))
        rows.append(
            (
                f"{visibility_m} m",
                f"{100 * spread:.1f} %",
                f"{100 * np.max(error / power):.1f} %",
                f"{chi2:.2f}",
                f"{z:.1f}",
                f"{seconds:.2f}",
            )
        )
    title = (
        "Light of all pixels alike on the four ranging detectors, of a fog bank that begins 1 m "
        f"ahead: {amounts.steady_runs} runs, against Mitsuba's `volpath`. χ² is that of the runs "
        "over their reported standard errors, per degree of freedom."
    )
    columns = ("visibility", "error", "largest reported", "χ²", "z", "processor time (s)")
    checks = [Check("largest_z_steady", largest_z, 4), Check("chi2_steady", max(reported), 1.7)]
    return Table(title, columns, rows), checks


def honesty(amounts: Amounts) -> Section:
    """How many estimates lie within their stated errors."""
    return stated_errors(INSTRUMENT, *amounts.coverage)


def lit_evenly(scene: Scene, emitter: dict[str, object], samples: int) -> Floats:
    """Power on the ranging detectors (runs, 4) of a projector that shows all pixels alike."""
    renderer = Renderer(scene, {"projector": emitter})
    return np.array([renderer.power(PLACED.tof, samples=samples, seed=run) for run in range(8)])


def cost_of_paths(amounts: Amounts) -> Section:
    """Time against the number of paths."""
    trace = tracer()
    seconds = [fastest(trace, count) for count in amounts.path_counts]
    rows = []
    for count, taken in zip(amounts.path_counts, seconds, strict=True):
        millions = 2e-6 * count * PLAN.pixels
        rows.append((f"2 × {count}", f"{millions:.2f}", f"{taken:.2f}", f"{taken / millions:.2f}"))
    growth = (seconds[-1] / seconds[-2]) / (amounts.path_counts[-1] / amounts.path_counts[-2])
    title = f"Time against paths, at {PROMISED_VISIBILITY_M} m visibility, fastest of three."
    columns = ("paths per pixel", "million paths", "time (s)", "time per million (s)")
    return Table(title, columns, rows), [Check("time_over_paths_growth", growth, 1.25)]


def cost_of_patterns(amounts: Amounts) -> Section:
    """Time against the number of patterns."""
    trace = tracer()
    image, paths = trace(amounts.path_counts[0]), amounts.path_counts[0]
    tracing = fastest(trace, paths)
    rows, together = [], []
    for count in (1, 16, 128, 1024, 4096):
        exposing = fastest(expose, make_plan(PLAN.shape, count, polarity="signed"), image)
        together.append(tracing + exposing)
        rows.append((str(count), f"{tracing:.3f}", f"{1e3 * exposing:.2f}", f"{together[-1]:.3f}"))
    title = f"Time against patterns, with 2 × {paths} paths per pixel, fastest of three."
    columns = ("patterns", "transport (s)", "exposures (ms)", "together (s)")
    growth = together[-1] / together[0]
    return Table(title, columns, rows), [Check("time_4096_patterns_over_1", growth, 1.1)]


def peak_memory(amounts: Amounts) -> Section:
    """Peak of a process that solves for 256 × 256 pixels, phasors and spots."""
    spawn = multiprocessing.get_context("spawn")
    with ProcessPoolExecutor(1, mp_context=spawn) as pool:
        peak_gb, seconds = pool.submit(solve_large, amounts.memory_spp).result()
    row = (str(amounts.memory_spp), f"{peak_gb:.2f}", f"{seconds:.0f}")
    title = (
        "Peak resident memory of a process for 256 × 256 pixels, phasors at one frequency and "
        f"four spots, at {PROMISED_VISIBILITY_M} m visibility."
    )
    columns = ("spp", "peak (GB)", "time (s)")
    return Table(title, columns, [row]), [Check("peak_memory_gb", peak_gb, 2)]


def solve_large(spp: int) -> tuple[float, float]:
    """Peak memory of this process in GB and wall-clock seconds."""
    projector = INSTRUMENT.projector.model_copy(update={"shape": (256, 256)})
    instrument = INSTRUMENT.model_copy(update={"projector": projector})
    outputs = Outputs(frequencies_hz=(instrument.tof.modulation.frequencies_hz[0],))
    light = solve(room(air(PROMISED_VISIBILITY_M)), instrument, spp=spp, outputs=outputs)
    unit = 1 if sys.platform == "darwin" else 1024
    return resource.getrusage(resource.RUSAGE_SELF).ru_maxrss * unit / 1e9, light.seconds


def tracer() -> Callable[[int], Floats]:
    """Transport image (H, W) at the promised visibility, from so many paths per pixel."""
    world = build_world(room(air(PROMISED_VISIBILITY_M)))
    entropy = np.random.SeedSequence(0)

    def trace(paths: int) -> Floats:
        estimate = transport_image(world, PROJECTOR, DETECTOR, PathBudget(paths), seed=entropy)
        return estimate.mean["image"].reshape(PLAN.shape)

    trace(8)
    return trace


def fastest(work: Callable[..., object], *arguments: object) -> float:
    """Seconds of the fastest of three runs: the one that was disturbed least."""
    seconds = []
    for _ in range(3):
        began = time.perf_counter()
        work(*arguments)
        seconds.append(time.perf_counter() - began)
    return min(seconds)


_EFFICIENCY = ("error", "typical", "time (s)", "1/(error²·time)")
_GAINS = ("two-ended gains", "typically")


def described(method: Method, series: Series) -> tuple[str, ...]:
    """Cells of a method's row."""
    return (
        method.name,
        method.paths,
        f"{100 * series.error(np.mean):.2g} %",
        f"{100 * series.error(np.median):.2g} %",
        f"{series.time_s:.2f}",
        f"{series.efficiency(np.mean):.2g}",
    )


def gains(ours: Series, theirs: Series) -> tuple[str, ...]:
    """How much more efficient ours is, by standard deviations and typically."""
    result = (ratio(ours, theirs, average) for average in (np.mean, np.median))
    return tuple(f"{rounded(value)} × (± {100 * error:.0f} %)" for value, error in result)


def rounded(value: float) -> str:
    """Two significant digits, without an exponent."""
    text = f"{value:.2g}"
    return f"{float(text):,.0f}" if "e" in text else text


if __name__ == "__main__":
    sys.exit(main())
