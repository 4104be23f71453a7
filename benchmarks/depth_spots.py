"""Error of depth maps by the number of spots.

    python benchmarks/depth_spots.py [--quick] [--json] [--markdown]

Single frames of drawn worlds of families that nothing was learned from, by the surrogate: preset
`fog` with as many spots as are asked for, in rows and columns over the view.
"""

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from depth_sets import JUDGED_BY
from intervals import Indices, of_figure
from options import benchmark_options, finish

import spisim
from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats
from reconstruction.depth import MAX_RANGE_M
from spisim.instrument import Instrument
from spisim.scene import draw_scene
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "depth.md"
PACKAGES = ("spisim", "numpy", "scipy", "mitsuba")
SPOTS = 3, 4, 5, 9, 16, 64
METHODS = "nearest", "anchored", "learned"
WEATHERS = {"clear": None, "fog 70 m": {"kind": "moderate-radiation", "visibility_m": 70}}
SEED = 20261127
HALF_DEG = 9.0
GAIN = 0.95
"""Error of `learned` over that of `anchored`, at most, with more than four spots."""


def main() -> int:
    """Simulate, reconstruct and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(
        __doc__,
        "one world of each family",
        PAGE,
        others={"--seeds": {"type": int, "default": 4, "help": "worlds of each family"}},
    )
    seeds = 1 if options.quick else options.seeds
    tables, checks = [], []
    for weather in WEATHERS:
        errors = np.array(list(_worlds(weather, seeds)))  # (worlds, spots, methods)
        tables.append(_table(weather, errors))
        checks += [_check(weather, errors)]
    return finish(options, PAGE, "depth-spots", surroundings(PACKAGES), tables, checks)


def _worlds(weather: str, seeds: int) -> Iterator[Floats]:
    for seed in range(seeds):
        for family in JUDGED_BY:
            if family == "targets":
                continue
            changes = {"fog": WEATHERS[weather], "rain": None}
            scene = draw_scene(family, SEED + seed, changes=changes)
            errors = np.array([_errors(scene, spots, seed) for spots in SPOTS])
            print(f"{family} {seed}, {weather}: {errors[:, -1].round(3).tolist()}", flush=True)
            if np.isfinite(errors).all():
                yield errors


def _errors(scene: spisim.Scene, spots: int, seed: int) -> list[float]:
    """AbsRel by method where all have a depth, nan without any, or without `learned`."""
    capture = spisim.simulate(scene, with_spots(spots), light="surrogate", seed=seed).capture
    assert capture.truth is not None
    true_m = capture.truth.depth_m[0]
    result = Reconstructor(capture.setup, depth=METHODS)(capture.frame(0))
    if "depth learned" in result.notes or not set(METHODS) <= set(result.depths):
        return [np.nan] * len(METHODS)
    maps = np.array([result.depths[name] for name in METHODS])
    there = (true_m < MAX_RANGE_M) & np.isfinite(maps).all(axis=0)
    return (np.abs(maps[:, there] / true_m[there] - 1)).mean(axis=1).tolist()  # type: ignore[no-any-return]


def with_spots(spots: int) -> Instrument:
    """The preset with so many spots over the view, row by row."""
    side = int(np.ceil(np.sqrt(spots)))
    cells = HALF_DEG * ((2 * np.arange(side) + 1) / side - 1)
    grid = np.stack(np.meshgrid(cells, -cells), -1).reshape(-1, 2)
    chosen = grid[np.linspace(0, len(grid) - 1, spots).round().astype(int)]
    fields = spisim.load_instrument("fog").model_dump()
    fields["lasers"]["directions_deg"] = chosen.tolist()
    positions = fields["tof"]["detector"]["positions_m"]
    fields["tof"]["detector"]["positions_m"] = [positions[n % len(positions)] for n in range(spots)]
    return Instrument.model_validate(fields)


def _table(weather: str, errors: Floats) -> Table:
    rows = [
        (f"{spots}", *(f"{each:.3f}" for each in errors[:, number].mean(axis=0)))
        for number, spots in enumerate(SPOTS)
    ]
    title = (
        f"AbsRel by the number of spots, {weather}, where all methods have a depth: {len(errors)} "
        "worlds of unseen families in which `learned` takes all these numbers of spots."
    )
    return Table(title, ("spots", *METHODS), rows)


def _check(weather: str, errors: Floats) -> Check:
    many = errors[:, np.array(SPOTS) > 4].mean(axis=1)  # (worlds, methods)

    def ratio(which: Indices) -> float:
        means = many[which].mean(axis=0)
        return float(means[-1] / means[METHODS.index("anchored")])

    every = np.arange(len(many))
    interval = of_figure(ratio, every, positive=True)
    name = f"AbsRel of `learned` over `anchored`, more than four spots, {weather}"
    return Check(name, ratio(every), GAIN, interval=interval)


if __name__ == "__main__":
    sys.exit(main())
