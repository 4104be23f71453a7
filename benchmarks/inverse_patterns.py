"""Patterns trained through the instrument against named orders, on families that none has seen.

    python benchmarks/inverse_patterns.py [--quick] [--json] [--markdown] [--patterns FILE]

127 patterns of 64 x 64 pixels, 3 %, and their complements, displayed by the instrument `paper` with
its noise; the default image. Scenes are drawn anew, of every family that the manifest of the
patterns and the fitted orders have nothing of, from the drone's own view and one turned from it, in
clear air and in fog of 30 to 300 m. Orders are those that the same light is compared with; the best
of them is the one with the highest mean. Gains are the mean of the families' means, intervals are
by bootstrap over scenes. What was drawn stays in the folder.
"""

import json
import sys
import warnings
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray
from options import benchmark_options, finish

from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import capture_from_readings
from reconstruction.operators import PatternPlan, expose, make_plan
from reconstruction.operators.bases.dense import Dense
from spisim.instrument import Instrument, load_instrument
from spisim.scene import draw_scene
from spisim.scene.families import FAMILIES
from spisim.simulation.light import solve
from spisim.simulation.measurement.light import background_electrons, pixel_electrons
from spisim_paper.checks import Check, Table, surroundings

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "results" / "inverse.md"
FOLDER = HERE.parent / "out" / "inverse-patterns"
TRAINED = HERE / "trained_patterns.npy"
"""Bits (127, 512) of black and white patterns; the manifest lies beside them."""
SHAPE = (64, 64)
ORDERS = (
    *("sequency-2d", "variance-ranked", "cake-cutting", "product", "zig-zag", "radius"),
    "russian-dolls",
)
USUAL = "sequency-2d"
SEEDS = (3000, 3001)
SPP = {False: 20, True: 40}
"""Paths a pixel, in clear air and in fog."""
OFFSET_M, TURN_DEG = 0.2, (3.0, 8.0, 20.0)
VISIBILITY_M = (30.0, 300.0)
RESAMPLED = 2000
MIN_GAIN_DB = 0.3


@dataclass(frozen=True)
class Case:
    """Transport image of a scene, and the daylight beside it."""

    family: str
    seed: int
    image: Floats
    daylight_w: float


