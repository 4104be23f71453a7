"""Dead leaves: images of things that hide each other, as many as one likes.

    python tools/dead_leaves.py leaves.npz [--images 1500]

writes transport images, as `tools/drawn_images.py` does, of as much light as scenes return.

Discs, rectangles and polygons of random sizes, greys, slopes and textures fall on each other
(A. B. Lee, D. Mumford, J. Huang, Int. J. Comput. Vision 41, 35 (2001)); sizes follow a power law,
so that the images are the same at every scale, as natural ones nearly are. What is learned from
them holds for photographs (R. Achddou, Y. Gousseau, S. Ladjal, SSVM 2021, LNCS 12679, 333).
"""

import argparse
from pathlib import Path

import numpy as np

from reconstruction.base.arrays import Floats

FINER = 2
"""Pixels drawn for one of the image, along either axis."""
LEAVES = (10, 400)
RADIUS = (0.02, 0.6)
"""Of the longer side; exponents of the power law are drawn from `EXPONENT`."""
EXPONENT = (1.2, 3.0)
GAMMA = (0.5, 3.0)
SHAPE = (64, 64)
RETURNED = (2e-10, 3e-9)
"""Mean transport of an image, between about the darkest and the brightest of drawn scenes."""
SEED = 77


def main() -> None:
    """Draw what the command line asks for."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("file", type=Path)
    parser.add_argument("--images", type=int, default=1500)
    asked = parser.parse_args()
    drawn = [dead_leaves(SHAPE, np.random.default_rng([SEED, n])) for n in range(asked.images)]
    images = np.array([image for image in drawn if image.mean() > 0])
    log_light = np.random.default_rng(SEED).uniform(*np.log(RETURNED), len(images))
    scale = np.exp(log_light) / images.mean(axis=(1, 2))
    np.savez_compressed(asked.file, image=(images * scale[:, None, None]).astype(np.float32))


def dead_leaves(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    """One image (H, W) from 0 to 1."""
    height, width = (FINER * side for side in shape)
    side = max(height, width)
    image = np.full((height, width), rng.random())
    count = int(np.exp(rng.uniform(*np.log(LEAVES))))
    textured = rng.random() * 0.3 * (rng.random() < 0.6)
    shaded = rng.random() * (rng.random() < 0.5)
    gamma = np.exp(rng.uniform(*np.log(GAMMA)))
    upright = rng.random() < 0.4
    for radius in _radii(count, rng) * side:
        _drop(image, radius, rng, (textured, shaded, gamma), upright=upright)
    if rng.random() < 0.3:
        image *= lamp_light((height, width), rng)
    fine = image.reshape(shape[0], FINER, shape[1], FINER)
    return np.asarray(fine.mean(axis=(1, 3)))


def _radii(count: int, rng: np.random.Generator) -> Floats:
    """Of a power law, mixed."""
    power = rng.uniform(*EXPONENT) - 1
    low, high = (radius**-power for radius in RADIUS)
    return np.asarray((low + rng.random(count) * (high - low)) ** (-1 / power))


def _drop(
    image: Floats,
    radius: float,
    rng: np.random.Generator,
    look: tuple[float, float, float],
    *,
    upright: bool,
) -> None:
    """One leaf."""
    height, width = image.shape
    row, column = rng.uniform(0, height), rng.uniform(0, width)
    top, left = max(0, int(row - radius)), max(0, int(column - radius))
    bottom, right = min(height, int(row + radius) + 2), min(width, int(column + radius) + 2)
    down = (np.arange(top, bottom) - row)[:, None] / radius
    along = (np.arange(left, right) - column)[None, :] / radius
    angle = 0.0 if upright else rng.uniform(0, np.pi)
    x = np.cos(angle) * along + np.sin(angle) * down
    y = np.cos(angle) * down - np.sin(angle) * along
    inside = _inside(x, y, rng)
    textured, shaded, gamma = look
    grey = rng.random() ** gamma
    value = grey * (1 + shaded * rng.uniform(-1, 1) * x)
    if textured:
        value = value + textured * grey * _texture(radius * x, radius * y, rng)
    part = image[top:bottom, left:right]
    part[inside] = np.clip(value, 0, 1.5)[inside]


def _inside(x: Floats, y: Floats, rng: np.random.Generator) -> Floats:
    """Where a leaf of radius 1 is."""
    kind = rng.integers(3)
    flat = np.exp(rng.uniform(np.log(0.05), 0))
    if kind == 0:
        return np.asarray(x**2 + (y / flat) ** 2 < 1)
    if kind == 1:
        return np.asarray((np.abs(x) < 0.9) & (np.abs(y) < 0.9 * flat))
    edges = 2 * np.pi * np.sort(rng.random(rng.integers(3, 7)))
    near = rng.uniform(0.2, 0.7, edges.size)
    inside = x**2 + y**2 < 1
    for turn, distance in zip(edges, near, strict=True):
        inside &= np.cos(turn) * x + np.sin(turn) * y < distance
    return inside


def _texture(x: Floats, y: Floats, rng: np.random.Generator) -> Floats:
    """Stripes or grain, of deviation about 1; ``x`` and ``y`` in drawn pixels."""
    if rng.random() < 0.5:
        turn, period = rng.uniform(0, np.pi), np.exp(rng.uniform(np.log(4), np.log(40)))
        return np.asarray(np.sin(2 * np.pi * (np.cos(turn) * x + np.sin(turn) * y) / period))
    return rng.standard_normal(np.broadcast_shapes(x.shape, y.shape))


def lamp_light(shape: tuple[int, int], rng: np.random.Generator) -> Floats:
    """A lamp's: bright in a place, dark far from it."""
    row, column, width = rng.random(), rng.random(), rng.uniform(0.3, 1.0)
    down, along = ((np.arange(side) + 0.5) / side for side in shape)
    return np.exp(-np.add.outer((down - row) ** 2, (along - column) ** 2) / (2 * width**2))


if __name__ == "__main__":
    main()
