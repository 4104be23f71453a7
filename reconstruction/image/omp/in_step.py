"""Batch-OMP of all frames in lockstep, on any array library and device.

A step is a few large operations, which suits graphics processors. A frame that has ended, or whose
atom is linearly dependent, takes an empty column.
"""

from typing import Any

from array_api_compat import array_namespace, device

from .interpreted import DEPENDENT, NEGLIGIBLE

Array = Any


def pursue(
    gram: Array, correlation: Array, energy: Any, ridge: Any, tolerance: Any, max_atoms: int
) -> Array:
    """As `batch_omp`, for arrays that follow the Array API, version 2024.12."""
    xp = array_namespace(gram, correlation)
    frames = xp.reshape(correlation, (-1, gram.shape[0]))
    each = tuple(correlation.shape[:-1])

    def limit(value: Any) -> Array:
        number = xp.asarray(value, dtype=gram.dtype, device=device(gram))
        return xp.reshape(xp.broadcast_to(number, each), (-1,))

    result = pursue_frames(gram, frames, limit(energy), limit(ridge), limit(tolerance), max_atoms)
    return xp.reshape(result, correlation.shape)


def pursue_frames(
    gram: Array, correlation: Array, energy: Array, ridge: Array, tolerance: Array, maximum: int
) -> Array:
    """As `interpreted.pursue_frames`."""
    xp = array_namespace(gram, correlation)
    frames, atoms = correlation.shape
    there = {"device": device(gram)}
    every = xp.arange(atoms, **there)
    columns = xp.zeros((frames, maximum, atoms), dtype=gram.dtype, **there)
    free = xp.ones((frames, atoms), dtype=xp.bool, **there)
    taken = xp.zeros((frames,), dtype=xp.int64, **there)
    residual = correlation
    minimum = NEGLIGIBLE * xp.max(xp.abs(correlation), axis=1)
    picked: list[Array] = []
    pivots = xp.ones((frames, 0), dtype=gram.dtype, **there)
    fractions: list[Array] = []
    for step in range(atoms):
        size = xp.where(free, xp.abs(residual), xp.zeros_like(minimum)[:, None])
        going = (xp.max(size, axis=1) > minimum) & (energy > tolerance) & (taken < maximum)
        if not bool(xp.any(going)):
            break
        if step == columns.shape[1]:
            columns = xp.concat([columns, xp.zeros_like(columns)], axis=1)
        atom = xp.argmax(size, axis=1)
        at = every[None, :] == atom[:, None]
        free = free & ~at
        before = columns[:, :step, :]
        row = _picked(xp, before, atom) / pivots
        new = xp.take(gram, atom, axis=0)
        min_new = DEPENDENT * _picked(xp, new, atom)
        new = new - (row[:, None, :] @ before)[:, 0, :]
        pivot = _picked(xp, new, atom) + ridge
        going = going & (pivot > min_new)
        pivot = xp.where(going, pivot, xp.ones_like(pivot))
        new = xp.where(going[:, None], new, xp.zeros_like(new))
        best = _picked(xp, residual, atom)
        fraction = xp.where(going, best, xp.zeros_like(best)) / pivot
        residual = residual - fraction[:, None] * new
        energy = energy - xp.abs(fraction) ** 2 * pivot
        taken = taken + xp.astype(going, taken.dtype)
        columns[:, step, :] = new
        pivots = xp.concat([pivots, pivot[:, None]], axis=1)
        picked.append(at)
        fractions.append(fraction)
    result = xp.zeros_like(correlation)
    for step in reversed(range(len(fractions))):
        following = xp.sum(columns[:, step, :] * result, axis=1) / pivots[:, step]
        value = (fractions[step] - following)[:, None]
        result = result + xp.where(picked[step], value, xp.zeros_like(result))
    return result


def _picked(xp: Any, values: Array, atom: Array) -> Array:
    """For each frame, its ``values`` (F, ..., n) at its atom, (F, ...)."""
    indices = xp.reshape(atom, (-1, *[1] * (values.ndim - 1)))
    indices = xp.broadcast_to(indices, (*values.shape[:-1], 1))
    return xp.take_along_axis(values, indices, axis=-1)[..., 0]
