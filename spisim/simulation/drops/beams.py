"""What falling drops change about the light of the lasers.

Beams are Gaussian in angle and position. A drop of radius a, at a distance ρ from the axis of a
beam of standard deviation s, meets the fraction P(χ'² < a²/s²) of it, where χ'² is the noncentral
chi-square variable of two degrees of freedom centred on ρ²/s².
"""

from collections.abc import Callable, Sequence
from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray
from scipy.special import chndtr

from reconstruction.base.arrays import Floats
from spisim.simulation.drops.echo import echo
from spisim.simulation.drops.falling import FallingDrops
from spisim.simulation.drops.field import DropField

#: Standard deviations from the axis beyond which a beam is negligible.
MAX_SIGMAS = 6.0
#: Minimum standard deviation of a beam over a drop's radius: narrower beams meet it all or not.
MIN_WIDTH = 0.02
#: Points on an aperture whose field is narrow.
APERTURE_POINTS = 16


class SpotChange(NamedTuple):
    """Means over every frame, (frames, spots, bins) of the path length."""

    passed: Floats  # fraction of the light of that path length that drops let pass
    echo: Floats  # fraction of a laser's power that drops send onto its detector's aperture


class _Beam(NamedTuple):
    """Light along a line, out to the spot or back from it."""

    start_m: Floats  # (3,)
    direction: Floats  # (3,), unit
    length_m: float
    width_m: Callable[[Floats], Floats]  # standard deviation per axis, by distance from the start


class _Hits(NamedTuple):
    """Drops in a beam."""

    drop: NDArray[np.intp]
    along_m: Floats
    fraction: Floats  # of the beam that each drop meets


def on_spots(drops: Sequence[FallingDrops], path_length_m: Floats) -> SpotChange:
    """Change of the spots' light that drops cause.

    A drop blocks all light that travels beyond it. On the way back, that is the light of the
    laser's spot; light scattered by fog counts as coming back along with it. Footprint and aperture
    together count as Gaussian there.

    Parameters
    ----------
    drops
        One or more entries of one recording.
    path_length_m
        Bins (bins,) of the path length, m, ascending from 0.

    Returns
    -------
    SpotChange
        Fraction that passes, and fraction added by echoes, (frames, spots, bins).
    """
    times_s = drops[0].times_s
    passed = np.zeros((len(times_s), len(drops[0].view.beams.directions), len(path_length_m)))
    echoes = np.zeros_like(passed)
    for frame, times in enumerate(times_s):
        max_range_m = drops[0].spot_range_m(frame).tolist()
        beams = [_out_and_back(drops[0], *spot) for spot in enumerate(max_range_m)]
        fields = [_nearby(one, beams, frame) for one in drops]
        for time_s in times:
            for number, beam in enumerate(beams):
                changes = [
                    _at(one, field, time_s, beam, number, path_length_m)
                    for one, field in zip(drops, fields, strict=True)
                ]
                passed[frame, number] += np.exp(sum(hidden for hidden, _ in changes))
                echoes[frame, number] += sum(sent for _, sent in changes)
    exposures = times_s.shape[1]
    return SpotChange(passed / exposures, echoes / exposures)


def _nearby(drops: FallingDrops, beams: list[tuple[_Beam, _Beam]], frame: int) -> DropField:
    """The drops that may enter a beam during a frame."""
    field, middle, moved = drops.in_frame(frame)
    near = [_near(beam, middle, field.diameters_mm, moved) for pair in beams for beam in pair]
    return field.subset(np.any(near, axis=0))


