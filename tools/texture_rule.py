"""What the red of a surface says about its reflectance at 1550 nm, from measured spectra.

    python tools/texture_rule.py FOLDER

FOLDER is `earthlib/data` of the package earthlib 1.1.0 (PyPI): 7261 spectra, 0.4 to 2.45 µm, of 27
kinds of surfaces, mostly measured. Every kind counts alike. Red is the mean from 600 to 690 nm with
sRGB's curve, as pictures hold it.
"""

import csv
import re
import sys
from collections import Counter
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from spisim_formats.library.textures import RULE

BANDS_NM = {"red": (600, 690), "green": (520, 590), "blue": (440, 500), "infrared": (1540, 1560)}

Values = NDArray[np.float64]


def main(folder: Path) -> None:
    """Print the best factors and what is left."""
    header = (folder / "spectra.sli.hdr").read_text()
    match = re.search(r"wavelength = {(.*?)}", header, re.DOTALL)
    assert match is not None
    wavelengths = 1000 * np.array([float(word) for word in match[1].split(",")])
    spectra = np.fromfile(folder / "spectra.sli", "<f4").reshape(-1, len(wavelengths))
    with (folder / "spectra.csv").open() as file:
        kinds = [tuple(row[f"LEVEL_{k}"] for k in (1, 2, 3, 4)) for row in csv.DictReader(file)]
    count = Counter(kinds)
    weights = np.array([1 / count[kind] for kind in kinds])
    red, green, blue, infrared = (
        spectra[:, (wavelengths >= low) & (wavelengths <= high)].mean(axis=1).astype(float)
        for low, high in BANDS_NM.values()
    )
    print(f"{len(kinds)} spectra of {len(count)} kinds")
    grey = 0.2126 * red + 0.7152 * green + 0.0722 * blue
    for name, values in {"red": red, "grey": grey}.items():
        seen = encoded(values)
        factor = (weights * seen * infrared).sum() / (weights * seen**2).sum()
        print(
            f"{factor:.2f} times {name} is best: {rms(infrared - factor * seen, weights):.3f} rms"
        )
    errors = np.abs(infrared - RULE * encoded(red))
    order = np.argsort(errors)
    fraction = np.cumsum(weights[order]) / weights.sum()
    within = [errors[order][np.searchsorted(fraction, level)] for level in (2 / 3, 0.95)]
    print(f"{RULE} times red: {rms(errors, weights):.3f} rms, two thirds within {within[0]:.2f}, "
          f"95 % within {within[1]:.2f}")  # fmt: skip
    spread = infrared - np.average(infrared, weights=weights)
    print(f"without a rule: {rms(spread, weights):.3f} rms")


def rms(errors: Values, weights: Values) -> float:
    """Root of the mean square."""
    return float(np.sqrt(np.average(errors**2, weights=weights)))


def encoded(linear: Values) -> Values:
    """With sRGB's curve."""
    curve = 1.055 * np.maximum(linear, 1e-9) ** (1 / 2.4) - 0.055
    return np.where(linear <= 0.0031308, 12.92 * linear, curve)


if __name__ == "__main__":
    main(Path(sys.argv[1]))
