"""A semi-transparent surface before another in single-photon pixels: both found, and how well.

The recording is that of photon-efficient-imaging/full-waveform; without a licence it is not
shipped. What it calls truth are means of photons in two gates: in an eighth of the pixels exactly
those of the photons recorded, the second less 100 bins. Noise, inter-reflections and a wall behind
the object are in these means, so they cannot judge an estimate to its bound. Halves of the photons
of a pixel can: both halves see the same surfaces, and the scatter between them needs no truth.

Errors are compared with the Cramér–Rao bound of a Gaussian pulse as wide as the response. The
response itself is a plateau with a sharp edge: its own bound is about half of that, and out of
reach of any estimate with so few photons, also of the posterior mean, which is the best that
follows a shift (simulated: 2.0 times the bound with 5 photons, 1.6 with 14, 1.2 with 60).
"""

from dataclasses import dataclass
from pathlib import Path

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.ranging.returns import Return, find_returns
from reconstruction.ranging.shape import PulseShape, gaussian_shape, sampled_shape

PHOTONS, TRUTH = "two_layer.mat", "two_layer_obj.mat"
FIRST_BIN, BINS = 3000, 4001
#: What the truth of either surface is less than the mean of its photons.
TRUTH_OFFSETS = 0.0, -100.0
MIN_PHOTONS = 5
#: Returns so near the truth are that surface.
NEAR_BINS = 150.0
#: The response in bins about the first surface, and its step; what is later is another reflection.
#: Photons within it about the truth are a surface's.
RESPONSE_BINS, RESPONSE_STEP = (-95.0, 80.0), 5.0
#: No photon hides another: pixels have a hundredth of a photon per pulse at most.
CYCLES = 10**6


@dataclass(frozen=True, eq=False)
class Surfaces:
    """Photon times of pixels, in bins, and the stated delay (pixels, 2) of both surfaces."""

    times: list[Floats]
    truth: Floats

    def near(self, pixel: int, surface: int) -> Floats:
        """Photons of a surface."""
        since = self.times[pixel] - self.truth[pixel, surface]
        within = (since > RESPONSE_BINS[0]) & (since < RESPONSE_BINS[1])
        return self.times[pixel][within]


def read_surfaces(folder: Path) -> Surfaces:
    """Pixels of a recording whose truth is known, by rows."""
    from scipy.io import loadmat

    for name in (PHOTONS, TRUTH):
        if not (folder / name).is_file():
            raise InputError(f"{folder / name}: no such file; full-waveform on GitHub has it")
    times = loadmat(folder / PHOTONS)["photon_times"].ravel()
    truth = loadmat(folder / TRUTH)
    both = np.stack([truth["T_first"].ravel(), truth["T_second"].ravel()], axis=1) - TRUTH_OFFSETS
    known = np.flatnonzero(np.isfinite(both).all(axis=1))
    return Surfaces([times[pixel].ravel().astype(np.float64) for pixel in known], both[known])


def response_of(surfaces: Surfaces, pixels: NDArray[np.int64]) -> PulseShape:
    """Response in bins, of the first surface of some pixels, about its own mean delay."""
    middle = np.median(surfaces.truth[:, 0])
    edges = np.arange(RESPONSE_BINS[0], RESPONSE_BINS[1] + 1, RESPONSE_STEP)
    since = np.concatenate([surfaces.times[pixel] - middle for pixel in pixels])
    counts = np.histogram(since, edges)[0].astype(np.float64)
    at = (edges[1:] + edges[:-1]) / 2
    rates = np.maximum(counts - counts[0], 0)
    return sampled_shape(at - rates @ at / rates.sum(), rates)


def as_wide(shape: PulseShape) -> PulseShape:
    """A Gaussian of the standard deviation of a shape."""
    bins = np.arange(np.floor(shape.first), np.ceil(shape.last) + 1)
    part = shape.in_bins(np.zeros(()), bins)
    part = part / part.sum()
    return gaussian_shape(float(np.sqrt(part @ bins**2 - (part @ bins) ** 2)))


