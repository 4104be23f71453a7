"""How good depth maps are, by method: unseen seeds, families and shipped scenes, others' worlds.

    python benchmarks/depth.py [--quick] [--json] [--markdown] [--folder out/depth]
                               [--worlds CHECKOUTS] [--captures 200]

200 traced captures and more of each group and weather, half of each preset, which are made on the
first run into the folder and kept there: interrupted, it goes on where it was. Worlds of others
are those of benchmarks/depth_worlds.py; CHECKOUTS has a folder for each of the repositories, by its
name, and without it that group is left out. Unseen families are those that nothing learned from.
Every depth method gets the ranges of plain `cw` and of `fog`. References, on plain ranges:
interpolation by inverse distance, and the anchored map with constants that stay what they are here,
whatever is fitted later. Intervals are 95 %, by bootstrap over scenes. `--markdown` pastes
the tables into docs/results/depth.md.
"""

import os

os.environ.setdefault("OMP_NUM_THREADS", "1")  # there are as many processes

import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import replace
from pathlib import Path

import numpy as np
from depth_corridor import corridor_checks, reliability, roc
from depth_judging import FROZEN, Judged, Way, judge, seconds
from depth_sets import CAPTURES, GROUPS, PRESETS, WEATHERS, Case, captures
from intervals import Indices, of_figure
from options import benchmark_options, finish
from yardstick import processor

from reconstruction.base.arrays import Floats
from reconstruction.chosen_methods import USUAL_DEPTHS
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "depth.md"
FOLDER = Path(__file__).parents[1] / "out" / "depth"
PACKAGES = ("spisim", "mitsuba", "drjit", "numpy", "scipy")
CANDIDATE = (USUAL_DEPTHS[0], "cw")
"""The default depth method, on the ranges that are taken by default."""
INVERSE, FROZEN_MAP = ("inverse-distance", "cw"), (FROZEN, "cw")
REFERENCES = {"inverse distance": INVERSE, "the frozen map": FROZEN_MAP}
WORKERS = 2
RESAMPLED = 2000
TIMED = 20
RATIOS = {
    ("unseen seeds", "clear"): (0.70, 0.85),
    ("unseen families", "clear"): (0.80, 0.92),
    ("unseen families", "fog 150–500 m"): (0.75, 0.85),
    ("unseen families", "fog 50–150 m"): (0.40, 0.40),
}
"""AbsRel of the candidate over that of inverse distance, and of the frozen map, at most."""
DELTA = {"clear": 0.86, "fog 150–500 m": 0.82, "fog 50–150 m": 0.82}
"""Share of δ < 1.25 on unseen families, at least."""
HONEST = (0.92, 0.97)
MISSED = 0.5
"""Share of the misses of the frozen map."""
INVENTED = 0.05
FRAME_MS = 15.0
FIGURES = {
    "delta_1_25": "δ < 1.25",
    "rmse_m": "RMSE, m",
    "coverage": "pixels",
    "within_1_sigma": "1 σ",
    "within_2_sigma": "2 σ",
    "invented": "invented",
    "obstacle_missed": "missed",
    "obstacle_false": "false",
    "free_precision": "free, precision",
    "free_recall": "recall",
}

Cell = tuple[str, str, str]
"""Group, weather and preset."""
Cells = dict[Cell, list[Judged]]


def main() -> int:
    """Every method on every capture."""
    further = {
        "--worlds": {"type": Path, "metavar": "CHECKOUTS", "help": "of worlds of others"},
        "--captures": {"type": int, "default": CAPTURES, "help": "of each group and weather"},
    }
    options = benchmark_options(
        __doc__, "one scene of each group", PAGE, folder=FOLDER, others=further
    )
    folder = options.folder / "quick" if options.quick else options.folder
    cases = list(
        captures(folder, worlds=options.worlds, wanted=options.captures, quick=options.quick)
    )
    cells: Cells = defaultdict(list)
    with ProcessPoolExecutor(WORKERS) as pool:
        for each in pool.map(judge, cases, chunksize=8):
            cells[each.case.group, each.case.weather, each.case.preset].append(each)
    grouped = by_group(cells)
    tables = [*errors(cells), ratios(cells), others(cells), roc(grouped, CANDIDATE)]
    tables.append(reliability(grouped, CANDIDATE))
    promised = [*checks(cells), *corridor_checks(grouped, CANDIDATE), *frame_times(cases)]
    return finish(options, PAGE, "depth", surroundings(PACKAGES), tables, promised)


def values(judged: Sequence[Judged], way: Way, figure: str) -> Floats:
    """One figure of every capture, nan where there is none."""
    reported = [each.figures.get(way, {}).get(figure) for each in judged]
    return np.array([np.nan if value is None else value for value in reported], dtype=np.float64)


