"""Natural-order (Sylvester) Hadamard matrices: fast transform and sequency."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import InputError
from .basis import Basis


def fwht(x: ArrayLike, axis: int = -1) -> NDArray[Any]:
    """Unnormalised fast Walsh-Hadamard transform in natural order.

    Parameters
    ----------
    x
        Real or complex array; its length along ``axis`` must be a power of two.
    axis
        Axis to transform.

    Returns
    -------
    ndarray
        Transform of the same shape, in double precision.

    Raises
    ------
    ValueError
        If the length is not a power of two.
    """
    values = np.moveaxis(np.asarray(x), axis, -1)
    values = values.astype(np.result_type(values, np.float64))
    size = values.shape[-1]
    if not power_of_two(size):
        raise ValueError(f"length {size} is not a power of two")
    half = 1
    while half < size:
        pairs = values.reshape(*values.shape[:-1], -1, 2, half)
        first, second = pairs[..., 0, :], pairs[..., 1, :]
        values = np.stack([first + second, first - second], axis=-2).reshape(values.shape)
        half *= 2
    return np.moveaxis(values, -1, axis)


def sequency(size: int) -> NDArray[np.int64]:
    """Sign changes along each row of the natural-order Hadamard matrix, (size,)."""
    changes = np.zeros(size, dtype=np.int64)
    bits = size.bit_length() - 1
    rows = np.arange(size)
    binary = np.zeros(size, dtype=np.int64)
    for bit in range(bits):  # the bit-reversed row index is the Gray code of the sequency
        binary ^= (rows >> bit) & 1
        changes |= binary << (bits - 1 - bit)
    return changes


def power_of_two(size: int) -> bool:
    """Whether a Sylvester Hadamard matrix of this size exists."""
    return size > 0 and size & (size - 1) == 0


def require_hadamard(basis: Basis, order: str) -> None:
    """Raise InputError unless the basis is Hadamard's, which this order requires."""
    if basis.name != "hadamard":
        raise InputError(
            f"order {order!r} requires the Hadamard basis, not {basis.name!r}: use natural"
        )
