"""Readings of Fourier patterns: grey cosines in phase steps, or complex coefficients.

Z. Zhang, X. Ma and J. Zhong, Nat. Commun. 6, 6225 (2015): the pattern of frequency numbers (v, h)
and phase step s of S is (1 + cos(2 pi (v y / H + h x / W) + 2 pi s / S)) / 2 in pixel (y, x).
"""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ...base.arrays import Floats
from ...base.errors import InputError
from ...operators import PatternPlan, checked_shape
from ...operators.bases.dense import Dense

MAX_VALUES = 2**26
"""Maximum pixels of all patterns together; each is stored."""
PHASE_STEPS = (3, 4)


def plan_from_phase_steps(
    frequencies: ArrayLike, shape: tuple[int, int], steps: int
) -> PatternPlan:
    """Plan of phase-stepped cosines.

    Raises InputError for fractional frequencies, other steps, or more than `MAX_VALUES` pixels.

    Parameters
    ----------
    frequencies : array, (K, 2)
        Whole cycles down and along the image.
    shape : tuple of int
        Rows and columns of the image.
    steps : int
        Phase steps of each frequency, 3 or 4; readings are (K, steps) in C order.
    """
    if steps not in PHASE_STEPS:
        raise InputError(f"{steps} phase steps; allowed: {', '.join(map(str, PHASE_STEPS))}")
    angles = _angles(frequencies, shape, steps)
    phases = 2 * np.pi * np.arange(steps) / steps
    cosines = np.cos(angles[:, None] + phases[:, None, None])
    return _plan(cosines.reshape(-1, *angles.shape[1:]), polarity=1)


def plan_from_coefficients(frequencies: ArrayLike, shape: tuple[int, int]) -> PatternPlan:
    """Plan of complex Fourier coefficients sum x exp(-i a): rows cos(a) and -sin(a) in turn.
    Raises InputError as `plan_from_phase_steps`.

    Parameters
    ----------
    frequencies : array, (K, 2)
        Whole cycles down and along the image.
    shape : tuple of int
        Rows and columns of the image.

    Returns
    -------
    PatternPlan
        Its readings (frames, 2 K) are the `parts` of coefficients (frames, K).
    """
    angles = _angles(frequencies, shape, 2)
    rows = np.stack([np.cos(angles), -np.sin(angles)], axis=1).reshape(-1, *angles.shape[1:])
    return _plan(rows, polarity=0)


def _plan(rows: Floats, polarity: int) -> PatternPlan:
    """Plan of signed patterns (M, H, W), each exposed once."""
    basis = Dense(np.clip((1 + rows) / 2, 0, 1))
    index = np.arange(basis.rows, dtype=np.int32)
    return PatternPlan(basis.shape, index, np.full(index.size, polarity, np.int8), patterns=basis)


def parts(coefficients: NDArray[Any]) -> Floats:
    """Interleave real and imaginary parts of coefficients (..., K) to (..., 2 K)."""
    both = np.stack([coefficients.real, coefficients.imag], axis=-1)
    return both.reshape(*coefficients.shape[:-1], -1)


def half_plane(spectrum: NDArray[Any]) -> tuple[NDArray[Any], NDArray[np.int64]]:
    """Coefficients of a whole spectrum without conjugates.

    Raises InputError if the largest coefficient is at neither index.

    Parameters
    ----------
    spectrum : complex array, (H, W)
        With its DC coefficient, the largest, first (`numpy.fft.fft2`) or central (`fftshift`).

    Returns
    -------
    coefficients : complex array, (K,)
    frequencies : array, (K, 2)
    """
    index = np.unravel_index(np.abs(spectrum).argmax(), spectrum.shape)
    height, width = spectrum.shape
    if index == (height // 2, width // 2):
        spectrum = np.fft.ifftshift(spectrum)
    elif index != (0, 0):
        raise InputError(
            f"the largest of the {height} x {width} complex readings, the DC coefficient, is at "
            f"{[int(n) for n in index]}, must be at [0, 0] or [{height // 2}, {width // 2}]; else "
            "give the frequencies"
        )
    down, along = np.divmod(np.arange(height * width), width)
    conjugate = -down % height * width + -along % width
    first = np.flatnonzero(np.arange(height * width) <= conjugate)
    return spectrum.ravel()[first], np.stack([down[first], along[first]], axis=1)


def _angles(frequencies: ArrayLike, shape: tuple[int, int], rows: int) -> Floats:
    """2 pi (v y / H + h x / W), (K, H, W)."""
    height, width = checked_shape(shape)
    numbers = np.asarray(frequencies, dtype=np.float64)
    if numbers.ndim == 2 and numbers.shape[1] != 2 and numbers.shape[0] == 2:
        numbers = numbers.T
    if numbers.ndim != 2 or numbers.shape[1] != 2 or not len(numbers):
        raise InputError(
            f"the frequencies have shape {numbers.shape}, must be (K, 2): down and along the image"
        )
    if (numbers != np.floor(numbers)).any() or np.abs(numbers).max() > max(height, width):
        raise InputError(
            "the frequencies must be whole numbers of cycles in the image, at most "
            f"{max(height, width)}"
        )
    if rows * len(numbers) * height * width > MAX_VALUES:
        raise InputError(
            f"{rows * len(numbers)} Fourier patterns of {height} x {width} pixels are more than "
            f"the {MAX_VALUES // (height * width)} that can be held"
        )
    y, x = np.arange(height)[:, None] / height, np.arange(width) / width
    vertical, horizontal = numbers.T[:, :, None, None]
    return np.asarray(2 * np.pi * (vertical * y + horizontal * x))
