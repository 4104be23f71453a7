"""Fit the covariance of the image method `fitted-covariance` to drawn scenes and dead leaves.

    python tools/fitted_covariance.py IMAGES.npz ... [--leaves 300]

of `tools/drawn_images.py`, families `FITTED` alone: the exponent and the strength of the axes at
which the cosines' mean power is likeliest (Whittle), scenes and leaves with the same weight.
Writes them, and what they were fitted to, into reconstruction/image/methods/fitted_covariance.json.
"""

import argparse
import hashlib
import json
from pathlib import Path

import numpy as np
from scipy.optimize import minimize

from dead_leaves import dead_leaves
from drawn_images import FITTED
from reconstruction.base.arrays import Floats
from reconstruction.image.dictionaries.dct import DICTIONARY
from reconstruction.image.methods.fitted_covariance import FITTED as FILE
from reconstruction.image.methods.fitted_covariance import axial_sigma

SEED = 3
HIGHEST = 0.5
"""Frequency that is looked at, cycles per two pixels: few patterns see what is finer."""


def main() -> None:
    """Fit, and write parameters and manifest."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("images", type=Path, nargs="+")
    parser.add_argument("--leaves", type=int, default=300)
    asked = parser.parse_args()
    reported = [np.load(file) for file in asked.images]
    images = np.concatenate([each["image"] for each in reported]).astype(np.float64)
    fitted = np.isin(np.concatenate([each["family"] for each in reported]), FITTED)
    shape = images.shape[1:]
    leaves = [dead_leaves(shape, np.random.default_rng([SEED, n])) for n in range(asked.leaves)]
    power = (mean_power(images[fitted]) + mean_power(np.array(leaves))) / 2
    exponent, axes = likeliest(power)
    manifest = {
        "exponent": round(exponent, 3),
        "axes": round(axes, 3),
        "images": {
            file.name: hashlib.sha256(file.read_bytes()).hexdigest() for file in asked.images
        },
        "families": list(FITTED),
        "leaves": asked.leaves,
    }
    text = json.dumps(manifest, indent=2)
    FILE.write_text(text + "\n")
    print(text)


def mean_power(images: Floats) -> Floats:
    """Of the cosines (H, W) of images (n, H, W), each less its mean and of rms 1."""
    contrasts = images - images.mean(axis=(1, 2), keepdims=True)
    contrasts = contrasts[contrasts.any(axis=(1, 2))]
    contrasts /= np.sqrt((contrasts**2).mean(axis=(1, 2), keepdims=True))
    vertical, horizontal = (DICTIONARY.atoms(side) for side in images.shape[1:])
    spectra = vertical.T @ contrasts @ horizontal
    return np.asarray((spectra**2).mean(axis=0))


def likeliest(power: Floats) -> tuple[float, float]:
    """Exponent and strength of the axes that explain a mean power (H, W) best."""
    height, width = power.shape
    frequency = np.hypot.outer(np.arange(height) / height, np.arange(width) / width)
    low = (frequency > 0) & (frequency < HIGHEST)

    def unlikely(values: Floats) -> float:
        variance = axial_sigma((height, width), *values)[low] ** 2
        ratio = power[low] / variance
        return float(np.log(variance).mean() + np.log(ratio.mean()))

    result = minimize(unlikely, [1.0, 0.0], method="Nelder-Mead").x
    return float(result[0]), float(result[1])


if __name__ == "__main__":
    main()
