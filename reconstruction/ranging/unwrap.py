"""Path length from phases at one or several modulation frequencies.

A phase determines the path up to a multiple of its wavelength c / f. Of all multiples within the
unambiguous range of all phases, the one is chosen whose paths agree best in weighted least squares,
by exhaustive search (D. Droeschel, D. Holz, S. Behnke, "Multi-frequency phase unwrapping for
time-of-flight cameras", IROS 2010; M. Hansard et al., "Time-of-Flight Cameras", Springer 2012, ch.
2).
"""

from functools import lru_cache

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.constants import c
from .ranges import MIN_SIGNAL

PHASE_ERROR_RAD = 0.05
"""Systematic phase error besides noise: harmonics, echoes of fog."""
MAX_PATH_M = 20_000.0
"""Maximum path considered with several frequencies; no drone laser shows anything beyond."""
RESOLVED = 1e-9, 1e9
"""Bounds of the phases' standard deviations, which are infinite without signal."""
TRIED_AT_A_TIME = 2**20
"""Phases times wraps per batch, which bounds the memory."""


def path_from_phases(
    phases: Floats, sigmas: Floats, frequencies_hz: Floats
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """Path length from phases 2 pi f L / c.

    A path is ambiguous if the frequencies contradict each other or agree nearly as well on another
    path, to MIN_SIGNAL standard deviations of noise and PHASE_ERROR_RAD together, or if it is
    within MIN_SIGNAL of its own sigmas of 0 or of where all phases repeat.

    Parameters
    ----------
    phases, sigmas : array, (J, ...)
        Phases and their standard deviations.
    frequencies_hz : array, (J,)
        Distinct modulation frequencies.

    Returns
    -------
    path_m, sigma_m, ambiguous : array, (...,)
        Path length, its standard deviation, and whether it is ambiguous.
    """
    limit_m = unambiguous_path_m(frequencies_hz)
    if frequencies_hz.size == 1:
        return _of_one(phases[0], sigmas[0], limit_m)
    wraps = int(np.ceil(limit_m * frequencies_hz.max() / c - 1e-9))
    rows = phases.reshape(len(phases), -1), sigmas.reshape(len(phases), -1)
    step = max(1, TRIED_AT_A_TIME // (wraps * len(phases)))
    parts = [
        _of_some(
            rows[0][:, start : start + step],
            rows[1][:, start : start + step],
            frequencies_hz,
            limit_m,
            wraps,
        )
        for start in range(0, rows[0].shape[1], step)
    ]
    path, sigma, ambiguous = (
        np.concatenate(each).reshape(phases.shape[1:]) for each in zip(*parts, strict=True)
    )
    return path, sigma, ambiguous


def _of_one(
    phases: Floats, sigmas: Floats, limit_m: float
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """`path_from_phases` of a single frequency."""
    metres_per_radian = limit_m / (2 * np.pi)
    path = np.mod(phases, 2 * np.pi) * metres_per_radian
    sigma = np.clip(sigmas, *RESOLVED) * metres_per_radian
    return path, sigma, _repeated(path, sigma, limit_m)


def _repeated(path: Floats, sigma: Floats, limit_m: float) -> NDArray[np.bool_]:
    """Where a path is as compatible with 0 as with the repetition of all phases."""
    return np.asarray(np.abs(path - limit_m / 2) > limit_m / 2 - MIN_SIGNAL * sigma)


def _of_some(
    phases: Floats, sigmas: Floats, frequencies_hz: Floats, limit_m: float, wraps: int
) -> tuple[Floats, Floats, NDArray[np.bool_]]:
    """`path_from_phases` of phases (J, n) with so many wraps of the highest frequency."""
    metres_per_radian = (c / (2 * np.pi * frequencies_hz))[:, None]
    finest = int(np.argmax(frequencies_hz))
    turns = 2 * np.pi * np.arange(wraps)[:, None]
    candidates = (np.mod(phases[finest], 2 * np.pi) + turns) * metres_per_radian[finest]

    off = phases[:, None] - candidates / metres_per_radian[:, None]
    off = (np.mod(off + np.pi, 2 * np.pi) - np.pi) * metres_per_radian[:, None]  # (J, wraps, ...)
    sigmas = np.clip(sigmas, *RESOLVED)
    trusted = 1 / ((sigmas**2 + PHASE_ERROR_RAD**2) * metres_per_radian**2)
    precise = 1 / (sigmas * metres_per_radian) ** 2
    mean = (trusted[:, None] * off).sum(axis=0) / trusted.sum(axis=0)
    misfit = (trusted[:, None] * (off - mean) ** 2).sum(axis=0)
    misfit = np.where(candidates <= limit_m * (1 + 1e-9), misfit, np.inf)

    best = misfit.argmin(axis=0)[None]
    minimum, *others = np.sort(misfit, axis=0)[:2]
    contradicted = minimum > MIN_SIGNAL**2 * max(frequencies_hz.size - 1, 1)
    rivalled = np.any([other - minimum < MIN_SIGNAL**2 for other in others], axis=0)
    path = np.take_along_axis(candidates, best, axis=0)[0]
    correction = np.take_along_axis(off, best[None], axis=1)[:, 0]
    total = precise.sum(axis=0)
    path = path + (precise * correction).sum(axis=0) / total
    sigma = 1 / np.sqrt(total)
    return path, sigma, contradicted | rivalled | _repeated(path, sigma, limit_m)


def unambiguous_path_m(frequencies_hz: Floats) -> float:
    """Path length in metres at which the phases of all frequencies repeat.

    That is c / f of a single frequency. For several it is the first multiple of the shortest
    wavelength at which no phase differs by more than `path_from_phases` resolves, at most
    MAX_PATH_M.
    """
    return _repeated_after_m(tuple(np.unique(frequencies_hz).tolist()))


@lru_cache(maxsize=16)  # the same for all frames of a recording
def _repeated_after_m(frequencies_hz: tuple[float, ...]) -> float:
    shortest = c / max(frequencies_hz)
    max_difference = MIN_SIGNAL * np.sqrt(2) * PHASE_ERROR_RAD / (2 * np.pi)
    paths = shortest * np.arange(1, int(MAX_PATH_M / shortest) + 2)
    cycles = np.multiply.outer(paths, np.array(frequencies_hz) / c)
    repeats = np.abs(cycles - np.round(cycles)).max(axis=1) < max_difference
    return float(paths[repeats.argmax()]) if repeats.any() else MAX_PATH_M