def names(judged: Sequence[Judged]) -> list[str]:
    """Scenes of the captures."""
    return [each.scene_name for each in judged]


def scenes_drawn(judged: Sequence[Judged]) -> Floats:
    """How often each capture counts (RESAMPLED, n), all of a scene together."""
    scenes, position = np.unique(names(judged), return_inverse=True)
    drawn = np.random.default_rng(0).multinomial(
        len(scenes), np.full(len(scenes), 1 / len(scenes)), size=RESAMPLED
    )
    return np.asarray(drawn[:, position], dtype=np.float64)


def ratio(judged: Sequence[Judged], way: Way, other: Way) -> tuple[float, float, float]:
    """Mean AbsRel over that by another way, where both have one; its 95 % interval."""
    above, below = (values(judged, each, "abs_rel") for each in (way, other))
    both = np.isfinite(above) & np.isfinite(below)
    if not both.any():
        return np.nan, np.nan, np.nan
    drawn = scenes_drawn(judged)[:, both]
    with np.errstate(divide="ignore", invalid="ignore"):
        result = (drawn @ above[both]) / (drawn @ below[both])
        mean = above[both].sum() / below[both].sum()
    low, high = np.nanpercentile(result, [2.5, 97.5])
    return float(mean), float(low), float(high)


def mean(judged: Sequence[Judged], way: Way, figure: str) -> float:
    """Over the captures that have one, nan without any."""
    return nan_mean(values(judged, way, figure))


def nan_mean(result: Floats) -> float:
    """Of what is there, nan where nothing is."""
    return float(np.nanmean(result)) if np.isfinite(result).any() else np.nan


def interval(judged: Sequence[Judged], way: Way, figure: str) -> str:
    """Mean and its 95 % interval in words."""
    result = values(judged, way, figure)
    finite = np.isfinite(result)
    if not finite.any():
        return "–"
    drawn = scenes_drawn(judged)[:, finite]
    with np.errstate(invalid="ignore"):
        low, high = np.nanpercentile(drawn @ result[finite] / drawn.sum(axis=1), [2.5, 97.5])
    return f"{result[finite].mean():.3f} ({low:.3f}–{high:.3f})"


def all_ways(cells: Cells) -> list[Way]:
    """All that any capture has, in their order."""
    return list(
        dict.fromkeys(way for each in cells.values() for one in each for way in one.figures)
    )


def rows(cells: Cells) -> Iterator[tuple[Cell, list[Judged]]]:
    """Cells in the order of the tables."""
    for group in GROUPS:
        for weather in WEATHERS:
            for preset in PRESETS:
                if (group, weather, preset) in cells:
                    yield (group, weather, preset), cells[group, weather, preset]


def by_group(cells: Cells) -> dict[tuple[str, str], list[Judged]]:
    """By group, and of all of them, and air, clear or fog."""
    grouped: dict[tuple[str, str], list[Judged]] = defaultdict(list)
    for (group, weather, _), judged in rows(cells):
        grouped[group, "clear" if weather == "clear" else "fog"] += judged
    everything: dict[tuple[str, str], list[Judged]] = defaultdict(list)
    for (_, air), judged in grouped.items():
        everything["all", air] += judged
    return grouped | everything


def errors(cells: Cells) -> Iterator[Table]:
    """AbsRel of every method, a table by preset."""
    for preset in PRESETS:
        chosen = [(cell, judged) for cell, judged in rows(cells) if cell[2] == preset]
        columns = (
            "method",
            "ranges",
            *(f"{group}, {weather}" for (group, weather, _), _ in chosen),
        )
        yield Table(
            f"Preset `{preset}`: mean AbsRel and its 95 % interval.",
            columns,
            [
                (*way, *(interval(judged, way, "abs_rel") for _, judged in chosen))
                for way in all_ways(cells)
            ],
        )


def ratios(cells: Cells) -> Table:
    """AbsRel of the candidate over those of the references."""
    body = []
    for cell, judged in rows(cells):
        reported = (ratio(judged, CANDIDATE, other) for other in REFERENCES.values())
        scenes = len({each.case.scene for each in judged})
        body.append(
            (
                *cell,
                str(len(judged)),
                str(scenes),
                *(f"{m:.2f} ({a:.2f}–{b:.2f})" for m, a, b in reported),
            )
        )
    columns = ("group", "weather", "preset", "captures", "scenes", "over inverse distance")
    return Table(
        f"AbsRel of `{CANDIDATE[0]}` on the ranges of `{CANDIDATE[1]}`, over that of the "
        "references on plain ranges of the same captures.",
        (*columns, "over the frozen map"),
        body,
    )


