"""Learn black and white patterns from drawn scenes, for an instrument's `patterns_file`.

    python tools/learned_patterns.py patterns.npy IMAGES.npz ... [--patterns 127]

of `tools/drawn_images.py`. The first is all on. Each further one has the signs of the image in
which scenes still vary most, once all before it are known; signs are then changed as long as that
catches more. How scenes vary is half the covariance of images of the families `FITTED`, half the
model of the order `variance-ranked`, to which the other half is too few. Beside the patterns,
`patterns.json` tells what they were learned from, and what share of contrast they hold of images of
the other families, beside as many Hadamard patterns.
"""

import argparse
import hashlib
import json
from pathlib import Path

import numpy as np
from scipy.sparse.linalg import eigsh

from drawn_images import FITTED
from reconstruction.base.arrays import Floats
from reconstruction.operators import make_plan
from reconstruction.operators.orders.variance_ranked import ALONG, DOWN

CHANGES = 5
"""Rounds of changing signs."""


def main() -> None:
    """Learn, and write patterns and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("patterns_file", type=Path)
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--patterns", type=int, default=127)
    asked = parser.parse_args()
    reported = [np.load(file) for file in asked.images]
    images = np.concatenate([each["image"] for each in reported]).astype(np.float64)
    family = np.concatenate([each["family"] for each in reported])
    shape = images.shape[1:]
    contrasts = images.reshape(len(images), -1)
    contrasts = contrasts - contrasts.mean(axis=1, keepdims=True)
    contrasts /= np.linalg.norm(contrasts, axis=1, keepdims=True)
    fitted = np.isin(family, FITTED)
    rows = learned(contrasts[fitted], shape, asked.patterns)
    np.save(asked.patterns_file, (rows.reshape(-1, *shape) > 0).astype(np.uint8))
    hadamard = make_plan(shape, asked.patterns, "variance-ranked", "signed")
    displayed = hadamard.patterns.matrix(hadamard.index)
    manifest = {
        "images": {
            file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in asked.images
        },
        "families": sorted(set(family[fitted])),
        "patterns": asked.patterns,
        "held_of_other_families": {
            "learned": held(rows, contrasts[~fitted]),
            "hadamard, variance-ranked": held(displayed, contrasts[~fitted]),
        },
    }
    text = json.dumps(manifest, indent=2)
    asked.patterns_file.with_suffix(".json").write_text(text + "\n")
    print(text)


def learned(contrasts: Floats, shape: tuple[int, int], patterns: int) -> Floats:
    """Rows of -1 and 1 (patterns, N), the first all on, from images less their mean (n, N)."""
    rng = np.random.default_rng(0)
    left = (contrasts.T @ contrasts / len(contrasts) + _model(shape)) / 2
    rows = [np.ones(left.shape[0])]
    start = rng.standard_normal(left.shape[0])
    for _ in range(patterns - 1):
        _, result = eigsh(left, k=1, tol=1e-3, v0=start)
        row = np.where(result[:, 0] >= 0, 1.0, -1.0)
        for _ in range(CHANGES):
            other = np.where(left @ row >= 0, 1.0, -1.0)
            if other @ left @ other <= row @ left @ row:
                break
            row = other
        seen = left @ row
        left -= np.outer(seen, seen) / (row @ seen)
        start = rng.standard_normal(len(row))
        rows.append(row)
    return np.array(rows)


def held(rows: Floats, contrasts: Floats) -> float:
    """Share of the power of images less their mean in the span of patterns, on average."""
    span, _ = np.linalg.qr(rows.T)
    return float(np.mean(np.sum((contrasts @ span) ** 2, axis=1)))


def _model(shape: tuple[int, int]) -> Floats:
    """Covariance of the order's model, without the level, of as much power as the images."""
    down, along = (
        np.exp(-np.abs(np.subtract.outer(pixels, pixels)) / (length * max(shape)))
        for pixels, length in zip(map(np.arange, shape), (DOWN, ALONG), strict=True)
    )
    whole = np.kron(down, along)
    whole -= whole.mean(axis=0)
    whole -= whole.mean(axis=1, keepdims=True)
    return np.asarray(whole / np.trace(whole))


if __name__ == "__main__":
    main()
