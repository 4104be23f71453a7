"""A bounding volume hierarchy of two levels, for few rays and points among many triangles.

Neighbouring triangles form blocks. The bounds of all blocks are tested at once, then the triangles
of the blocks that may matter.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from spisim.scene.rays import PAIRS, hits

#: Triangles in a block.
BLOCK = 128
#: Bits per coordinate of a Morton code, and octaves of triangle size below the scene's extent.
BITS, OCTAVES = 16, 12


@dataclass(frozen=True, eq=False)
class Blocks:
    """Triangles (n, BLOCK, 3, 3), padded with the last one, and the bounds (n, 3) of each block."""

    triangles: Floats
    low: Floats
    high: Floats

    @classmethod
    def of(cls, triangles: Floats) -> Blocks:
        """Blocks of triangles (t, 3, 3), t > 0, grouped by size and Morton order."""
        triangles = triangles[np.argsort(_keys(triangles), kind="stable")]
        lacking = -len(triangles) % BLOCK
        whole = np.concatenate([triangles, np.repeat(triangles[-1:], lacking, axis=0)])
        blocks = whole.reshape(-1, BLOCK, 3, 3)
        return cls(blocks, blocks.min(axis=(1, 2)), blocks.max(axis=(1, 2)))

    def first_hits(self, origin: Floats, rays: Floats) -> Floats:
        """Distance (n,) along each ray (n, 3) to the first hit, in ray lengths; inf if none."""
        result = np.full(len(rays), np.inf)
        enter, leave = self._crossed(origin, rays)
        enter = np.where(enter <= leave, enter, np.inf)
        for some in _pieces(np.argsort(enter, axis=1)):
            near = np.take_along_axis(enter, some, axis=1) < result[:, None]
            if not near.any():
                break
            ray, block = np.nonzero(near)[0], some[near]
            for pair in np.array_split(np.arange(len(ray)), -(-len(ray) * BLOCK // PAIRS)):
                met = hits(origin, rays[ray[pair], None], self.triangles[block[pair]])
                np.minimum.at(result, ray[pair], met.min(axis=1))
        return result

    def distance(self, point: Floats) -> float:
        """Distance, m, from a point (3,) to the nearest triangle."""
        outside = np.maximum(0.0, np.maximum(self.low - point, point - self.high))
        minimum = np.linalg.norm(outside, axis=1)
        result = np.inf
        for some in _pieces(np.argsort(minimum)):
            if minimum[some[0]] >= result:
                break
            near = self.triangles[some[minimum[some] < result]].reshape(-1, 3, 3)
            result = min(result, distance(point, near))
        return result

    def _crossed(self, origin: Floats, rays: Floats) -> tuple[Floats, Floats]:
        """Where each ray (n, 3) enters, or 0 within, and leaves the bounds of each block."""
        rays = rays[:, None] + 0.0  # no negative zeros
        with np.errstate(divide="ignore", invalid="ignore"):
            one, other = (self.low - origin) / rays, (self.high - origin) / rays
        # 0/0: the ray runs in a face of the bounds
        enter = np.fmin(one, other).max(axis=2, where=~np.isnan(one), initial=0.0)
        leave = np.fmax(one, other).min(axis=2, where=~np.isnan(other), initial=np.inf)
        return enter, leave


def distance(point: Floats, triangles: Floats) -> float:
    """Distance, m, from a point (3,) to the nearest point of triangles (t, 3, 3)."""
    a, b, c = np.moveaxis(triangles, 1, 0)
    edges = min(_from_segments(point, *ends).min() for ends in ((a, b), (b, c), (c, a)))
    normal = np.cross(b - a, c - a)
    length = np.linalg.norm(normal, axis=1)
    flat = length > 0
    a, b, c = a[flat], b[flat], c[flat]
    normal = normal[flat] / length[flat, None]
    inside = np.ones(len(a), bool)
    for start, stop in ((a, b), (b, c), (c, a)):
        inside &= np.einsum("tk,tk->t", np.cross(stop - start, point - start), normal) >= 0
    heights = np.abs(np.einsum("tk,tk->t", point - a, normal))[inside]
    return float(min(edges, heights.min(initial=np.inf)))


def _from_segments(point: Floats, start: Floats, stop: Floats) -> Floats:
    along = stop - start
    length2 = np.einsum("tk,tk->t", along, along)
    where = np.einsum("tk,tk->t", point - start, along) / np.where(length2 > 0, length2, 1.0)
    closest = start + np.clip(where, 0, 1)[:, None] * along
    return np.asarray(np.linalg.norm(point - closest, axis=1))


def _pieces(order: NDArray[np.int64]) -> list[NDArray[np.int64]]:
    """Block indices (..., n) in growing pieces: most queries end with the first."""
    return [piece for piece in np.split(order, [2, 8, 32, 128, 512], axis=-1) if piece.size]


def _keys(triangles: Floats) -> NDArray[np.int64]:
    """Octave of each triangle's size, then its Morton code: a large one would inflate a block."""
    low, high = triangles.min(axis=1), triangles.max(axis=1)
    start = low.min(axis=0)
    extent = float((high.max(axis=0) - start).max()) or 1.0
    size = (high - low).max(axis=1) / extent
    octave = np.clip(-np.log2(np.maximum(size, 2.0**-OCTAVES)), 0, OCTAVES).astype(np.int64)
    positions = ((low + high) / 2 - start) / extent * (2**BITS - 1)
    spread = _spread(positions.astype(np.int64))
    return (octave << (3 * BITS)) | spread[:, 0] | (spread[:, 1] << 1) | (spread[:, 2] << 2)


def _spread(values: NDArray[np.int64]) -> NDArray[np.int64]:
    """Spread the bits of numbers three apart."""
    for shift, mask in (
        (16, 0xFF0000FF),
        (8, 0xF00F00F00F),
        (4, 0xC30C30C30C3),
        (2, 0x249249249249),
    ):
        values = (values | (values << shift)) & mask
    return values