def _at(
    drops: FallingDrops,
    field: DropField,
    time_s: float,
    beams: tuple[_Beam, _Beam],
    number: int,
    lengths: Floats,
) -> tuple[Floats, Floats]:
    """Logarithm (bins,) of the passing fraction of a laser's light, and its echo (bins,)."""
    positions, diameters = drops.at(field, time_s)
    out, back = (_hits(beam, positions, diameters) for beam in beams)
    light = echo(
        positions[out.drop],
        diameters[out.drop],
        drops.precipitation.optics,
        drops.view.tof,
        number,
        drops.fog_per_m,
        APERTURE_POINTS,
    )
    echoed = _binned(lengths, light.length_m, out.fraction * light.fraction)
    return _beyond(lengths, out) + _beyond(lengths, back), echoed


def _out_and_back(drops: FallingDrops, number: int, max_range_m: float) -> tuple[_Beam, _Beam]:
    """A laser's beam, and the cone from its spot to its detector."""
    lasers, tof = drops.view.beams, drops.view.tof
    direction = lasers.directions[number]

    def beam_width(along_m: Floats) -> Floats:
        return np.hypot(lasers.waist_m, lasers.divergence_rad * along_m)

    detector = tof.positions_m[number]
    home = direction * max_range_m - detector
    distance = float(np.linalg.norm(home))
    spot_width = beam_width(np.array(max_range_m))
    aperture_width = np.sqrt(tof.area_m2 / np.pi) / 2  # of a disc: half its radius

    def cone_width(along_m: Floats) -> Floats:
        part = along_m / distance
        return np.hypot(aperture_width * (1 - part), spot_width * part)

    return (
        _Beam(np.zeros(3), direction, max_range_m, beam_width),
        _Beam(detector, home / distance, distance, cone_width),
    )


def _near(beam: _Beam, positions: Floats, diameters: Floats, moved_m: float) -> NDArray[np.bool_]:
    """Which drops may enter a beam while they move by `moved_m`."""
    offset = positions - beam.start_m
    along = offset @ beam.direction
    aside2 = np.einsum("dk,dk->d", offset, offset) - along**2
    widest = beam.width_m(np.array([0.0, beam.length_m])).max()
    radius = diameters.max(initial=0.0) * 0.5e-3
    max_aside = radius * (1 + MAX_SIGMAS * MIN_WIDTH) + MAX_SIGMAS * widest
    return np.asarray(aside2 < (max_aside + moved_m) ** 2)


def _hits(beam: _Beam, positions: Floats, diameters: Floats) -> _Hits:
    """The drops in a beam."""
    radius = diameters * 0.5e-3
    offset = positions - beam.start_m
    along = offset @ beam.direction
    aside2 = np.einsum("dk,dk->d", offset, offset) - along**2
    inside = (along > 0) & (along < beam.length_m)
    width = np.maximum(beam.width_m(np.where(inside, along, 0.0)), MIN_WIDTH * radius)
    drop = np.flatnonzero(inside & (aside2 < (radius + MAX_SIGMAS * width) ** 2))
    scale = 1 / width[drop] ** 2
    fraction = chndtr(radius[drop] ** 2 * scale, 2, np.maximum(aside2[drop], 0) * scale)
    return _Hits(drop, along[drop], np.asarray(fraction))


def _beyond(lengths: Floats, hits: _Hits) -> Floats:
    """Logarithm (bins,) of the fraction that passes the drops, of light from beyond them."""
    first = np.searchsorted(lengths, 2 * hits.along_m)
    passed = np.log1p(-np.minimum(hits.fraction, 1 - 1e-12))
    within = first < len(lengths)
    return np.cumsum(np.bincount(first[within], passed[within], minlength=len(lengths)))


def _binned(lengths: Floats, at_m: Floats, light: Floats) -> Floats:
    """Light (n,) in bins (bins,), split between two so that its mean path length is exact."""
    count = len(lengths)
    low = np.clip(np.searchsorted(lengths, at_m, side="right") - 1, 0, count - 2)
    upper = np.minimum((at_m - lengths[low]) / (lengths[low + 1] - lengths[low]), 1)
    return np.asarray(
        np.bincount(low, light * (1 - upper), minlength=count)
        + np.bincount(low + 1, light * upper, minlength=count)
    )
