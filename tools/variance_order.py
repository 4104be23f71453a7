"""Fit the order `variance-ranked` to drawn scenes, and compare it with the others.

    python tools/variance_order.py IMAGES.npz ...

of `tools/drawn_images.py`. Correlation lengths are those with which the first patterns of the order
hold most of the contrast of images of the families `FITTED`, on average over numbers of patterns
and, with the same weight, families. The table is about the other families.
"""

import sys
from pathlib import Path

import numpy as np

from drawn_images import FITTED
from reconstruction.base.arrays import Floats
from reconstruction.operators import ORDERS, fwht, ordered_rows
from reconstruction.operators.bases.hadamard import Hadamard
from reconstruction.operators.orders.variance_ranked import ranked

FRACTIONS = (0.03, 0.06, 0.125)
"""Of all rows that are shown."""
LENGTHS = np.round(np.geomspace(0.05, 1.0, 14), 2)


def main(files: list[Path]) -> None:
    """Print the lengths that fit best, and shares of contrast by order and number of patterns."""
    reported = [np.load(file) for file in files]
    images = np.concatenate([each["image"] for each in reported]).astype(np.float64)
    family = np.concatenate([each["family"] for each in reported])
    basis = Hadamard(images.shape[1:])
    power = fwht(images.reshape(len(images), -1)) ** 2
    power[:, 0] = 0
    power /= power.sum(axis=1, keepdims=True)
    fitted, others = (
        np.mean([power[family == name].mean(axis=0) for name in names], axis=0)
        for names in (FITTED, sorted(set(family) - set(FITTED)))
    )
    grid = [(down, along) for down in LENGTHS for along in LENGTHS]
    best = max(grid, key=lambda lengths: np.mean(held(fitted, ranked(basis, *lengths))))
    print(f"{len(images)} images; DOWN, ALONG = {best[0]}, {best[1]}")
    orders = {name: ordered_rows(basis, name) for name in ORDERS if name != "random"}
    orders |= {
        "variance-ranked": ranked(basis, *best),
        "random:1": ordered_rows(basis, "random:1"),
        "best of the families fitted": np.argsort(-fitted),
        "best of the other families": np.argsort(-others),
    }
    for name, rows in sorted(orders.items(), key=lambda item: -held(others, item[1])[0]):
        print(f"| {name} | {' | '.join(f'{fraction:.3f}' for fraction in held(others, rows))} |")


def held(power: Floats, rows: np.ndarray) -> list[float]:
    """Share of the contrast that the first rows other than the level hold, by their number."""
    displayed = np.cumsum(power[rows[rows != 0]])
    return [float(displayed[round(fraction * power.size) - 2]) for fraction in FRACTIONS]


if __name__ == "__main__":
    main([Path(name) for name in sys.argv[1:]])
