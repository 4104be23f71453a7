"""Drops together with everything they stand between: instrument, surfaces, fog."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from spisim.atmosphere.precipitation import Precipitation
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport.drops.field import DropField, drop_field
from spisim.transport.truth import GroundTruth
from spisim.transport.views import InstrumentView

Floats = NDArray[np.float64]

#: Depth of what is never hit.
FAR_AWAY_M = 1e6


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
    depth_m: Floats  # (H, W), of the surfaces
    spot_range_m: Floats  # (4,)
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
        kept = (depth > near - moved) & (depth < far + moved)
        return field.kept(kept), positions[kept], moved * np.sqrt(3)

    @property
    def depths_m(self) -> tuple[float, float]:
        """Nearest and farthest depth of a drop that matters."""
        far = min(self.precipitation.far_m, float(self.depth_m.max()))
        return self.precipitation.near_m, far

    def at(self, field: DropField, time_s: float) -> tuple[Floats, Floats]:
        """Positions and diameters, at one time, of those of `field` that matter."""
        positions, (near, far) = field.positions_m(time_s), self.depths_m
        seen = (positions[:, 2] > near) & (positions[:, 2] < far)
        return positions[seen], field.diameters_mm[seen]


def falling_drops(
    scene: Scene,
    instrument: Instrument,
    truth: GroundTruth,
    frames: int,
    rng: np.random.Generator,
) -> tuple[FallingDrops, ...]:
    """Draw the drops of a recording, one entry for each part of the scene's precipitation."""
    return tuple(
        FallingDrops(
            field=drop_field(precipitation, scene, instrument, frames, rng),
            precipitation=precipitation,
            instrument=instrument,
            view=InstrumentView.of(instrument, np.eye(4)),
            depth_m=np.nan_to_num(truth.depth_m.astype(np.float64), nan=FAR_AWAY_M),
            spot_range_m=truth.spot_range_m,
            fog_per_m=scene.atmosphere.extinction_per_m,
            times_s=instrument.exposure_times_s(frames),
        )
        for precipitation in scene.precipitation
    )
