"""Light in other fogs from the paths of one pass: right, and what a study of fogs gains by it.

    python benchmarks/inverse_fogs.py [--quick] [--jobs N] [--json] [--markdown]

First, light traced in fog of 50 m and reweighted to others is held against passes through those
fogs, by z over seeds: total light and its quadrants, the spots' light near and far by its order of
scattering. Then a study of six visibilities is made twice from the same seeds: every fog traced,
and from the passes that a study makes by itself. Times are those of the processor, in turns.
"""

import sys
import tempfile
import time
from collections.abc import Mapping, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass
from multiprocessing import get_context
from pathlib import Path
from typing import Any

import numpy as np
import yaml
from efficiency import ROUNDING
from options import benchmark_options, finish

import spisim
from reconstruction import read_capture
from reconstruction.base.arrays import Floats
from spisim.dataset.planned import stated_plan
from spisim.dataset.sample import Maker
from spisim.dataset.study.evaluation import evaluation_of
from spisim.simulation import simulate
from spisim.simulation.light import Transport, solve
from spisim.simulation.light.other_fog import OtherFog
from spisim.simulation.light.solve import solve_fogs
from spisim.transport import Outputs
from spisim.transport.backend import use_threads
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "inverse.md"
SCENES = ("target-plane", "warehouse", "reflective-shelf", "street-canyon")
TRACED_M, OTHERS_M = 50.0, (35.0, 42.0, 60.0, 80.0)
ORDERS = Outputs(orders=True)
SPP, SEEDS = 32, 8
STUDIED = ("warehouse", "person", "scaffold")
VISIBILITIES_M = (20, 40, 80, 160, 320, 640)
METRICS = ("image_correlation", "image_psnr_db", "range_error_m", "depth_mae_m", "depth_within_25")
ROUNDS = 6
MAX_Z, MAX_TRACED = 4.0, 1 / 3
#: Ratio of interval widths that "no wider" allows.
MAX_WIDTH = 1.05
RESAMPLED = 1000


def main() -> int:
    """Compare and print; the exit status is 1 if a promise is broken."""
    jobs = {"--jobs": {"type": int, "default": 1, "help": "processes, each with one scene"}}
    options = benchmark_options(__doc__, "one scene, four rounds", PAGE, others=jobs)
    few, rounds = (1, 4) if options.quick else (None, ROUNDS)
    with ProcessPoolExecutor(options.jobs, get_context("spawn"), use_threads, (1,)) as pool:
        studies = [pool.submit(study, name, rounds) for name in STUDIED[:few]]
        rows = [row for each in pool.map(compared, SCENES[:few]) for row in each]
        both = [each.result() for each in studies]
    tables = [
        Table(
            f"Light traced in {TRACED_M:g} m and reweighted, against passes through the other fog: "
            f"largest |z| over {SEEDS} seeds, {SPP} paths a pixel and end, of image and spots, and "
            "the effective fraction of the paths; change: of the logarithm of all light.",
            ("scene", "visibility", "z, image", "z, spots", "carried", "change"),
            [each.row for each in rows],
        ),
        Table(
            f"A study of {len(VISIBILITIES_M)} fogs of moderate radiation fog, 20 to 640 m, and as "
            "many poses as rounds: every fog traced, and reweighted where a study does. Widths are "
            "of 95 % intervals of the means over rounds, the geometric mean over "
            f"{len(METRICS)} metrics and all fogs, with its own standard error.",
            (
                "scene",
                "rounds",
                "fogs traced",
                "seconds, all traced",
                "seconds",
                "width over width",
            ),
            [each.row for each in both],
        ),
    ]
    worst = max(each.width - each.width_error for each in both)
    checks = [
        Check("largest |z|", max(max(each.image_z, each.spots_z) for each in rows), MAX_Z),
        Check("fogs traced of all", max(each.traced for each in both), MAX_TRACED),
        Check("width over width, less its error", worst, MAX_WIDTH),
    ]
    return finish(options, PAGE, "fogs", surroundings(("spisim", "mitsuba")), tables, checks)


@dataclass(frozen=True)
class Compared:
    """Light in another fog, from the paths of a pass and by passes of its own."""

    scene: str
    visibility_m: float
    image_z: float
    spots_z: float
    carried: float
    change: float

    @property
    def row(self) -> tuple[str, ...]:
        """Of the table."""
        return (
            self.scene,
            f"{self.visibility_m:g} m",
            f"{self.image_z:.2f}",
            f"{self.spots_z:.2f}",
            f"{self.carried:.0%}",
            f"{self.change:+.3f}",
        )


def compared(name: str) -> list[Compared]:
    """All other fogs of a scene."""
    rows = []
    weather = {"fog": {"visibility_m": TRACED_M}, "rain": None, "snow": None, "smoke": None}
    scene = spisim.load_scene(name, changes=weather)
    others = [OtherFog.of_visibility(scene, each) for each in OTHERS_M]
    passes = [
        solve_fogs(scene, INSTRUMENT, others, spp=SPP, seed=seed, outputs=ORDERS)
        for seed in range(SEEDS)
    ]
    here = np.mean([each[0].image.sum() for each in passes])
    for number, (visibility_m, other) in enumerate(zip(OTHERS_M, others, strict=True), start=1):
        through = [
            solve(other.scene, INSTRUMENT, spp=SPP, seed=100 + seed, outputs=ORDERS)
            for seed in range(SEEDS)
        ]
        from_here = [each[number] for each in passes]
        image_z, spots_z = (
            largest_z(*(np.array([of(each) for each in way]) for way in (from_here, through)))
            for of in (quadrants, near_and_far)
        )
        carried = min(each.reweighted.carried for each in from_here if each.reweighted)
        change = np.log(np.mean([each.image.sum() for each in from_here]) / here)
        rows.append(Compared(name, visibility_m, image_z, spots_z, carried, float(change)))
    return rows