def others(cells: Cells) -> Table:
    """Everything else of the candidate and the reference."""
    body = []
    for cell, judged in rows(cells):
        for way in (CANDIDATE, FROZEN_MAP):
            result = (mean(judged, way, figure) for figure in FIGURES)
            reported = ("–" if np.isnan(value) else f"{value:.3f}" for value in result)
            brier, base = sky(judged, way)
            both = "–" if np.isnan(brier) else f"{brier:.3f} of {base:.3f}"
            body.append((*cell, way[0], *reported, both))
    columns = ("group", "weather", "preset", "method", *FIGURES.values(), "Brier score")
    return Table("Further metrics, mean over captures, as in docs/studies.md.", columns, body)


def sky(judged: Sequence[Judged], way: Way) -> tuple[float, float]:
    """Brier score of no return, and that of its base rate."""
    fraction = mean(judged, way, "nothing_share")
    return mean(judged, way, "nothing_brier"), fraction * (1 - fraction)


def checks(cells: Cells) -> Iterator[Check]:
    """What is promised."""
    for (group, weather, preset), judged in rows(cells):
        where = f"{group}, {weather}, {preset}"
        for reference, maximum in zip(REFERENCES, RATIOS.get((group, weather), ()), strict=False):
            name = f"AbsRel over {reference}, {where}"
            result = over(name, judged, (CANDIDATE, REFERENCES[reference], "abs_rel"), maximum)
            yield result
            if weather == "clear" and group == "unseen families" and reference == "the frozen map":
                yield replace(result, name=f"the same, surely below it, {where}", limit=1.0)
        if group == "unseen families":
            yield averaged(f"δ < 1.25, {where}", judged, "delta_1_25", DELTA[weather], True)
        within = averaged(f"pixels within 2 σ, {where}", judged, "within_2_sigma", HONEST[0], True)
        yield within
        yield replace(within, name=f"the same, at most, {where}", limit=HONEST[1], at_least=False)
    everything = [each for judged in cells.values() for each in judged]
    yield over(
        "obstacles missed, over those of the frozen map",
        everything,
        (CANDIDATE, FROZEN_MAP, "obstacle_missed"),
        MISSED,
    )
    if mean(everything, CANDIDATE, "nothing_share") > 0:
        yield brier_score(everything)
        yield averaged("pixels of nothing with a depth", everything, "invented", INVENTED)


def averaged(
    name: str, judged: Sequence[Judged], figure: str, limit: float, at_least: bool = False
) -> Check:
    """Mean of the candidate's figure over captures."""
    result = values(judged, CANDIDATE, figure)
    interval = of_figure(lambda some: nan_mean(result[some]), names(judged))
    return Check(name, nan_mean(result), limit, at_least, interval)


def over(name: str, judged: Sequence[Judged], what: tuple[Way, Way, str], maximum: float) -> Check:
    """One figure by a way over that by another, where both have it: the ratio of the means."""
    above, below = (values(judged, way, what[2]) for way in what[:2])
    both = np.isfinite(above) & np.isfinite(below)
    above, below = np.where(both, above, np.nan), np.where(both, below, np.nan)

    def quotient(some: Indices) -> float:
        return nan_mean(above[some]) / (nan_mean(below[some]) or np.nan)

    interval = of_figure(quotient, names(judged), positive=True)
    return Check(name, quotient(np.arange(len(judged))), maximum, interval=interval)


def brier_score(judged: Sequence[Judged]) -> Check:
    """Over that of the base rate; 1 for a method that gives no probability."""
    result = values(judged, CANDIDATE, "nothing_brier")
    result = np.ones(result.shape) if np.isnan(result).all() else result
    fraction = values(judged, CANDIDATE, "nothing_share")

    def quotient(some: Indices) -> float:
        rate = nan_mean(fraction[some])
        return nan_mean(result[some]) / (rate * (1 - rate) or np.nan)

    interval = of_figure(quotient, names(judged), positive=True)
    name = "Brier score of no return, over the base rate's"
    return Check(name, quotient(np.arange(len(judged))), 1.0, interval=interval)


def frame_times(cases: Sequence[Case]) -> Iterator[Check]:
    """From counts to depth, beside the yardstick."""
    for preset in PRESETS:
        case, yardstick = next(case for case in cases if case.preset == preset), processor()
        yardstick.look()
        frame_s = seconds(case, CANDIDATE, TIMED)
        yardstick.look()
        frame_ms, interval_ms = yardstick.on_reference(1e3 * frame_s)
        name = f"ms per frame by the default on the reference, {preset}"
        yield Check(name, frame_ms, FRAME_MS, interval=interval_ms)


if __name__ == "__main__":
    sys.exit(main())
