"""Low-discrepancy random numbers: padded, Owen-scrambled Sobol points.

Each dimension, or pair of dimensions, is a Sobol (0, 2)-sequence with its own order and scrambling
(Burley, "Practical hash-based Owen scrambling", JCGT 9(4), 2020). Each number is uniform, so
estimates stay unbiased, and independent streams have independent errors. Such points pay off where
the integrand is smooth and depends on few numbers. The scrambling is only as random as its hash.
"""

from dataclasses import dataclass, replace
from typing import Self

import drjit as dr
import mitsuba as mi

from spisim.transport.jit import Bool, Float, Point2, UInt

#: Steps of Pascal's matrix modulo 2, which turns the first Sobol dimension into the second.
_PASCAL = ((1, 0x55555555), (2, 0x33333333), (4, 0x0F0F0F0F), (8, 0x00FF00FF), (16, 0x0000FFFF))
_GOLDEN = 0x9E3779B9


@dataclass
class Points:
    """One point per lane; takes the place of a Mitsuba sampler."""

    number: UInt  # of the lane's point in its sequence, bits reversed
    stream: UInt
    dimension: UInt

    @classmethod
    def of(cls, number: UInt, sequence: UInt, seed: UInt) -> Self:
        """Point `number` of the lane's `sequence`; sequences and seeds are independent."""
        return cls(dr.brev(mi.UInt32(number)), _mix(sequence ^ _mix(seed)), mi.UInt32(0))

    def again(self) -> Self:
        """A copy that repeats the numbers from here on."""
        return replace(self, dimension=mi.UInt32(self.dimension))

    def next_1d(self, active: Bool = True) -> Float:
        """A number in [0, 1)."""
        key = self._next_key()
        return _unit(_scrambled(_shuffled(self.number, key), _mix(key + 1)))

    def next_2d(self, active: Bool = True) -> Point2:
        """A point of the unit square."""
        key = self._next_key()
        first = _shuffled(self.number, key)
        second = first
        for shift, mask in _PASCAL:
            second = second ^ ((second & mask) << shift)
        return mi.Point2f(
            _unit(_scrambled(first, _mix(key + 1))), _unit(_scrambled(second, _mix(key + 2)))
        )

    def _next_key(self) -> UInt:
        self.dimension += 1
        return _mix(self.stream + self.dimension * _GOLDEN)


def _shuffled(bits: UInt, key: UInt) -> UInt:
    """Flip each bit by a hash of the bits below it (Laine and Karras)."""
    bits = bits ^ (bits * 0x3D20ADEA)
    bits = bits + key
    bits = bits * ((key >> 16) | 1)
    bits = bits ^ (bits * 0x05526C56)
    return bits ^ (bits * 0x53A22864)


def _scrambled(bits: UInt, key: UInt) -> UInt:
    """Owen scrambling: flip each bit by a hash of the bits above it."""
    return dr.brev(_shuffled(dr.brev(bits), key))


def _mix(bits: UInt) -> UInt:
    """Hash of 32 bits (Wellons' lowbias32)."""
    bits = bits ^ (bits >> 16)
    bits = bits * 0x21F0AAAD
    bits = bits ^ (bits >> 15)
    bits = bits * 0xD35A2D97
    return bits ^ (bits >> 15)


def _unit(bits: UInt) -> Float:
    return mi.Float(bits >> 8) * 2.0**-24
