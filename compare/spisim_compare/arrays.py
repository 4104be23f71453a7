"""Images and histograms without a capture: arrays in files of NumPy.

Floating-point numbers (H, W) are an image; its noise is estimated from the finest differences.
Whole numbers (spots, bins) are histograms of counts, whose noise is that of Poisson.
"""

from pathlib import Path
from typing import Any

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, naming
from reconstruction.base.npy import read_npy

from .causes import FACTOR, Cause
from .comparison import Comparison, grouped
from .gaussian import Covariance
from .histograms import STEADY_QUANTILE, joined_bins, names_of_bins
from .judging import Difference, judge

ENDING = ".npy"
MAX_BYTES = 2**30
MAD = 0.6745
"""Median absolute deviation of a normal distribution of unit variance."""
MIN_SIDE = 4
"""Minimum rows and columns of an image."""


def read_array(path: Path) -> NDArray[Any]:
    """Array of a file; raises InputError unless it has two axes and finite numbers."""
    with naming(path), path.open("rb") as file:
        array = read_npy(file, MAX_BYTES)
        if array.ndim != 2:
            raise InputError(
                f"an array of shape {array.shape}; allowed: an image (H, W) of floating-point "
                "numbers, or histograms (spots, bins) of whole numbers"
            )
        wrong = np.argwhere(~np.isfinite(array))
        if wrong.size:
            raise InputError(
                f"{array[tuple(wrong[0])]} at {tuple(wrong[0].tolist())}; must be a finite number"
            )
    return array


def compare_arrays(real: NDArray[Any], simulated: NDArray[Any]) -> Comparison:
    """Compare two images (H, W) or two sets of histograms (spots, bins).

    Raises InputError if they have different shapes or kinds of numbers, or for negative counts.
    """
    if real.shape != simulated.shape:
        raise InputError(
            f"the shape is {real.shape} in REAL, {simulated.shape} in SIMULATED; must be the same"
        )
    counts = [each.dtype.kind in "iu" for each in (real, simulated)]
    if counts[0] != counts[1]:
        whole = "REAL" if counts[0] else "SIMULATED"
        raise InputError(
            f"{whole} has whole numbers, which are counts of histograms, the other does not; "
            "save both as integers or both as floating-point numbers"
        )
    one, other = real.astype(np.float64), simulated.astype(np.float64)
    return _histograms(one, other) if counts[0] else _images(one, other)


def _images(real: Floats, simulated: Floats) -> Comparison:
    if min(real.shape) < MIN_SIDE:
        raise InputError(
            f"an image of shape {real.shape}; must have {MIN_SIDE} x {MIN_SIDE} pixels"
        )
    difference, middle = real - simulated, (real + simulated) / 2
    sigma = _fine_sigma(difference)
    if not sigma > 0:
        sigma = float(np.spacing(np.abs(middle).max() + 1.0))
    n, empty = middle.size, np.zeros((middle.size, 0))
    slopes = np.column_stack([each.ravel() for each in np.gradient(middle)])
    causes = [
        Cause("power", "power", (FACTOR,), middle.reshape(-1, 1), empty),
        Cause("offset", "offset", ("value",), np.ones((n, 1)), empty),
        Cause("pointing", "pointing", ("down_pixels", "right_pixels"), slopes, empty),
    ]
    noise = Covariance(np.full(n, sigma**2), empty)
    verdict = judge(Difference(difference.ravel(), noise, n), causes)
    rows, columns = real.shape
    names = [f"row {row}, column {column}" for row in range(rows) for column in range(columns)]
    pictures = {"real": real, "simulated": simulated, "real less simulated": difference}
    facts = {"image": f"{rows} × {columns} pixels", "noise of the difference": f"{sigma:.3g}"}
    group, z = np.zeros(n, np.intp), difference.ravel() / sigma
    groups = grouped(difference.ravel(), noise, group, ["pixels"])
    return Comparison(verdict, z, verdict.remainder, names, groups, group, pictures, "", facts)


def _fine_sigma(difference: Floats) -> float:
    """Standard deviation of independent noise, from second differences along both axes."""
    mixed = np.diff(np.diff(difference, axis=0), axis=1)  # variance 4 of the noise's
    return float(np.median(np.abs(mixed - np.median(mixed))) / MAD / 2)


def _histograms(real: Floats, simulated: Floats) -> Comparison:
    for name, counts in (("REAL", real), ("SIMULATED", simulated)):
        if counts.min() < 0:
            raise InputError(f"{name}: {counts.min():g} counts in a bin; must not be negative")
    bins = [joined_bins(each) for each in real + simulated]
    one, other = (
        np.concatenate([np.bincount(g, each) for g, each in zip(bins, some, strict=True)])
        for some in (real, simulated)
    )
    widths = np.concatenate([np.bincount(g) for g in bins]).astype(np.float64)
    spot = np.repeat(np.arange(len(bins)), [g.max() + 1 for g in bins])
    middle = (one + other) / 2
    steady = np.zeros_like(middle)
    for k in range(len(bins)):
        own = spot == k
        steady[own] = widths[own] * np.quantile(middle[own] / widths[own], STEADY_QUANTILE)
    empty = np.zeros((middle.size, 0))
    causes = [
        Cause("power", "power", (FACTOR,), (middle - steady)[:, None], empty),
        Cause("background", "background", ("counts per bin",), widths[:, None], empty),
    ]
    noise = Covariance(np.maximum(one + other, 1.0), empty)
    verdict = judge(Difference(one - other, noise, 0), causes)
    names = names_of_bins(bins)
    facts = {"histograms": f"{len(bins)} of {real.shape[1]} bins"}
    z = (one - other) / np.sqrt(noise.variance)
    groups = grouped(one - other, noise, spot, [f"spot {k}" for k in range(len(bins))])
    return Comparison(verdict, z, verdict.remainder, names, groups, spot, facts=facts)
