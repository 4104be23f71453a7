"""Drops together with everything they stand between: instrument, surfaces, fog."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.atmosphere.precipitation import Precipitation
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.drops.field import DropField, drop_field
from spisim.transport.truth import GroundTruth
from spisim.transport.views import InstrumentView

#: Depth of what is never hit.
FAR_AWAY_M = 1e6
#: Beams to spots beyond this many times the depth up to which drops are followed, or to nothing,
#: end there: light comes back along nearly the same cone.
MAX_DEPTHS = 2.0


@dataclass(frozen=True, eq=False)
class FallingDrops:
    """The drops or the flakes of a recording, in the instrument's optical frame.

    `fog_per_m` is the extinction of the air between the drops; boxes of fog do not weaken their
    echo.
    """

    field: DropField
    precipitation: Precipitation
    instrument: Instrument
    view: InstrumentView  # in the optical frame
    depths_by_frame_m: Floats  # (T, H, W), of the surfaces; one of all frames, or each its own
    spot_ranges_by_frame_m: Floats  # (T, 4), nan for nothing
    fog_per_m: float
    times_s: Floats  # (frames, M), middle of every exposure

    def in_frame(self, frame: int) -> tuple[DropField, Floats, float]:
        """Drops of a frame, where they are in its middle, and how far any of them moves from there.

        Of all drops, those that come within the depths that are followed.
        """
        first, last = self.times_s[frame, [0, -1]]
        middle = (first + last) / 2
        field = self.field.full_at(middle)
        positions = field.positions_m(middle)
        moved = max(
            float(np.abs(field.positions_m(end) - positions).max(initial=0.0))
            for end in (first, last)
        )
        depth, (near, far) = positions[:, 2], self.depths_m
        near_enough = (depth > near - moved) & (depth < far + moved)
        return field.subset(near_enough), positions[near_enough], moved * np.sqrt(3)

    def depth_m(self, frame: int) -> Floats:
        """Depth (H, W) of the surfaces in a frame."""
        return np.asarray(self.depths_by_frame_m[min(frame, len(self.depths_by_frame_m) - 1)])

    def spot_range_m(self, frame: int) -> Floats:
        """Ranges (4,) of the spots in a frame, REACH at most."""
        ranges = self.spot_ranges_by_frame_m
        far_m = MAX_DEPTHS * self.precipitation.far_m
        return np.asarray(np.fmin(ranges[min(frame, len(ranges) - 1)], far_m))

    @property
    def depths_m(self) -> tuple[float, float]:
        """Nearest and farthest depth of a drop that matters."""
        far = min(self.precipitation.far_m, float(self.depths_by_frame_m.max()))
        return self.precipitation.near_m, far

    def at(self, field: DropField, time_s: float) -> tuple[Floats, Floats]:
        """Positions and diameters, at one time, of those of `field` that matter."""
        positions, (near, far) = field.positions_m(time_s), self.depths_m
        seen = (positions[:, 2] > near) & (positions[:, 2] < far)
        return positions[seen], field.diameters_mm[seen]


def falling_drops(
    scene: Scene,
    instrument: Instrument,
    truths: Sequence[GroundTruth],
    frames: int,
    rng: np.random.Generator,
) -> tuple[FallingDrops, ...]:
    """Draw the drops of a recording, one entry for each part of the scene's precipitation.

    `truths` are those of every frame, or one of all where nothing moves.
    """
    return tuple(
        FallingDrops(
            field=drop_field(precipitation, scene, instrument, frames, rng),
            precipitation=precipitation,
            instrument=instrument,
            view=InstrumentView.of(instrument, np.eye(4)),
            depths_by_frame_m=np.nan_to_num(
                np.array([truth.depth_m for truth in truths], np.float64), nan=FAR_AWAY_M
            ),
            spot_ranges_by_frame_m=np.array([truth.spot_range_m for truth in truths]),
            fog_per_m=scene.atmosphere.extinction_per_m,
            times_s=instrument.exposure_times_s(frames),
        )
        for precipitation in scene.precipitation
    )
