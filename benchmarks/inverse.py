"""Derivatives of light by the fog: right, and what they cost.

    python benchmarks/inverse.py [--quick] [--json] [--markdown]

Shipped scenes in fog of 50 m. Derivatives by extinction and albedo are held against differences of
passes with the same random numbers, by z over seeds: total light, its quadrants, and the spots'
light. Times are of passes with and without weights, in turns, on one thread.
"""

import sys
import time
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
from options import benchmark_options, finish

import spisim
from reconstruction.base.arrays import Floats
from spisim.scene import Scene
from spisim.simulation.light import Transport, solve
from spisim.simulation.light.other_fog import OtherFog
from spisim.simulation.light.sensitivity import sensitivities, weights_of
from spisim.transport import Outputs
from spisim.transport.backend import use_threads
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "inverse.md"
SCENES = ("target-plane", "warehouse", "reflective-shelf", "street-canyon")
VISIBILITY_M = 50.0
STEPS = {"by_extinction": 0.02, "by_albedo": 0.005}
"""Of the logarithm."""
SAME = 1e-4
"""Relative difference that steps in single precision, and their curvature, may make: where the same
paths carry both ends, as by albedo, there is no other."""
SPP, SEEDS = 64, 8
ALBEDO = 0.95
"""Of the fog: water's is 1 within a thousandth, and leaves no room for a step up."""
MAX_Z, MAX_COST = 4.0, 1.5
COSTS = 5


@dataclass(frozen=True)
class Compared:
    """Largest |z| of a figure in a scene, and the total's relative derivative."""

    scene: str
    figure: str
    z: float
    size: float


def main() -> int:
    """Compare and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "the first scene alone", PAGE)
    use_threads(1)
    names = SCENES[:1] if options.quick else SCENES
    compared = [each for name in names for each in compare(name)]
    costs = [cost(name) for name in names]
    tables = [
        Table(
            f"Largest |z| over {SEEDS} seeds, {SPP} paths a pixel and end: derivatives against "
            "finite differences; and the derivative of all light.",
            ("scene", "figure", "largest z", "∂ ln f"),
            [(c.scene, c.figure, f"{c.z:.2f}", f"{c.size:+.3f}") for c in compared],
        ),
        Table(
            "Time of a pass with ten weights over one without, in turns.",
            ("scene", "ratio"),
            [(name, f"{ratio:.2f}") for name, ratio in zip(names, costs, strict=True)],
        ),
    ]
    checks = [Check("largest |z|", max(c.z for c in compared), MAX_Z)]
    checks.append(Check("time with ten weights over none", max(costs), MAX_COST))
    return finish(options, PAGE, "inverse", surroundings(("spisim", "mitsuba")), tables, checks)


def foggy(name: str, factor: float = 1.0, albedo: float = ALBEDO) -> Scene:
    """A shipped scene in fog alone, of so many times the extinction of 50 m of visibility."""
    weather = {"fog": {"visibility_m": VISIBILITY_M}, "rain": None, "snow": None, "smoke": None}
    scene = spisim.load_scene(name, changes=weather)
    air = scene.atmosphere
    fog = replace(air, extinction_per_m=air.extinction_per_m * factor, albedo=albedo)
    return replace(scene, atmosphere=fog)


def compare(name: str) -> Iterator[Compared]:
    """All figures of a scene."""
    here = foggy(name)
    by_sigma, by_albedo = sensitivities(here, ["scene.fog.extinction_per_m", "scene.fog.albedo"])
    weights = weights_of([by_sigma, by_albedo])
    passes = [traced(here, seed, weights) for seed in range(SEEDS)]
    totals = np.array([figures(each) for each in passes])
    for label, ending, field, start in (
        ("∂/∂ ln extinction", "by_extinction", "factor", 1.0),
        ("∂/∂ ln albedo", "by_albedo", "albedo", ALBEDO),
    ):
        step = STEPS[ending]
        changes = [{field: start * np.exp(sign * step)} for sign in (1, -1)]
        ends = [
            np.array([figures(traced(foggy(name, **each), seed)) for seed in range(SEEDS)])
            for each in changes
        ]
        found = np.array([figures(each, f"_{ending}") for each in passes])
        off = found - (ends[0] - ends[1]) / (2 * step)
        yield Compared(
            name,
            label,
            largest_z(off, SAME * np.abs(found.mean(axis=0))),
            found[:, 0].mean() / totals[:, 0].mean(),
        )


def traced(scene: Scene, seed: int, weights: Sequence[object] = ()) -> Transport:
    """One pass."""
    outputs = Outputs(weights=tuple(weights))  # type: ignore[arg-type]
    return solve(scene, INSTRUMENT, spp=SPP, seed=seed, outputs=outputs)


def figures(light: Transport, ending: str = "") -> Floats:
    """Quadrants of the image, and the light of each spot before and beyond 3 m of range."""
    image, spots = light.image, light.spot_histogram
    if ending:
        image, spots = light.extra[f"image{ending}"], light.extra[f"spot_histogram{ending}"]
    height, width = (side // 2 for side in image.shape)
    quarters = [
        image[rows, columns].sum()
        for rows in (slice(height), slice(height, None))
        for columns in (slice(width), slice(width, None))
    ]
    near = light.path_length_m < 6.0
    return np.array([image.sum(), *quarters, *spots[:, near].sum(1), *spots[:, ~near].sum(1)])


def largest_z(off: Floats, same: Floats | float = 0.0) -> float:
    """Of the means of differences (seeds, n), in which `same` may differ without meaning."""
    error = np.hypot(off.std(axis=0, ddof=1) / np.sqrt(len(off)), same)
    return float(np.abs(off.mean(axis=0)[error > 0] / error[error > 0]).max())


def cost(name: str) -> float:
    """Median time of a pass with ten weights over that of one without."""
    scene = foggy(name)
    wanted = sensitivities(scene, ["scene.fog.extinction_per_m", "scene.fog.albedo"])
    others = [OtherFog.of(scene, ratio) for ratio in (0.7, 0.85, 1.15, 1.3)]
    weights = (*weights_of(wanted), *(weight for each in others for weight in each.weights))
    assert len(weights) == 10
    seconds: list[list[float]] = [[], []]
    for turn in range(COSTS + 1):
        for which, some in enumerate(((), weights)):
            begun_s = time.process_time()
            traced(scene, turn, some)
            seconds[which].append(time.process_time() - begun_s)
    plain, weighted = (np.median(each[1:]) for each in seconds)
    return float(weighted / plain)


INSTRUMENT = spisim.load_instrument("paper")

if __name__ == "__main__":
    sys.exit(main())
