"""What a flight knows more than a frame: depth and corridor with memory, by motion and weather.

    python benchmarks/flight.py [--quick] [--json] [--markdown] [--measured FOLDER]

Flights of drawn worlds of families that nothing was learned from, by the surrogate, with poses that
are exact, or wrong as an autopilot's. Figures with memory are paired with those of the single frame
in the same flights. With `--measured`, recordings of a nano-drone are predicted frame by frame.
"""

import sys
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np
from depth_corridor import off, rates
from flight_judging import FULL_S, SINGLE, WARM_UP_S, JudgedFlight, judge
from flight_measured import measured_benchmark
from flight_sets import MOTIONS, POSE_ERRORS, PRESETS, WEATHERS, Flight, flights
from intervals import of_figure
from options import benchmark_options, finish

from reconstruction.base.arrays import Floats, Mask
from reconstruction.depth import DISTANCES_M, MIN_FREE, nearest_obstacle_m
from spisim_paper.checks import Check, Interval, Table, surroundings

ROOT = Path(__file__).parents[1]
PAGE, FOLDER = ROOT / "docs" / "results" / "flights.md", ROOT / "out" / "flights"
PACKAGES = ("spisim", "numpy", "scipy")
USUAL = "correlated"
STEERED = "fog-steered"
FROM_M = 0.5
LIMITS = {"fog": 0.88, "clear": 0.95, "hover": 0.85}
CELL, WITHIN, FRAME_MS = 1.02, (0.92, 0.97), 8.5
MISSED, RELIABLE = 0.20, 0.05
STEERED_ABS_REL, LATER_ABS_REL, LATER_S = {"clear": 0.12, "fog": 0.135}, 0.10, 1.49
STEERED_MISSED, STEERED_FALSE, STEERED_FROM_S = 0.08, 0.10, 0.5
TRUTHS = {"obstacle_m": "obstacles", "surface_m": "surfaces"}
"""What may be in the way: see `Judged`."""
OPERATING_POINTS = (MIN_FREE, 0.75, 0.8, 0.85, 0.9)
OPERATED = ("fixed spots, clear", "fixed spots, fog", "steered spots, clear", "steered spots, fog")
Flights = Sequence[JudgedFlight]


