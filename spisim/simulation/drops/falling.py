"""Drops together with everything around them: instrument, surfaces, fog."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.atmosphere.precipitation import Precipitation
from spisim.instrument import Instrument
from spisim.instrument.views import InstrumentView
from spisim.scene import Scene
from spisim.simulation.drops.field import DropField, drop_field
from spisim.transport.truth import GroundTruth

#: Depth where there is no surface.
FAR_AWAY_M = 1e6
#: Beams end at this multiple of the maximum depth of drops, even if their spot is farther or
#: missing: light comes back along nearly the same cone.
MAX_DEPTHS = 2.0


@dataclass(frozen=True, eq=False)
class FallingDrops:
    """The drops or the flakes of a recording, in the instrument's optical frame.

    Parameters
    ----------
    field
        Positions and motion of the drops.
    precipitation
        What the drops are, and between which depths they matter.
    instrument, view
        The instrument, and its ends in the optical frame.
    depths_by_frame_m
        Depths of the surfaces, m, (T, H, W): of each frame, or (1, H, W) of all.
    spot_ranges_by_frame_m
        Ranges of the spots, m, (T, spots); nan for nothing.
    fog_per_m
        Extinction of the air between the drops, 1/m; volumes of fog do not weaken their echo.
    times_s
        Middle of every exposure, s, (frames, M).
    """

    field: DropField
    precipitation: Precipitation
    instrument: Instrument
    view: InstrumentView
    depths_by_frame_m: Floats
    spot_ranges_by_frame_m: Floats
    fog_per_m: float
    times_s: Floats

    def in_frame(self, frame: int) -> tuple[DropField, Floats, float]:
        """Drops of a frame that are within the depths that matter.

        Returns
        -------
        tuple
            Drops, their positions (drops, 3) in the middle of the frame, m, and how far any of them
            moves from there at most, m.
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
        """Depth (H, W) of the surfaces in a frame, m."""
        return np.asarray(self.depths_by_frame_m[min(frame, len(self.depths_by_frame_m) - 1)])

    def spot_range_m(self, frame: int) -> Floats:
        """Ranges (spots,) of the spots in a frame, m, up to MAX_DEPTHS times the depth of drops."""
        ranges = self.spot_ranges_by_frame_m
        far_m = MAX_DEPTHS * self.precipitation.far_m
        return np.asarray(np.fmin(ranges[min(frame, len(ranges) - 1)], far_m))

    @property
    def depths_m(self) -> tuple[float, float]:
        """Minimum and maximum depth of a drop that matters, m."""
        far = min(self.precipitation.far_m, float(self.depths_by_frame_m.max()))
        return self.precipitation.near_m, far

    def at(self, field: DropField, time_s: float) -> tuple[Floats, Floats]:
        """Positions (drops, 3) and diameters, at one time, of the drops of `field` that matter."""
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
    """Draw the drops of a recording.

    Parameters
    ----------
    scene, instrument
        The scene and its precipitation, and the instrument.
    truths
        Ground truth of every frame, or one of all frames where nothing moves.
    frames
        Number of frames.
    rng
        Random generator.

    Returns
    -------
    tuple of FallingDrops
        One entry for each part of the scene's precipitation.

    Raises
    ------
    InputError
        If there are more drops than fit into memory.
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