def main() -> int:
    """Compare and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(
        __doc__,
        "one scene of every family",
        PAGE,
        folder=FOLDER,
        others={"--patterns": {"type": Path, "default": TRAINED, "help": "bits to judge"}},
    )
    manifest = json.loads(options.patterns.with_suffix(".json").read_text())
    unseen = [name for name in FAMILIES if name not in manifest["families"]]
    seeds = SEEDS[:1] if options.quick else SEEDS
    cases = [case for name in unseen for case in drawn(options.folder, name, seeds)]
    plans = {name: make_plan(SHAPE, 127, name) for name in ORDERS}
    plans["trained"] = make_plan(SHAPE, None, "natural", basis=Dense(unpacked(options.patterns)))
    result = {name: psnr_db(plan, cases) for name, plan in plans.items()}
    scenes = Scenes(cases)
    best = max(ORDERS, key=lambda name: scenes.mean(result[name]))
    gains = {name: result["trained"] - result[name] for name in (USUAL, best)}
    tables = [of_patterns(scenes, result), by_family(scenes, unseen, gains)]
    checks = [
        Check(
            f"dB over {USUAL}", scenes.mean(gains[USUAL]), 0.0, True, scenes.interval(gains[USUAL])
        ),
        Check(
            f"dB over {best}, the best named order",
            scenes.mean(gains[best]),
            MIN_GAIN_DB,
            True,
            scenes.interval(gains[best]),
        ),
    ]
    return finish(options, PAGE, "inverse-patterns", surroundings(("spisim",)), tables, checks)


def of_patterns(scenes: "Scenes", result: dict[str, Floats]) -> Table:
    """PSNR of all patterns, best first."""
    ranked = sorted(result.items(), key=lambda one: -scenes.mean(one[1]))
    trained = result["trained"]
    return Table(
        "PSNR of the default image at 3 %, mean of families, dB; and the trained patterns' gain "
        "with its 95 % interval.",
        ("patterns", "PSNR", "trained over it"),
        [
            (name, f"{scenes.mean(each):.2f}", scenes.with_interval(trained - each))
            for name, each in ranked
        ],
    )


def by_family(scenes: "Scenes", families: list[str], gains: dict[str, Floats]) -> Table:
    """Gains over orders in every family, dB."""
    return Table(
        "The trained patterns' gain by family, dB.",
        ("family", "images", *(f"over {name}" for name in gains)),
        [
            (name, str(scenes.count(name)), *(f"{scenes.of(name, g):+.2f}" for g in gains.values()))
            for name in families
        ],
    )


def unpacked(file: Path) -> NDArray[np.uint8]:
    """Patterns (K, H, W) of 0 and 1."""
    bits = np.load(file)
    return np.unpackbits(bits, axis=1).reshape(len(bits), *SHAPE)


def drawn(folder: Path, family: str, seeds: tuple[int, ...]) -> Iterator[Case]:
    """Cases of a family, traced unless the folder has them."""
    folder.mkdir(parents=True, exist_ok=True)
    for seed in seeds:
        file = folder / f"{family}-{seed}.npz"
        if not file.exists():
            print(f"tracing {family} {seed}", file=sys.stderr)
            images, daylight = zip(*traced(family, seed), strict=True)
            np.savez(file, image=np.array(images, np.float32), daylight_w=np.array(daylight))
        held = np.load(file)
        for image, daylight_w in zip(held["image"], held["daylight_w"], strict=True):
            yield Case(family, seed, image.astype(np.float64), float(daylight_w))


def traced(family: str, seed: int) -> Iterator[tuple[Floats, float]]:
    """Image and daylight of every view and weather; views from within something are left out."""
    for view in range(2):
        for fog in (False, True):
            rng = np.random.default_rng([seed, view, len(family)])
            changes = _turned(rng) if view else {}
            if fog:
                visibility_m = float(np.exp(rng.uniform(*np.log(VISIBILITY_M))))
                changes["fog"] = {"kind": "moderate-radiation", "visibility_m": visibility_m}
            with warnings.catch_warnings():
                warnings.simplefilter("ignore")
                try:
                    scene = draw_scene(family, seed, changes=changes)
                    light = solve(scene, INSTRUMENT, spp=SPP[fog], seed=seed)
                except InputError:
                    continue
            yield light.image, light.daylight_w


def _turned(rng: np.random.Generator) -> dict[str, Any]:
    turn = [float(rng.uniform(-limit, limit)) for limit in TURN_DEG]
    return {"drone": {"turn_deg": turn, "offset_m": rng.uniform(-OFFSET_M, OFFSET_M, 3).tolist()}}


def psnr_db(plan: PatternPlan, cases: list[Case]) -> Floats:
    """Of the default image of every case (n,)."""
    reconstructor: Reconstructor | None = None
    result = []
    for number, case in enumerate(cases):
        truth = case.image * pixel_electrons(INSTRUMENT)
        capture = recorded(INSTRUMENT, plan, truth, case.daylight_w, number)
        if reconstructor is None:
            reconstructor = Reconstructor(capture.setup, ranging=(), depth=())
        image = reconstructor(capture.frame()).image.astype(np.float64)
        result.append(10 * np.log10(truth.max() ** 2 / np.mean((image - truth) ** 2)))
    return np.array(result)


def recorded(
    instrument: Instrument, plan: PatternPlan, truth: Floats, daylight_w: float, seed: int
) -> Any:
    """Capture of a plan's patterns on an image in electrons, with the detector's noise."""
    detector, time_s = instrument.imaging.detector, instrument.imaging.exposure_time_s
    electrons = expose(plan, truth) + background_electrons(instrument, daylight_w)
    readings = detector.read(electrons[None], time_s, np.random.default_rng(seed))
    capture = capture_from_readings(readings.counts, plan)
    return replace(capture, buckets=replace(capture.buckets, **readings.charge))


class Scenes:
    """Means over families, and intervals over the scenes of each."""

    def __init__(self, cases: list[Case]) -> None:
        self._family = np.array([case.family for case in cases])
        self._names = list(dict.fromkeys(self._family.tolist()))
        scenes = [(case.family, case.seed) for case in cases]
        self._scenes = [
            np.array([n for n, scene in enumerate(scenes) if scene == each])
            for each in dict.fromkeys(scenes)
        ]

    def count(self, family: str) -> int:
        """Images of a family."""
        return int((self._family == family).sum())

    def of(self, family: str, values: Floats) -> float:
        """Mean over the images (n,) of a family."""
        return float(values[self._family == family].mean())

    def mean(self, values: Floats) -> float:
        """Mean of the families' means."""
        return float(np.mean([self.of(name, values) for name in self._names]))

    def interval(self, values: Floats) -> Any:
        """Interval of the mean of scenes by confidence, by bootstrap over scenes."""
        scenes = np.array([values[each].mean() for each in self._scenes])
        rng = np.random.default_rng(0)
        means = scenes[rng.integers(len(scenes), size=(RESAMPLED, len(scenes)))].mean(axis=1)

        def interval(confidence: float) -> tuple[float, float]:
            outside = 50 * (1 - confidence)
            low, high = np.percentile(means, [outside, 100 - outside])
            return float(low), float(high)

        return interval

    def with_interval(self, values: Floats) -> str:
        """Mean with its 95 % interval, or a dash for no difference."""
        if not values.any():
            return "–"
        low, high = self.interval(values)(0.95)
        return f"{self.mean(values):+.2f} ({low:+.2f} to {high:+.2f})"


INSTRUMENT = load_instrument("paper")

if __name__ == "__main__":
    sys.exit(main())