def main() -> int:
    """Fly, judge and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(
        __doc__,
        "one preset, fewer seeds",
        PAGE,
        folder=FOLDER,
        others={
            "--measured": {"type": Path, "help": "folder of the nano-drone's recordings"},
            "--seeds": {"type": int, "default": 1, "help": "worlds of each family"},
            "--workers": {"type": int, "default": 1, "help": "processes that judge"},
            "--recorded": {"action": "store_true", "help": "only flights that the folder has"},
        },
    )
    every = flights(
        options.folder,
        "judged",
        seeds=range(options.seeds),
        presets=PRESETS[:1] if options.quick else PRESETS,
        weathers=("clear", "fog 50 m") if options.quick else tuple(WEATHERS),
        record=not options.recorded,
    )
    judged = []
    with ProcessPoolExecutor(options.workers) as pool:
        for flight, result in pool.map(_judged, every):
            print(f"{flight.path.stem}: {'not judged' if result is None else 'judged'}", flush=True)
            judged += [] if result is None else [result]
    tables = [*by_cell(judged), by_error(judged), corridors(judged)]
    tables += [by_operating_point(judged), times(judged)]
    checks = [*promises(judged)]
    if options.measured is not None:
        more, promised = measured_benchmark(options.measured)
        tables += more
        checks += promised
    return finish(options, PAGE, "flights", surroundings(PACKAGES), tables, checks)


def _judged(flight: Flight) -> tuple[Flight, JudgedFlight | None]:
    return flight, judge(flight)


def by_cell(judged: Flights) -> Iterator[Table]:
    """Errors by motion, weather and preset."""
    rows = []
    for cell, some in cells(judged):
        single, memory = (means(some, kind, "abs_rel") for kind in (SINGLE, USUAL))
        ratio, interval = paired(single, memory)
        low, high = interval(0.95)
        covered = float(np.mean(means(some, USUAL, "within")))
        figures = (f"{len(some)}", f"{single.mean():.3f}", f"{memory.mean():.3f}")
        worst = f"{(memory / single).max():.2f}"
        rows.append(
            (*cell, *figures, f"{ratio:.3f} ({low:.2f}–{high:.2f})", worst, f"{covered:.3f}")
        )
    yield Table(
        f"AbsRel of the depth map after {WARM_UP_S:g} s, poses off by 2 cm and .3° with a "
        "correlation of .3 s: single frame, with memory, their ratio (95 % over flights), the "
        "worst flight's, and the fraction of pixels within 2 sigma.",
        ("motion", "air", "preset", "flights", "single", "memory", "ratio", "worst", "within 2 σ"),
        rows,
    )


def by_error(judged: Flights) -> Table:
    """Ratio by the error of the poses."""
    rows = []
    for name, some in groups(judged).items():
        single = means(some, SINGLE, "abs_rel")
        ratios = []
        for kind in POSE_ERRORS:
            ratio, interval = paired(single, means(some, kind, "abs_rel"))
            ratios.append("{:.3f} ({:.2f}–{:.2f})".format(ratio, *interval(0.95)))
        rows.append((name, f"{len(some)}", *ratios))
    title = "AbsRel with memory over that of the single frame, by the error of the stated poses."
    return Table(title, ("flights of", "number", *POSE_ERRORS), rows)


def corridors(judged: Flights) -> Table:
    """Missed and false obstacles, and reliability; of obstacles and of any surface."""
    rows = []
    for name, some in groups(judged).items():
        for kind in (SINGLE, USUAL):
            figures = (
                (*obstacle_rates(some, kind, of), reliability(some, kind, of)) for of in TRUTHS
            )
            rows.append((name, kind, *(f"{each:.3f}" for some_of in figures for each in some_of)))
    return Table(
        "Obstacles in the corridor: fraction missed, frames with a false alarm, and the mean "
        "difference of stated probability and frequency that it is free. Then the same of the "
        "first surface in the corridor, be it thinner than an obstacle or out of view.",
        ("flights of", "poses", *2 * ("missed", "false", "reliability")),
        rows,
    )


def by_operating_point(judged: Flights) -> Table:
    """Missed and false by the probability below which an obstacle is stated."""
    rows = [
        (name, of.removesuffix("_m"), *(
            "{:.3f} / {:.3f}".format(*obstacle_rates(some, USUAL, of, STEERED_FROM_S, each))
            for each in OPERATING_POINTS
        ))
        for name, some in groups(judged).items() if name in OPERATED for of in TRUTHS
    ]  # fmt: skip
    return Table(
        f"Missed / false with correlated errors after {STEERED_FROM_S:g} s, by the probability of "
        "a free corridor below which something is stated.",
        ("flights of", "what", *(f"{each:g}" for each in OPERATING_POINTS)),
        rows,
    )


def times(judged: Flights) -> Table:
    """Processor time by kind of spots."""
    rows = []
    for name, some in by_spots(judged).items():
        ms = _memory_ms(some)
        rows.append((name, f"{len(ms)}", f"{np.median(ms):.1f}", f"{np.max(ms):.1f}"))
    return Table(
        f"Processor time of the memory in a frame after {FULL_S:g} s, ms.",
        ("flights of", "number", "median", "worst"),
        rows,
    )


def promises(judged: Flights) -> Iterator[Check]:
    """What is promised of unseen families."""
    by_name = groups(judged)
    for name, limit in LIMITS.items():
        if some := by_name.get(f"fixed spots, {name}"):
            yield _ratio_check(f"AbsRel over the single frame, fixed spots, {name}", some, limit)
    for cell, some in cells(judged):
        where = ", ".join(cell)
        yield _ratio_check(f"AbsRel over the single frame, {where}", some, CELL)
        covered = means(some, USUAL, "within")
        families = [each.flight.family for each in some]
        far = float(np.abs(covered.mean() - np.mean(WITHIN)))
        figure = of_figure(_away(covered), families)
        name = f"fraction within 2 sigma off {np.mean(WITHIN):g}, {where}"
        yield Check(name, far, (WITHIN[1] - WITHIN[0]) / 2, interval=figure)
    for air, limit in STEERED_ABS_REL.items():
        if some := by_name.get(f"steered spots, {air}"):
            early = float(np.mean(means(some, USUAL, "abs_rel", STEERED_FROM_S)))
            later = float(np.mean(means(some, USUAL, "abs_rel", LATER_S)))
            yield Check(f"AbsRel, four steered spots after .5 s, {air}", early, limit)
            yield Check(f"AbsRel, four steered spots after 1.5 s, {air}", later, LATER_ABS_REL)
    for name, some in by_name.items():
        figure = reliability(some, USUAL, "obstacle_m")
        yield Check(f"reliability of the corridor, {name}", figure, RELIABLE)
    for of, what in TRUTHS.items():
        yield from _corridor_promises(by_name, of, what)
    for name, some in by_spots(judged).items():
        if len(ms := _memory_ms(some)):
            what = f"processor time of the memory in a frame, {name}, ms"
            yield Check(what, float(np.median(ms)), FRAME_MS)


def _memory_ms(some: Flights) -> Floats:
    ms = 1e3 * np.array([each.memory_s for each in some])
    return ms[np.isfinite(ms)]


def _corridor_promises(by_name: dict[str, Flights], of: str, what: str) -> Iterator[Check]:
    if some := by_name.get("fixed spots, fog 50 m"):
        missed, false = obstacle_rates(some, USUAL, of)
        usual = obstacle_rates(some, SINGLE, of)[1]
        yield Check(f"{what} missed, fixed spots, 50 m fog", missed, MISSED)
        yield Check(f"false alarms over those of the single frame, {what}", false, usual)
    for air in STEERED_ABS_REL:
        if some := by_name.get(f"steered spots, {air}"):
            missed, false = obstacle_rates(some, USUAL, of, STEERED_FROM_S)
            yield Check(f"{what} missed, four steered spots, {air}", missed, STEERED_MISSED)
            yield Check(f"false alarms, {what}, four steered spots, {air}", false, STEERED_FALSE)


def _ratio_check(name: str, some: Flights, limit: float) -> Check:
    ratio, interval = paired(means(some, SINGLE, "abs_rel"), means(some, USUAL, "abs_rel"))
    return Check(name, ratio, limit, interval=interval)


def _away(covered: Floats) -> Callable[[Floats], float]:
    """Distance of the mean of some flights from the middle of what is allowed."""
    return lambda some: float(np.abs(covered[some].mean() - np.mean(WITHIN)))


def cells(judged: Flights) -> Iterator[tuple[tuple[str, str, str], Flights]]:
    """Flights by motion, weather and preset."""
    for preset in PRESETS:
        for weather in WEATHERS:
            for motion in MOTIONS:
                cell = motion, weather, preset
                if some := [each for each in judged if each.flight.cell == cell]:
                    yield cell, some


def groups(judged: Flights) -> dict[str, Flights]:
    """Flights by kind of spots, air and motion."""
    made: dict[str, list[JudgedFlight]] = {}
    for spots, some in by_spots(judged).items():
        for each in some:
            flight = each.flight
            air = "clear" if flight.weather == "clear" else "fog"
            for what in dict.fromkeys((air, flight.weather, flight.motion)):
                made.setdefault(f"{spots}, {what}", []).append(each)
    return dict(sorted(made.items()))


def by_spots(judged: Flights) -> dict[str, Flights]:
    """Flights by kind of spots."""
    steered = [each for each in judged if each.flight.preset == STEERED]
    fixed = [each for each in judged if each.flight.preset != STEERED]
    return {name: s for name, s in {"fixed spots": fixed, "steered spots": steered}.items() if s}


def means(some: Flights, kind: str, figure: str, from_s: float = WARM_UP_S) -> Floats:
    """A figure of each flight (flights,)."""
    return np.array([each.mean(kind, figure, from_s) for each in some])


def paired(single: Floats, memory: Floats) -> tuple[float, Interval]:
    """Mean ratio over flights, as of its logarithm, with its interval."""
    logs = np.log(memory / single)

    def figure(some: Floats) -> float:
        return float(np.exp(logs[some].mean()))

    return figure(np.arange(len(logs))), of_figure(figure, np.arange(len(logs)), positive=True)


def _frames(some: Flights, kind: str, of: str, from_s: float) -> tuple[Floats, Floats]:
    """True distances (n,), those of `TRUTHS`, and stated probabilities (n, K)."""
    frames = [k for each in some for k in each.frames[kind] if k.time_s >= from_s]
    return np.array([getattr(each, of) for each in frames]), np.array([k.free for k in frames])


def obstacle_rates(
    some: Flights, kind: str, of: str, from_s: float = WARM_UP_S, min_free: float = MIN_FREE
) -> tuple[float, float]:
    """Fraction missed, and of frames with a false alarm."""
    true_m, free = _frames(some, kind, of, from_s)
    return rates(true_m, np.array([nearest_obstacle_m(each, min_free) for each in free]))


def reliability(some: Flights, kind: str, of: str) -> float:
    """Mean difference of the stated probability of a free corridor and its frequency."""
    true_m, stated = _frames(some, kind, of, WARM_UP_S)
    far = DISTANCES_M >= FROM_M
    free: Mask = ~(true_m[:, None] <= DISTANCES_M)
    return off(stated[:, far], free[:, far])


if __name__ == "__main__":
    sys.exit(main())
