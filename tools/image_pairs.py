"""Pairs of image and truth to learn from: what a method makes of readings of images one knows.

    python tools/image_pairs.py FOLDER [--chunks 0 200] [--images DRAWN.npz ...]

Each chunk is one set of patterns, of random order and number, and 48 images with noise of random
strength: half of them of the drawn scenes of `tools/drawn_images.py` (families `FITTED` alone,
cropped, turned and with another gamma), half dead leaves; all dead leaves where no file is named.
Some are behind a veil, as fog's.
"""

import argparse
from collections.abc import Iterator
from pathlib import Path

import numpy as np
from scipy.ndimage import zoom

from dead_leaves import dead_leaves, lamp_light
from drawn_images import FITTED
from reconstruction.base.arrays import Floats
from reconstruction.image.coefficients import Coefficients
from reconstruction.image.methods.edge_preserving import METHOD, EdgePreservingSolver
from reconstruction.image.network import NetworkInput
from reconstruction.operators import MeasurementOperator, decoder_for, make_plan

SEED = 5
PAIRS = 48
SHAPES = ((64, 64), (64, 64), (64, 64), (64, 64), (32, 32), (32, 64), (64, 32), (64, 16))
ORDERS = (
    *("sequency-2d", "sequency-2d", "sequency-2d", "natural", "sequency", "walsh-2d", "product"),
    *("radius", "zig-zag", "cake-cutting", "russian-dolls", "variance-ranked", "random:{}"),
)
FRACTION = 0.02, 0.3
SNR = 0.1, 1000.0
"""Rms of coefficients other than the level over that of noise."""
VEILED = 0.25
MISTOLD = 0.2
"""Fraction of recordings that state their noise wrong, by a factor of `FACTOR` or so."""
FACTOR = 1.3


def main() -> None:
    """Write what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("--chunks", type=int, nargs=2, default=(0, 200), metavar="N")
    parser.add_argument("--images", type=Path, nargs="*", default=())
    asked = parser.parse_args()
    scenes = drawn_scenes(asked.images)
    asked.folder.mkdir(parents=True, exist_ok=True)
    for chunk in range(*asked.chunks):
        rng = np.random.default_rng([SEED, chunk])
        result = list(pairs(rng, scenes))
        names = ("first", "better", "deviation", "share", "noise", "truth")
        columns = {
            name: np.array(values, np.float32)
            for name, values in zip(names, zip(*result, strict=True), strict=True)
        }
        part = asked.folder / f"{chunk:04}.part.npz"
        np.savez(part, **columns)
        part.rename(asked.folder / f"{chunk:04}.npz")


def drawn_scenes(files: list[Path]) -> list[Floats]:
    """Images (H, W) of the families to learn from."""
    result = []
    for file in files:
        archive = np.load(file)
        result += list(archive["image"][np.isin(archive["family"], FITTED)].astype(np.float64))
    return result


def pairs(rng: np.random.Generator, scenes: list[Floats]) -> Iterator[tuple[object, ...]]:
    """What `NetworkInput` is made of, and the truth (H, W), of one set of patterns."""
    shape = SHAPES[rng.integers(len(SHAPES))]
    fraction = np.exp(rng.uniform(*np.log(FRACTION)))
    order = ORDERS[rng.integers(len(ORDERS))].format(rng.integers(1000))
    plan = make_plan(shape, max(8, round(fraction * shape[0] * shape[1])), order)
    operator = decoder_for(plan).operator
    solver = METHOD.compile(operator)
    assert isinstance(solver, EdgePreservingSolver)
    left = PAIRS
    while left:
        image = one_of(scenes, shape, rng) if scenes and left % 2 else dead_leaves(shape, rng)
        if rng.random() < VEILED:
            image = (1 - (veil := rng.random())) * image + veil * lamp_light(shape, rng)
        truth = image - image.mean()
        if not truth.any():
            continue
        left -= 1
        coefficients = measured(operator, image, rng)
        start = solver.linear.posterior(coefficients)
        assert start is not None
        spectrum, variance = solver.followed(start, coefficients)
        field = solver.linear.model.field
        displayed = NetworkInput(
            field.image(start.mean),
            field.image(spectrum),
            np.sqrt(variance),
            operator.varying.sum() / operator.shape[1],
            float(np.median(start.noise)),
        )
        scale = 1 / displayed.contrast
        yield (
            scale * displayed.first,
            scale * displayed.better,
            scale * displayed.sigma,
            displayed.fraction,
            scale * displayed.noise,
            scale * truth,
        )


def measured(
    operator: MeasurementOperator, truth: Floats, rng: np.random.Generator
) -> Coefficients:
    """Coefficients of an image, with noise; the level has some, too."""
    values = operator.forward(truth)
    varying = operator.varying
    snr = np.exp(rng.uniform(*np.log(SNR)))
    noise = float(np.sqrt(np.mean(values[varying] ** 2))) / snr
    values = values + noise * rng.standard_normal(values.shape)
    reported = noise * (FACTOR ** rng.standard_normal() if rng.random() < MISTOLD else 1.0)
    return Coefficients(values, np.full(values.shape, reported))


def one_of(scenes: list[Floats], shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    """A part of a drawn image, (H, W) from 0 to 1, turned over or not."""
    image = scenes[rng.integers(len(scenes))]
    if rng.random() < 0.5:
        sides = [round(side * rng.uniform(0.5, 1)) for side in image.shape]
        top, left = (rng.integers(f - s + 1) for f, s in zip(image.shape, sides, strict=True))
        image = image[top : top + sides[0], left : left + sides[1]]
    if rng.random() < 0.5:
        image = image.T
    image = image[:: rng.choice([-1, 1]), :: rng.choice([-1, 1])]
    factors = [wanted / side for wanted, side in zip(shape, image.shape, strict=True)]
    if factors != [1.0, 1.0]:
        image = zoom(image, factors, order=1, grid_mode=True, mode="nearest")
    image = np.maximum(image, 0) / max(float(image.max()), 1e-30)
    if rng.random() < 0.5:
        image = image ** np.exp(rng.uniform(np.log(0.6), np.log(1.5)))
    return np.asarray(image)


if __name__ == "__main__":
    main()