def bound(shape: PulseShape, photons: float, background: float) -> float:
    """Cramér–Rao bound of a delay, in bins: amplitude and background known.

    `photons` of the pulse on so many of the background per bin.
    """
    bins = np.arange(np.floor(shape.first) - 2, np.ceil(shape.last) + 3)
    early, late = shape.in_bins(np.array([-0.5, 0.5]), bins)
    mean = photons * (early + late) / 2 + background
    return float(1 / np.sqrt(np.sum((photons * (late - early)) ** 2 / np.maximum(mean, 1e-9))))


def decoded(times: Floats, shape: PulseShape) -> tuple[list[Return], float]:
    """Returns in bins, and background photons per bin."""
    counts = np.bincount((times - FIRST_BIN).astype(int), minlength=BINS).astype(np.float64)
    returns, background = find_returns(counts, CYCLES, shape)
    moved = [each._replace(delay=each.delay + FIRST_BIN) for each in returns]
    return moved, CYCLES * background


def nearest(returns: list[Return], delay: float) -> Return | None:
    """The strongest return of a surface; returns come by strength."""
    return next((each for each in returns if abs(each.delay - delay) < NEAR_BINS), None)


@dataclass(frozen=True, eq=False)
class SurfaceErrors:
    """Of pixels in which both surfaces have enough photons; errors in bins, nan if not found."""

    error: Floats
    """(pixels, 2): from what is called truth."""
    bound: Floats
    """(pixels, 2): of a Gaussian pulse as wide."""
    own_bound: Floats
    """(pixels, 2): of the response itself."""
    halves: Floats
    """(pixels, 2): difference between halves of the photons."""
    halves_bound: Floats
    """(pixels, 2): bound of that difference."""
    halves_sigma: Floats
    """(pixels, 2): its standard deviation, as the returns state it."""


def surface_errors(surfaces: Surfaces, step: int = 1) -> SurfaceErrors:
    """Errors in every second pixel, or fewer; the response is that of the pixels between."""
    shape = response_of(surfaces, np.arange(0, len(surfaces.times), 2))
    rows = []
    for pixel in range(1, len(surfaces.times), 2 * step):
        near = [surfaces.near(pixel, surface) for surface in (0, 1)]
        if min(map(len, near)) >= MIN_PHOTONS:
            rows.append(_errors_of(surfaces, pixel, near, shape))
    return SurfaceErrors(*np.moveaxis(np.array(rows), 1, 0))


def _errors_of(
    surfaces: Surfaces, pixel: int, near: list[Floats], shape: PulseShape
) -> list[list[float]]:
    times, truth, gaussian = surfaces.times[pixel], surfaces.truth[pixel], as_wide(shape)
    returns, background = decoded(times, shape)
    halves = [decoded(times[part::2], shape)[0] for part in (0, 1)]
    columns = []
    for surface in (0, 1):
        whole = nearest(returns, truth[surface])
        error = whole.delay - truth[surface] if whole else np.nan
        least, own = (bound(each, near[surface].size, background) for each in (gaussian, shape))
        difference, of_halves, sigma = np.nan, np.nan, np.nan
        # Which photons a surface has follows from the whole pixel: truth would prefer its own.
        parts = [nearest(half, whole.delay) if whole else None for half in halves]
        photons = min(whole.arrivals * CYCLES, near[surface].size) if whole else 0
        if photons >= 2 * MIN_PHOTONS and all(parts):
            difference = parts[0].delay - parts[1].delay
            sigma = float(np.hypot(*(each.sigma for each in parts)))
            counts = [each.arrivals * CYCLES for each in parts]
            of_halves = float(np.hypot(*(bound(gaussian, n, background / 2) for n in counts)))
        columns.append((error, least, own, difference, of_halves, sigma))
    return [list(column) for column in zip(*columns, strict=True)]
