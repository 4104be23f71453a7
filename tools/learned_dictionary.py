"""Learn the dictionary `learned` of images from drawn scenes.

    python tools/learned_dictionary.py IMAGES.npz ... [--atoms 64] [--output FILE.npy]

of `tools/drawn_images.py`, in clear air and in fog. Squares of the images of the families `FITTED`,
at all scales, less their mean and in a window, are made as sparse as can be in atoms that are outer
products: the K-CPD algorithm (G. Duan, H. Wang, Z. Liu, J. Deng, Y.-W. Chen, Proc. ICPR (2012)
493), which is K-SVD (M. Aharon, M. Elad, A. Bruckstein, IEEE Trans. Signal Process. 54, 4311
(2006)) with atoms of rank one. They begin as cosines. Beside the atoms, `learned.json` tells what
they were learned from, and what share of the contrast of squares of the other families so few atoms
leave, beside as many cosines in the same window.
"""

import argparse
import hashlib
import json
from pathlib import Path

import numpy as np

from drawn_images import FITTED
from reconstruction.base.arrays import Floats
from reconstruction.image import batch_omp
from reconstruction.image.dictionaries import learned
from reconstruction.image.dictionaries.learned import SIDE, WINDOW

SCALES = (1, 2, 4, 8)
SQUARES = 40
"""Squares of each image at each scale, as far as there are."""
SPARSE = 4
"""Atoms of a square at most."""
ROUNDS = 40
TURNS = 3
"""Alternations in which one atom is found."""


def main() -> None:
    """Learn, and write atoms and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--atoms", type=int, default=64)
    parser.add_argument("--output", type=Path, default=learned.FILE)
    asked = parser.parse_args()
    reported = [np.load(file) for file in asked.images]
    images = np.concatenate([each["image"] for each in reported]).astype(np.float64)
    family = np.concatenate([each["family"] for each in reported])
    fitted = np.isin(family, FITTED)
    rng = np.random.default_rng(0)
    of_fitted, of_others = squares(images[fitted], rng), squares(images[~fitted], rng)
    first = cosines(asked.atoms)
    atoms = fit(first, of_fitted, rng)
    np.save(asked.output, atoms.astype(np.float32))
    manifest = {
        "images": {
            file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in asked.images
        },
        "families": sorted(set(family[fitted].tolist())),
        "seeds": sorted({int(seed) for each in reported for seed in each["seed"]}),
        "squares": len(of_fitted),
        "atoms": asked.atoms,
        "atoms_of_a_square": SPARSE,
        "left_of_fitted_families": {
            "learned": left(atoms, of_fitted),
            "cosines": left(first, of_fitted),
        },
        "left_of_other_families": {
            "learned": left(atoms, of_others),
            "cosines": left(first, of_others),
        },
    }
    text = json.dumps(manifest, indent=2)
    asked.output.with_suffix(".json").write_text(text + "\n")
    print(text)


def squares(images: Floats, rng: np.random.Generator) -> Floats:
    """Of images (n, H, W): squares (m, SIDE, SIDE) of all scales, of unit rms at each."""
    result = []
    contrasts = images - images.mean(axis=(1, 2), keepdims=True)
    contrasts /= contrasts.std(axis=(1, 2), keepdims=True)
    for scale in SCALES:
        height, width = (side // scale for side in contrasts.shape[1:])
        blocks = contrasts[:, : height * scale, : width * scale]
        means = blocks.reshape(-1, height, scale, width, scale).mean(axis=(2, 4))
        positions = [(r, c) for r in range(height - SIDE + 1) for c in range(width - SIDE + 1)]
        several = []
        for image in means:
            for at in rng.permutation(len(positions))[:SQUARES]:
                row, column = positions[at]
                square = image[row : row + SIDE, column : column + SIDE]
                several.append(square[:, :: rng.choice([-1, 1])])
        patches = np.array(several)
        patches = (patches - patches.mean(axis=(1, 2), keepdims=True)) * WINDOW[:, None] * WINDOW
        result.append(patches / np.sqrt(np.mean(patches**2)))
    return np.concatenate(result)


def cosines(atoms: int) -> Floats:
    """So many cosines (2, atoms, SIDE) of lowest frequency in the window."""
    frequency = np.arange(SIDE)
    waves = np.cos(np.pi * np.outer(frequency, np.arange(SIDE) + 0.5) / SIDE) * WINDOW
    waves /= np.linalg.norm(waves, axis=1, keepdims=True)
    down, along = np.divmod(np.arange(SIDE**2), SIDE)
    lowest = np.argsort(down**2 + along**2, kind="stable")[:atoms]
    return np.array([waves[down[lowest]], waves[along[lowest]]])


def fit(atoms: Floats, patches: Floats, rng: np.random.Generator) -> Floats:
    """The atoms (2, A, SIDE) after rounds of sparse coding and of one atom after the other."""
    atoms = atoms.copy()
    for _ in range(ROUNDS):
        codes = coded(atoms, patches)
        remainder = patches - np.einsum("na,ar,ac->nrc", codes, *atoms, optimize=True)
        for atom in rng.permutation(atoms.shape[1]):
            used = np.flatnonzero(codes[:, atom])
            if used.size < SIDE:  # a square that is told badly instead
                worst = np.argmax((remainder**2).sum(axis=(1, 2)))
                left, _, right = np.linalg.svd(remainder[worst])
                atoms[:, atom] = left[:, 0], right[0]
                continue
            down, along = atoms[:, atom]
            part = remainder[used] + codes[used, atom, None, None] * np.outer(down, along)
            for _ in range(TURNS):
                weights = np.einsum("nrc,r,c->n", part, down, along, optimize=True)
                weighed = np.tensordot(weights, part, axes=1)
                left, _, right = np.linalg.svd(weighed)
                down, along = left[:, 0], right[0]
            weights = np.einsum("nrc,r,c->n", part, down, along, optimize=True)
            atoms[:, atom] = down, along
            codes[used, atom] = weights
            remainder[used] = part - weights[:, None, None] * np.outer(down, along)
    return atoms


def coded(atoms: Floats, patches: Floats) -> Floats:
    """Coefficients (n, A) of patches, a few of each not zero."""
    flat = np.einsum("ar,ac->arc", *atoms).reshape(atoms.shape[1], -1)
    seen = patches.reshape(len(patches), -1)
    energy = (seen**2).sum(axis=1)
    return np.asarray(batch_omp(flat @ flat.T, seen @ flat.T, energy, max_atoms=SPARSE))


def left(atoms: Floats, patches: Floats) -> float:
    """Share of the power of patches that their few atoms leave."""
    reported = np.einsum("na,ar,ac->nrc", coded(atoms, patches), *atoms, optimize=True)
    return float(np.sum((patches - reported) ** 2) / np.sum(patches**2))


if __name__ == "__main__":
    main()
