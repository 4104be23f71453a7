"""How often a drone hits something, by what it knows: a frame, a flight, steered spots, the truth.

    python benchmarks/collisions.py [--quick] [--json] [--markdown] [--film FILE]

Drawn worlds of families that nothing was learned from, in clear air and fog, flown through by the
same simple planner (see reactive_flight.py). Flights that the folder has are not flown again.
`--film` shows one world's flights from above.
"""

import json
import sys
from collections.abc import Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import asdict
from itertools import product
from pathlib import Path
from typing import Any

import numpy as np
from intervals import of_figure
from options import benchmark_options, finish
from reactive_flight import FAMILIES, SENSES, WEATHERS, Flown, fly, world

from reconstruction.base.arrays import Floats
from reconstruction.base.files import write_atomically
from spisim.transport.backend import use_threads
from spisim_paper.checks import Check, Interval, Table, surroundings

ROOT = Path(__file__).parents[1]
PAGE, FOLDER = ROOT / "docs" / "results" / "flights.md", ROOT / "out" / "collisions"
QUICK = ("racing-gates", "tunnel")
SINGLE, MEMORY, STEERED, TRUE = SENSES
CLEAR = "clear"
HALF, NEAR_TRUE = 0.5, 1.5


def main() -> int:
    """Fly and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(
        __doc__,
        f"worlds of {' and '.join(QUICK)} alone",
        PAGE,
        folder=FOLDER,
        others={
            "--film": {"type": Path, "help": "animation of one world, as GIF"},
            "--seeds": {"type": int, "default": 1, "help": "worlds of each family"},
            "--workers": {"type": int, "default": 1, "help": "processes that fly"},
            "--flown": {"action": "store_true", "help": "only worlds whose flights are all there"},
        },
    )
    families = QUICK if options.quick else FAMILIES
    worlds = [
        each
        for each in product(range(options.seeds), families, WEATHERS)
        if not options.flown or all(kept(options.folder, *each, sense).exists() for sense in SENSES)
    ]
    if not worlds:
        sys.exit(f"{options.folder} has no world whose flights are all there")
    every = [(options.folder, *each, sense) for each in worlds for sense in SENSES]
    with ProcessPoolExecutor(options.workers) as pool:
        flights = list(pool.map(flown, *zip(*every, strict=True)))
    if options.film is not None:
        from flight_film import write_film

        first = flights[0]
        shown = [f for f in flights if (f.family, f.seed, f.weather) == (
            first.family, first.seed, "fog 70 m")]  # fmt: skip
        write_film(options.film, world(first.family, first.seed, "fog 70 m"), shown)
    around = surroundings(("spisim", "numpy", "scipy", "mitsuba"))
    return finish(options, PAGE, "collisions", around, [table(flights)], [*promises(flights)])


def flown(folder: Path, seed: int, family: str, weather: str, sense: str) -> Flown:
    """A flight of the folder, flown if it is not there."""
    use_threads(1)
    folder.mkdir(parents=True, exist_ok=True)
    file = kept(folder, seed, family, weather, sense)
    if not file.exists():
        flight = fly(family, seed, weather, sense)
        fields = {
            k: v.tolist() if isinstance(v, np.ndarray) else v for k, v in asdict(flight).items()
        }
        write_atomically(file, json.dumps(fields).encode())
        print(f"{file.stem}: {flight.way_m:.0f} m, {flight.hits} collisions", flush=True)
    fields: dict[str, Any] = json.loads(file.read_text())
    fields["path_m"] = np.array(fields["path_m"])
    fields["hits_m"] = np.array(fields["hits_m"]).reshape(-1, 3)
    return Flown(**fields | {"weather": weather})


def kept(folder: Path, seed: int, family: str, weather: str, sense: str) -> Path:
    """Where a flight is kept; the truth knows no weather."""
    air = CLEAR if sense == TRUE else weather
    name = f"{family} {seed} {air} {sense}".replace(" ", "_").replace(",", "")
    return folder / f"{name}.json"


def of(flights: Sequence[Flown], weather: str, sense: str) -> list[Flown]:
    """Flights in a weather by a sense, in order of their worlds."""
    return [f for f in flights if f.sense == sense and weather in (f.weather, "all")]


def per_100_m(flights: Sequence[Flown]) -> float:
    """Collisions of all flights over all their way."""
    return 100 * sum(f.hits for f in flights) / sum(f.way_m for f in flights)


def interval_of(flights: Sequence[Flown]) -> Interval:
    """Of the collisions per 100 m, by bootstrap over worlds."""
    way, hits = (np.array([getattr(f, name) for f in flights]) for name in ("way_m", "hits"))

    def figure(some: Floats) -> float:
        return float(100 * hits[some].sum() / way[some].sum())

    return of_figure(figure, [f.family for f in flights])


def table(flights: Sequence[Flown]) -> Table:
    """Collisions, way and goals by weather and sense."""
    rows = []
    for weather, sense in product((*WEATHERS, "all"), SENSES):
        some = of(flights, weather, sense)
        low, high = interval_of(some)(0.95)
        minutes = sum(f.seconds for f in some) / 60
        rows.append((
            weather, sense, str(len(some)), f"{sum(f.way_m for f in some):.0f}",
            str(sum(f.hits for f in some)), f"{per_100_m(some):.2f} ({low:.2f}–{high:.2f})",
            f"{sum(f.way_m for f in some) / minutes / 60:.2f}",
            f"{sum(f.goals for f in some) / minutes:.1f}",
        ))  # fmt: skip
    return Table(
        "Flights of up to 60 m through drawn worlds by a reactive planner at up to 2 m/s, frames "
        "at a quarter of the rig's rate, poses off as an autopilot's (95 % over families).",
        ("air", "what it knows", "flights", "metres", "collisions", "per 100 m", "m/s",
         "goals a minute"),
        rows,
    )  # fmt: skip


def promises(flights: Sequence[Flown]) -> list[Check]:
    """What memory and steering are to gain."""
    single, memory, steered, true = (of(flights, "all", sense) for sense in SENSES)
    return [
        _ratio_check("collisions per metre, memory over single frame", memory, single, HALF),
        _ratio_check("collisions per metre, steered over true depth", steered, true, NEAR_TRUE),
    ]


def _ratio_check(name: str, some: list[Flown], others: list[Flown], limit: float) -> Check:
    def figure(which: Floats) -> float:
        one, other = (per_100_m([all_of[k] for k in which]) for all_of in (some, others))
        return one / other if other else np.nan

    families = [flight.family for flight in some]
    whole = figure(np.arange(len(some)))
    return Check(name, whole, limit, interval=of_figure(figure, families))


if __name__ == "__main__":
    sys.exit(main())
