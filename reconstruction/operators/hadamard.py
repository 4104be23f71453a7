"""The natural-order (Sylvester) Hadamard matrix: fast transform, and sign changes of its rows."""

from typing import Any

import numpy as np
from numpy.typing import ArrayLike, NDArray

from ..base.errors import InputError
from .basis import Basis


def fwht(x: ArrayLike, axis: int = -1) -> NDArray[Any]:
    """Unnormalised fast Walsh-Hadamard transform in natural order along one axis, real or complex.

    The length of the axis must be a power of two (ValueError otherwise).
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
    """Sign changes along each row of the natural-order Hadamard matrix of this size, (size,)."""
    changes = np.zeros(size, dtype=np.int64)
    bits = size.bit_length() - 1
    rows = np.arange(size)
    binary = np.zeros(size, dtype=np.int64)
    for bit in range(bits):  # the row number, bit-reversed, is the Gray code of the sequency
        binary ^= (rows >> bit) & 1
        changes |= binary << (bits - 1 - bit)
    return changes


def power_of_two(size: int) -> bool:
    """Whether there is a Hadamard matrix of this size here."""
    return size > 0 and size & (size - 1) == 0


def require_hadamard(basis: Basis, order: str) -> None:
    """Raise InputError unless the basis is Hadamard's, of which alone an order speaks."""
    if basis.name != "hadamard":
        raise InputError(
            f"order {order!r} is one of Hadamard rows; the basis is {basis.name!r}: use natural"
        )
