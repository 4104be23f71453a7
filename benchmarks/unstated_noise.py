"""What it costs not to state the noise: images with the noise stated, and estimated.

    python benchmarks/unstated_noise.py [--quick] [--json]

White noise of a given size over the rms of the coefficients is added to what signed patterns read
of the measured car, of drawn scenes that nothing was fitted to, and of characters, which few
patterns hardly tell from noise. A row is the mean over images of one kind, order, number of
patterns and noise.
"""

import sys
from collections.abc import Iterator
from functools import cache
from pathlib import Path

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from options import benchmark_options, finish

from reconstruction.base.arrays import Floats
from reconstruction.image import Imaging
from reconstruction.operators import decoder_for, expose, make_plan
from spisim.instrument import load_instrument
from spisim.scene import draw_scene
from spisim.simulation import simulate
from spisim_paper.checks import Check, Table, surroundings

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "results" / "images.md"
CAR = HERE.parent / "tests" / "data" / "car_buckets_201.npy"
METHOD = "edge-preserving"
CHARACTERS = "AGSψ5K"
FAMILIES = ("targets", "rubble", "tunnel", "facade", "bridge", "landing-pad", "stairwell")
"""Families that nothing was fitted to."""
QUICK_FAMILIES = 1
REALISATIONS = 8
"""Of the noise that is added to the one measured image."""
SEED = 7100
SAMPLED = (
    *((None, 0.03125), (None, 0.125), ("natural", 0.03125)),
    *(("natural", 0.125), ("random:3", 0.125)),
)
"""Order of the patterns, and how many over pixels."""
NOISES = (0.0, 0.1, 0.3, 1.0)
"""Over the rms of the coefficients other than the level."""
NEXT_TO_NONE = 1e-3
MAX_LOST_DB, MAX_OVER_SIGMA = 1.0, 2.0

Row = tuple[str, str, float, float]
Figures = tuple[float, float, float]
"""Loss, dB, and error over sigma with the noise estimated and stated."""


def main() -> int:
    """Table and checks."""
    options = benchmark_options(__doc__, "fewer scenes and numbers of patterns", PAGE)
    result = rows(options.quick)
    packages = ("spisim", "numpy")
    return finish(
        options, PAGE, "unstated noise", surroundings(packages), [table(result)], checks(result)
    )


def unstated_noise_checks(quick: bool) -> Iterator[Check]:
    """What is promised where the noise is not stated."""
    yield from checks(rows(quick))


def checks(result: dict[Row, Figures]) -> list[Check]:
    """Of the worst rows."""
    lost, over_sigma, _ = np.array(list(result.values())).T
    return [
        Check("dB lost by not stating the noise, worst row", float(lost.max()), MAX_LOST_DB),
        Check(
            "error over sigma where the noise is not stated, worst row",
            float(over_sigma.max()),
            MAX_OVER_SIGMA,
        ),
    ]


def rows(quick: bool) -> dict[Row, Figures]:
    """Mean figures of every row."""
    result = {}
    for kind, images in kinds(quick).items():
        for order, fraction in SAMPLED[: 3 if quick else None]:
            for noise in NOISES:
                each = [
                    figures(image, order, fraction, noise, seed)
                    for seed, image in enumerate(images)
                ]
                mean = np.mean(each, axis=0)
                result[kind, order or "usual", fraction, noise] = tuple(mean.tolist())
    return result


def kinds(quick: bool) -> dict[str, list[Floats]]:
    """Images of the rows."""
    scenes = [drawn(family) for family in FAMILIES[: QUICK_FAMILIES if quick else None]]
    return {
        "measured car": [car()] * REALISATIONS,
        "scenes": scenes,
        "characters, 32 × 32": [written(each, 32) for each in CHARACTERS],
        "characters, 64 × 64": [written(each, 64) for each in CHARACTERS],
    }


def car() -> Floats:
    """Image of all patterns of the recording, whose level is not known."""
    operator = decoder_for(make_plan((32, 32), order="natural", polarity="signed")).operator
    image = operator.min_norm(np.load(CAR).astype(np.float64))
    return np.asarray(image - image.min())


def drawn(family: str) -> Floats:
    """Image of a drawn scene."""
    scene, instrument = draw_scene(family, SEED), load_instrument("paper")
    truth = simulate(scene, instrument, light="surrogate", seed=SEED).capture.truth
    assert truth is not None
    return np.asarray(truth.at(0).image, np.float64)


def written(character: str, side: int) -> Floats:
    """A bright character on a dark ground."""
    figure = Figure(figsize=(1, 1), dpi=256)
    figure.text(0.5, 0.5, character, fontsize=40, ha="center", va="center")
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    grey = 1 - np.asarray(canvas.buffer_rgba())[..., 0] / 255
    block = 256 // side
    return np.asarray(grey.reshape(side, block, side, block).mean(axis=(1, 3)))


@cache
def usable(shape: tuple[int, int], order: str | None, fraction: float) -> tuple:
    """Plan and compiled methods."""
    plan = make_plan(shape, round(fraction * shape[0] * shape[1]), order, "signed")
    return plan, Imaging(plan).of(np.ones(plan.exposures, dtype=bool))


def figures(image: Floats, order: str | None, fraction: float, noise: float, seed: int) -> Figures:
    """Of one image; its level does not count."""
    plan, compiled = usable(image.shape, order, fraction)
    light = expose(plan, image)
    varying = compiled.decoder.operator.varying
    sigma = max(noise, NEXT_TO_NONE) * float(np.sqrt(np.mean(light[varying] ** 2)))
    rng = np.random.default_rng([seed, plan.exposures, round(10 * noise)])
    readings = light + sigma * rng.standard_normal(light.shape)
    errors, ratios = [], []
    for variance in (np.nan, sigma**2):
        coefficients = compiled.decode(readings, np.full(light.shape, variance))
        estimate = compiled.solver(METHOD)(coefficients)
        errors.append(float(np.std(estimate.image - image)))
        ratios.append(errors[-1] / float(np.sqrt(np.mean(estimate.sigma**2))))
    return 20 * float(np.log10(errors[0] / errors[1])), *ratios


def table(result: dict[Row, Figures]) -> Table:
    """Rows of the same patterns on one line, by noise."""
    lines = dict.fromkeys(row[:3] for row in result)
    body = [
        (*line[:2], f"{100 * line[2]:.3g}", *cells_of([result[(*line, each)] for each in NOISES]))
        for line in lines
    ]
    columns = ("images", "order", "patterns, %", "dB lost", "error over sigma", "with it stated")
    noises = ", ".join(f"{each:g}" for each in NOISES)
    return Table(f"Images whose noise is not stated, by noise ({noises})", columns, body)


def cells_of(several: list[Figures]) -> list[str]:
    """Each of three figures at all noises."""
    return [" / ".join(f"{each:.2f}" for each in one) for one in zip(*several, strict=True)]


if __name__ == "__main__":
    sys.exit(main())
