"""What falling drops change about the bucket readings."""

from collections.abc import Callable, Sequence
from typing import NamedTuple, Self

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.operators import illumination
from spisim.simulation.drops.discs import (
    Fractions,
    disc_points,
    on_the_way_back,
    on_the_way_out,
    passing,
)
from spisim.simulation.drops.echo import echo
from spisim.simulation.drops.falling import FallingDrops
from spisim.simulation.drops.field import DropField


class Interpolation(NamedTuple):
    """Linear interpolation of light in time, between keys at which it is known.

    Parameters
    ----------
    keys
        Indices (frames, M, k) of the keys that each of a frame's M times lies between.
    fractions
        Their weights (frames, M, k).
    """

    keys: NDArray[np.intp]
    fractions: Floats

    def until(self, frames: int) -> Self:
        """The interpolation of the first frames."""
        return self._replace(keys=self.keys[:frames], fractions=self.fractions[:frames])

    def means(self, values: Floats) -> Floats:
        """Means (frames, ...) over each frame's times of values (K, ...) at the keys."""
        flat = values.reshape(len(values), -1)
        times = self.keys.shape[1]
        means = np.empty((len(self.keys), flat.shape[1]))
        for frame, (keys, fractions) in enumerate(zip(self.keys, self.fractions, strict=True)):
            keys_used, indices = np.unique(keys, return_inverse=True)
            means[frame] = np.bincount(indices.ravel(), fractions.ravel()) / times @ flat[keys_used]
        return means.reshape(-1, *values.shape[1:])


def on_buckets(
    drops: Sequence[FallingDrops],
    pictures: Floats,
    between: Interpolation,
    electrons: Floats,
    response: Callable[[Floats], Floats],
) -> Floats:
    """Electrons that drops add to every exposure, or take from it.

    All light of a pixel counts as going straight to its surface and straight back, which neglects
    fog and interreflections. Drops are still during an exposure; rays out and back are blocked
    independently.

    Parameters
    ----------
    drops
        Entries of one recording, which block light independently of each other.
    pictures
        Electrons of each fully lit pixel without drops, (windows, keys, H, W).
    between
        The keys that every exposure lies between.
    electrons
        Electrons per exposure if all of a pixel's power were on the detector, (H, W).
    response
        Maps path lengths (n,), m, to the fraction that each window collects, (windows, n).

    Returns
    -------
    Floats
        Electrons (windows, frames, M).
    """
    changes = np.zeros((len(pictures), *between.keys.shape[:2]))
    if not drops:
        return changes
    instrument, times_s = drops[0].instrument, drops[0].times_s
    plans, dark = instrument.pattern_plans, instrument.imaging.projector.dark_level
    for frame in range(len(between.keys)):
        plan = plans[frame % len(plans)]
        fields = [_in_view(one, frame) for one in drops]
        for exposure, time_s in enumerate(times_s[frame]):
            lit = dark + (1 - dark) * illumination(plan, exposure).ravel().astype(np.float64)
            lit *= plan.factors[exposure]
            nearby = pictures[:, between.keys[frame, exposure]]
            picture = np.tensordot(nearby, between.fractions[frame, exposure], (1, 0))
            left = np.ones(lit.size)
            for one, field in zip(drops, fields, strict=True):
                passed, met, echoed = _at(one, field, time_s, one.depth_m(frame), response)
                left *= passed
                light_on_drops = (lit * electrons.ravel())[met.pixel] * met.fraction
                changes[:, frame, exposure] += echoed[:, met.point] @ light_on_drops
            changes[:, frame, exposure] += picture.reshape(len(pictures), -1) @ (lit * (left - 1))
    return changes


def _in_view(drops: FallingDrops, frame: int) -> DropField:
    """The drops that may be in some pixel's light, out or back, in a frame."""
    projector, bucket = drops.view.projector, drops.view.bucket
    field, positions, moved = drops.in_frame(frame)
    x, y, z = positions.T
    aside = np.abs(bucket.positions_m[:, :2]).max() + np.sqrt(bucket.area_m2 / np.pi)
    widest = max(aside, projector.lens_radius_m) + field.diameters_mm.max(initial=0.0) * 1e-3
    seen = np.abs(x) < projector.tan_half_width * (z + moved) + widest + moved
    seen &= np.abs(y) < projector.tan_half_height * (z + moved) + widest + moved
    return field.subset(seen)


def _at(
    drops: FallingDrops,
    field: DropField,
    time_s: float,
    depth_m: Floats,
    response: Callable[[Floats], Floats],
) -> tuple[Floats, Fractions, Floats]:
    """Passing fraction of pixels' light, fractions on drops, and echoes (windows, points)."""
    projector, bucket = drops.view.projector, drops.view.bucket
    positions, diameters = drops.at(field, time_s)
    pixel_rad = float(np.sqrt(projector.pixel_area))  # in the middle of the field
    points = disc_points(positions, diameters, _blur_m(drops, positions[:, 2]), pixel_rad)
    out = on_the_way_out(projector, depth_m, points)
    passed_out = passing(out, points, projector.pixels)
    back, collected = [], []
    for number in range(len(bucket.positions_m)):
        fractions = on_the_way_back(projector, bucket, number, depth_m, points)
        back.append(passing(fractions, points, projector.pixels))
        fraction, length_m = echo(
            points.position_m,
            diameters[points.drop],
            drops.precipitation.optics,
            bucket,
            number,
            drops.fog_per_m,
        )
        collected.append(fraction * response(length_m))
    return passed_out * np.mean(back, axis=0), out, np.sum(collected, axis=0)


def _blur_m(drops: FallingDrops, depth_m: Floats) -> Floats:
    """Width over which lens or aperture blur a drop's shadow."""
    projector = drops.view.projector
    lens = projector.lens_radius_m * np.abs(1 - depth_m / projector.focus_m)
    return np.asarray(2 * np.maximum(lens, np.sqrt(drops.view.bucket.area_m2 / np.pi)))