def quadrants(light: Transport) -> Floats:
    """All light of the image, and that of its quadrants."""
    height, width = (side // 2 for side in light.image.shape)
    quarters = light.image[: 2 * height, : 2 * width].reshape(2, height, 2, width)
    return np.append(quarters.sum(axis=(1, 3)), light.image.sum())


def near_and_far(light: Transport) -> Floats:
    """The light of each spot, by its order of scattering, before and beyond 3 m of range."""
    near, spots = light.path_length_m < 6.0, light.extra["spot_orders"]
    return np.concatenate([spots[..., near].sum(-1).ravel(), spots[..., ~near].sum(-1).ravel()])


def largest_z(first: Floats, second: Floats) -> float:
    """Of the differences of two means over seeds (seeds, n), which rounding may make, too."""
    off, rounding = first - second, ROUNDING * np.abs(second.mean(axis=0))
    error = np.hypot(off.std(axis=0, ddof=1) / np.sqrt(len(off)), rounding)
    return float(np.abs(off.mean(axis=0)[error > 0] / error[error > 0]).max())


class TracingMaker(Maker):
    """Makes each sample from a pass through its own fog."""

    def _simulated(
        self, sample: Any, scene: Any, instrument: Any, options: Any, seconds: Any
    ) -> Any:
        return simulate(scene, instrument, **options), None


@dataclass(frozen=True)
class Both:
    """A study both ways."""

    scene: str
    rounds: int
    traced: float  # fraction of the fogs
    seconds: tuple[float, float]
    width: float
    width_error: float

    @property
    def row(self) -> tuple[str, ...]:
        """Of the table."""
        return (
            self.scene,
            str(self.rounds),
            f"{self.traced:.0%}",
            f"{self.seconds[0]:.0f}",
            f"{self.seconds[1]:.0f}",
            f"{self.width:.2f} ± {self.width_error:.2f}",
        )


def study(name: str, rounds: int) -> Both:
    """A study of one scene, all traced and reweighted."""
    planned = stated_plan(plan(name, rounds))
    fogs = len(VISIBILITIES_M)
    seconds, metrics, traced = [0.0, 0.0], [], 0
    with tempfile.TemporaryDirectory() as folder:
        makers = [kind(planned, Path(folder) / kind.__name__) for kind in (TracingMaker, Maker)]
        for index in range(fogs):  # kernels are compiled before the time is taken
            for maker in makers:
                maker(rounds * fogs + index)
        for round_ in range(rounds):
            values: list[list[Mapping[str, float | None]]] = [[], []]
            for which, maker in enumerate(makers):
                for index in range(round_ * fogs, (round_ + 1) * fogs):
                    begun_s = time.process_time()
                    outcome = maker(index)
                    seconds[which] += time.process_time() - begun_s
                    if outcome.file is None:
                        raise RuntimeError(outcome.error)
                    capture = read_capture(maker.folder / outcome.file)
                    values[which].append(evaluation_of(capture).metrics)
                    light = yaml.safe_load(capture.provenance.settings)["light"]
                    traced += which == 1 and "reweighted" not in light
            metrics.append([[[each[m] for m in METRICS] for each in way] for way in values])
    measured = np.array(metrics, np.float64)  # rounds, ways, fogs, metrics
    width, error = widths(measured)
    return Both(name, rounds, traced / (rounds * fogs), (seconds[0], seconds[1]), width, error)


def widths(measured: Floats) -> tuple[float, float]:
    """Ratio of interval widths, the second way's over the first's, and its bootstrap error."""

    def ratio(rounds: Sequence[int] | Floats) -> float:
        spread = measured[rounds].std(axis=0, ddof=1)  # ways, fogs, metrics
        usable = (spread > 0).all(axis=0)
        if not usable.any():  # the same round again and again
            return np.nan
        return float(np.exp(np.log(spread[1][usable] / spread[0][usable]).mean()))

    rng, count = np.random.default_rng(0), len(measured)
    again = [ratio(rng.integers(count, size=count)) for _ in range(RESAMPLED)]
    return ratio(np.arange(count)), float(np.nanstd(again))


def plan(name: str, rounds: int) -> dict[str, Any]:
    """A study's data set, with one more round to warm up."""
    turn = [{"uniform": [-3.0, 3.0]}, {"uniform": [-1.5, 1.5]}, {"uniform": [-3.0, 3.0]}]
    fogs = [{"kind": "moderate-radiation", "visibility_m": each} for each in VISIBILITIES_M]
    return {
        "name": f"fogs of {name}",
        "scenes": [{"scene": name}],
        "samples": (rounds + 1) * len(fogs),
        "seed": 1,
        "vary": {
            "scene.drone.offset_m": [{"uniform": [-0.1, 0.1]}] * 3,
            "scene.drone.turn_deg": turn,
            "scene.rain": None,
            "scene.snow": None,
            "scene.fog": {"grid": fogs},
        },
    }


INSTRUMENT = spisim.load_instrument("paper")

if __name__ == "__main__":
    sys.exit(main())
