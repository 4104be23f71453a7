"""Positions of the drops, as the instrument sees them, at any time."""

import math
from collections.abc import Callable
from dataclasses import dataclass, replace
from typing import Self

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere.precipitation import Precipitation
from spisim.instrument import Instrument
from spisim.scene import Scene

#: Poses of the drone over a recording at which the box of drops must contain the field.
POSES = 9
#: Maximum number of drops of a recording, which fits into 4 GB.
MAX_DROPS = 10_000_000


@dataclass(frozen=True, eq=False)
class DropField:
    """Drops in the optical frame that the instrument has at the start, (drops, 3) each.

    They fill `box` (2, 3), low and high corner, which moves along with the instrument.
    """

    starts_m: Floats  # at the start of the recording
    velocities_m_s: Floats
    diameters_mm: Floats
    box: Floats
    pose_at: Callable[[float], Floats]  # of the instrument, (4, 4), seen from where it started

    def full_at(self, time_s: float) -> Self:
        """The same air with the box full at that time.

        Drops that have left it on one side come in on the other; a drop returns only after it has
        crossed the box.
        """
        low, high = self.box
        travelled = self.velocities_m_s * time_s - self.pose_at(time_s)[:3, 3]
        boxes = np.floor((self.starts_m + travelled - low) / (high - low))
        return replace(self, starts_m=self.starts_m - boxes * (high - low))

    def subset(self, which: NDArray[np.bool_]) -> Self:
        """The drops selected by a mask (drops,)."""
        return replace(
            self,
            starts_m=self.starts_m[which],
            velocities_m_s=self.velocities_m_s[which],
            diameters_mm=self.diameters_mm[which],
        )

    def positions_m(self, time_s: float) -> Floats:
        """Positions (drops, 3) in the optical frame that the instrument has then."""
        pose = self.pose_at(time_s)
        apart = self.starts_m + self.velocities_m_s * time_s - pose[:3, 3]
        return np.asarray(apart @ pose[:3, :3])


def drop_field(
    precipitation: Precipitation,
    scene: Scene,
    instrument: Instrument,
    frames: int,
    rng: np.random.Generator,
) -> DropField:
    """Draw the drops around an instrument for a recording: a Poisson number, uniform in space.

    The box contains the field of the instrument from half a frame before to half a frame after one
    frame's middle, however the drone moves.

    Parameters
    ----------
    precipitation
        Sizes, density and motion of the drops.
    scene, instrument
        The scene, with the motion of the drone, and the instrument.
    frames
        Number of frames.
    rng
        Random generator.

    Returns
    -------
    DropField
        The drops at the start of the recording.

    Raises
    ------
    InputError
        If more than `MAX_DROPS` are expected.
    """
    start = np.linalg.inv(scene.drone_pose)

    def pose_at(time_s: float) -> Floats:
        return np.asarray(start @ scene.drone_pose_at(time_s))

    corners = _field_corners(instrument, precipitation.far_m)
    times = np.linspace(0, frames * instrument.frame_time_s, POSES)
    seen = np.concatenate([corners @ pose_at(time)[:3, :3].T for time in times])
    fastest = precipitation.fall_speed_m_s(np.array([precipitation.largest_mm]))[0]
    speed = fastest + math.dist(precipitation.wind_m_s, scene.drone_velocity_m_s)
    margin = speed * instrument.frame_time_s / 2
    box = np.array([seen.min(axis=0) - margin, seen.max(axis=0) + margin])
    size = box[1] - box[0]
    expected = precipitation.number_per_m3 * math.prod(size.tolist())
    if not expected <= MAX_DROPS:
        raise InputError(
            f"scene {scene.name!r}: about {expected:.2g} drops would cross the field in a frame of "
            f"{instrument.frame_time_s:.3g} s, at {speed:.3g} m/s; the maximum is "
            f"{MAX_DROPS:.0g}: reduce wind, speed, precipitation or the frame time"
        )
    count = int(rng.poisson(expected))
    diameters = precipitation.diameters_mm(count, rng)
    falling = np.zeros((count, 3))
    falling[:, 2] = -precipitation.fall_speed_m_s(diameters)
    return DropField(
        starts_m=box[0] + rng.random((count, 3)) * size,
        velocities_m_s=(falling + precipitation.wind_m_s) @ scene.drone_pose[:3, :3],
        diameters_mm=diameters,
        box=box,
        pose_at=pose_at,
    )


def _field_corners(instrument: Instrument, far_m: float) -> Floats:
    """Points (n, 3), optical frame, whose hull contains all light out and back up to a depth.

    Depths begin at the pinhole, because drops behind it meet no light.
    """
    signs = np.array([(x, y) for x in (-1, 1) for y in (-1, 1)])
    ends, near = [], []
    if instrument.images:
        projector = instrument.imaging.projector
        ends.append(signs * np.array([projector.tan_half_width, projector.tan_half_height]) * far_m)
        near.append(signs * projector.lens_radius_m)
    if instrument.ranges:
        lasers = instrument.ranging.lasers
        footprint = 6 * 1e-3 * (lasers.waist_mm + lasers.divergence_mrad * far_m)
        middles = (lasers.directions / lasers.directions[:, 2:] * far_m)[:, :2]
        ends += [middles + sign * footprint for sign in signs]
    far = np.concatenate(ends)
    for detector in instrument.detectors.values():
        radius = np.sqrt(detector.aperture_area_m2 / np.pi)
        near += [np.asarray(position)[:2] + signs * radius for position in detector.positions_m]
    return np.concatenate(
        [
            np.column_stack([far, np.full(len(far), far_m)]),
            np.concatenate([np.column_stack([ring, np.zeros(len(ring))]) for ring in near]),
        ]
    )
