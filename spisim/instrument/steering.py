"""Mirrors that steer the spots: directions of each frame, true and as read.

A mirror moves to a frame's angles at its start and rests there: step and settle, as quasi-static
MEMS mirrors do (not resonant ones, whose beams sweep during a reading). Time of flight begins when
it has settled, so `settling_time_s` is lost of every frame. Ringing beyond that time is left out; a
mirror driven faster than it settles, whose beams still move during the readings, is not modelled.

Angles are optical, those of the beam: twice the mirror's for a mirror turned in the plane of
incidence. They add to a spot's azimuth and elevation, which holds for small angles: two mirror
angles of 10° about an oblique beam are off by a few tenths of a degree, which a calibrated rig
records. Detectors of their own turn with their beams (coaxial scanning: they see through the
mirror, or through one as large as their lens); one that is shared stares.
"""

from __future__ import annotations

import math
from collections.abc import Callable
from typing import Annotated, Any, ClassVar, Literal, NamedTuple, TypeAlias

import numpy as np
from pydantic import Discriminator, Field, model_validator

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.base.config import Count, NonNegative, Number, Positive, Section
from spisim.instrument.aims import AIMS

HalfAngle = Annotated[Number, Field(gt=0, le=60)]
MilliRadians = Annotated[Number, Field(ge=0, le=100)]
Bias = Annotated[Number, Field(ge=-100, le=100)]
Offset = tuple[Number, Number]
#: Generalised golden ratio in the plane, whose powers' multiples fill a square evenly: M. Roberts,
#: "The unreasonable effectiveness of quasirandom sequences" (2018).
PLASTIC = 1.32471795724474602596
#: Random stream of jitter and reading errors of a capture's seed.
STREAM = 4
#: Maximum frames of a list until it repeats.
MAX_LISTED = 4096
#: Frames with which a sine may beat, harmonics by which two may, and cycles per frame that are none
BEATS, HARMONICS, EXACT = 32, 4, 1e-9

Doubt = Callable[[Floats], Floats]
"""Standard deviation (...) of ln depth in the last map, at azimuths and elevations (..., 2)."""


class Pointing(NamedTuple):
    """Unit vectors of the spots in successive frames, (frames, spots, 3): true, and as read."""

    true: Floats
    read: Floats

    @classmethod
    def joined(cls, frames: list[Pointing]) -> Pointing:
        """The frames, one after the other."""
        return cls(*(np.concatenate(each) for each in zip(*frames, strict=True)))


class Mirror(Section):
    """What all modes share: the mirrors and their errors."""

    #: Whether beams move from frame to frame by themselves, and whether they follow the last map.
    scans: ClassVar[bool] = False
    follows: ClassVar[bool] = False

    mirrors: Literal["common", "each"] = "common"
    """One mirror for all spots, whose pattern moves as a whole, or one for each."""
    half_range_deg: tuple[HalfAngle, HalfAngle]
    """[across, up] maximum optical angles from the spots' directions, to both sides."""
    settling_time_s: NonNegative = 0.0
    """Time lost at the start of a frame, until the mirrors rest."""
    jitter_mrad: MilliRadians = 0.0
    """Standard deviation of the true angles from the commanded, per axis and frame."""
    reading_sigma_mrad: MilliRadians = 0.0
    """Standard deviation of the recorded angles from the true ones, per axis and frame."""
    reading_bias_mrad: tuple[Bias, Bias] = (0.0, 0.0)
    """[across, up] constant error of the recorded angles."""
    scan_safeguard: bool = False
    """Whether light stops when the scan fails; without, beams are assessed as standing."""

    @property
    def is_safeguarded(self) -> bool:
        """Whether no beam stands still: it scans, and light stops with the scan."""
        return self.scans and self.scan_safeguard

    @property
    def period(self) -> int:
        """Frames in which a scan has been everywhere; 1 where none is defined."""
        return 1

    def offsets(self, frame: int, mirrors: int) -> Floats:
        """Commanded angles (mirrors, 2) of a frame in degrees: to the right, up."""
        raise NotImplementedError

    def aimed(self, frame: int, home_deg: Floats, doubt: Doubt | None) -> Floats:
        """The same, given the spots' directions (spots, 2) and the last depth map."""
        return self.offsets(frame, len(self.groups(home_deg)))

    def groups(self, home_deg: Floats) -> Floats:
        """Directions (mirrors, spots of each, 2) by mirror."""
        return home_deg[None] if self.mirrors == "common" else home_deg[:, None]

    def extremes(self, mirrors: int) -> Floats:
        """Offsets (n, mirrors, 2) that bound the others."""
        corners = np.array([[-1, -1], [-1, 1], [1, -1], [1, 1]]) * self.half_range_deg
        return np.broadcast_to(corners[:, None], (4, mirrors, 2))

    def pointing(
        self, home_deg: Floats, frame: int, seed: int, doubt: Doubt | None = None
    ) -> Pointing:
        """Directions of one frame, the same for the same seed.

        Parameters
        ----------
        home_deg
            Azimuth and elevation (spots, 2) of the spots with mirrors at rest.
        frame
            Number of the frame.
        seed
            Seed of the capture, for jitter and reading errors.
        doubt
            Uncertainty of the last depth map, for mirrors that follow it.
        """
        offsets = self.aimed(frame, home_deg, doubt)
        rng = np.random.default_rng(np.random.SeedSequence(seed, spawn_key=(STREAM, frame)))
        jitter, error = np.degrees(1e-3 * rng.standard_normal((2, *offsets.shape)))
        true = home_deg + offsets + self.jitter_mrad * jitter
        bias = np.degrees(1e-3 * np.array(self.reading_bias_mrad))
        read = true + self.reading_sigma_mrad * error + bias
        return Pointing(directions(true)[None], directions(read)[None])

    def check(self, home_deg: Floats, half_field_deg: float, *, shared: bool) -> None:
        """Raise InputError if beams cannot get there, leave a shared field, or meet.

        `half_field_deg` is half the field of a photodiode; with one for each, spots that come
        nearer than a field, and than at rest, see each other's light.
        """
        extremes = self.extremes(len(self.groups(home_deg)))
        reached = home_deg + extremes
        if np.abs(reached).max() >= 90:
            raise InputError(
                f"half_range_deg {list(self.half_range_deg)} turns a spot by "
                f"{np.abs(reached).max():.4g}°; directions should stay within ±90°"
            )
        off_axis = np.degrees(np.arccos(directions(reached)[..., 2])).max()
        if shared and off_axis > half_field_deg:
            raise InputError(
                f"mirrors turn spots up to {off_axis:.4g}° off the axis of the shared detector; "
                f"half of tof.detector.field_of_view_deg is {half_field_deg:g}"
            )
        at_rest = np.linalg.norm(home_deg[:, None] - home_deg, axis=-1)
        apart = np.minimum(0.0 if shared else 2 * half_field_deg, at_rest)
        closest = self.closest_deg(home_deg)
        for one, other in np.argwhere(np.triu((closest < apart) | (closest == 0), 1)):
            raise InputError(
                f"mirrors let spots {one} and {other} meet: they come within "
                f"{closest[one, other]:.3g}° of each other; at least {apart[one, other]:.3g}° is "
                "needed, tof.detector.field_of_view_deg or their distance at rest"
            )

    def closest_deg(self, home_deg: Floats) -> Floats:
        """Minimum angles (spots, spots) between any two spots."""
        both = 2 * np.array(self.half_range_deg) * (self.mirrors == "each")
        away = np.maximum(np.abs(home_deg[:, None] - home_deg) - both, 0)
        return np.asarray(np.linalg.norm(away, axis=-1))


class Fixed(Mirror):
    """Mirrors at rest, with their errors."""

    mode: Literal["fixed"]
    """Mode discriminator."""

    def offsets(self, frame: int, mirrors: int) -> Floats:
        return np.zeros((mirrors, 2))

    def extremes(self, mirrors: int) -> Floats:
        return np.zeros((1, mirrors, 2))

    def closest_deg(self, home_deg: Floats) -> Floats:
        return np.asarray(np.linalg.norm(home_deg[:, None] - home_deg, axis=-1))


class Listed(Mirror):
    """Given angles, frame by frame, repeated."""

    mode: Literal["list"]
    """Mode discriminator."""
    offsets_deg: Annotated[
        tuple[tuple[Offset, ...], ...], Field(min_length=1, max_length=MAX_LISTED)
    ]
    """For each frame of a period, [to the right, up] of each mirror."""

    def offsets(self, frame: int, mirrors: int) -> Floats:
        return np.array(self.offsets_deg[frame % len(self.offsets_deg)], np.float64)

    def extremes(self, mirrors: int) -> Floats:
        return np.array(self.offsets_deg, np.float64)

    def check(self, home_deg: Floats, half_field_deg: float, *, shared: bool) -> None:
        mirrors = len(self.groups(home_deg))
        for frame, given in enumerate(self.offsets_deg):
            if len(given) != mirrors:
                raise InputError(
                    f"offsets_deg: frame {frame} has {len(given)} pairs of angles for {mirrors} "
                    f"mirror(s); one for each is needed"
                )
            if (np.abs(given) > self.half_range_deg).any():
                raise InputError(
                    f"offsets_deg: frame {frame} has {[list(each) for each in given]}, beyond "
                    f"half_range_deg {list(self.half_range_deg)}"
                )
        super().check(home_deg, half_field_deg, shared=shared)

    def closest_deg(self, home_deg: Floats) -> Floats:
        every = home_deg + self.extremes(0)
        return np.asarray(np.linalg.norm(every[:, :, None] - every[:, None], axis=-1).min(axis=0))


class Raster(Mirror):
    """Row by row over the range, to and fro."""

    scans = True

    mode: Literal["raster"]
    """Mode discriminator."""
    shape: tuple[Count, Count]
    """[rows, columns] of the grid, whose cells' centres are met."""

    @property
    def period(self) -> int:
        return math.prod(self.shape)

    def offsets(self, frame: int, mirrors: int) -> Floats:
        rows, columns = self.shape
        row, column = divmod(frame % (rows * columns), columns)
        column = columns - 1 - column if row % 2 else column
        unit = np.array([(2 * column + 1) / columns - 1, 1 - (2 * row + 1) / rows])
        return np.tile(unit * self.half_range_deg, (mirrors, 1))


class Lissajous(Mirror):
    """A sine across and one upwards, sampled once a frame."""

    scans = True

    mode: Literal["lissajous"]
    """Mode discriminator."""
    cycles_per_frame: tuple[Positive, Positive]
    """[across, up] frequencies of the two sines."""

    @property
    def period(self) -> int:
        """Of the slowest beat of a sine with every few frames, or of both, which shifts the scan.

        What repeats exactly has no beat, unless it stands.
        """
        across, up = self.cycles_per_frame
        order = np.arange(1, HARMONICS + 1)
        joint = np.add.outer(order * across, np.concatenate([order, -order]) * up).ravel()
        alone = np.outer(np.arange(1, BEATS + 1), self.cycles_per_frame).ravel()
        turns = np.concatenate([alone, joint])
        beats = np.maximum(np.abs(turns - np.rint(turns)), EXACT)
        beats[4:][beats[4:] == EXACT] = 1
        return math.ceil(1 / beats.min())

    def offsets(self, frame: int, mirrors: int) -> Floats:
        unit = np.sin(2 * np.pi * frame * np.array(self.cycles_per_frame))
        return np.tile(unit * self.half_range_deg, (mirrors, 1))


class Random(Mirror):
    """Evenly over the range in any order: a low-discrepancy sequence from a random start."""

    scans = True

    mode: Literal["random"]
    """Mode discriminator."""
    seed: Annotated[int, Field(ge=0)] = 0
    """Seed of the start, which differs from mirror to mirror."""

    def offsets(self, frame: int, mirrors: int) -> Floats:
        start = np.random.default_rng(self.seed).random((mirrors, 2))
        unit = (start + frame * PLASTIC ** -np.arange(1.0, 3.0)) % 1
        return np.asarray((2 * unit - 1) * self.half_range_deg)


class Adaptive(Mirror):
    """Where the last depth map is least sure; without one, at rest."""

    follows = True

    mode: Literal["adaptive"]
    """Mode discriminator."""
    method: str = "least-sure"
    """Name of the method that chooses the directions."""
    apart_deg: Positive = 1.5
    """Minimum angle between spots with mirrors of their own; above the detectors' field."""

    def offsets(self, frame: int, mirrors: int) -> Floats:
        return np.zeros((mirrors, 2))

    def closest_deg(self, home_deg: Floats) -> Floats:
        closest = super().closest_deg(home_deg)
        return closest if self.mirrors == "common" else np.maximum(closest, self.apart_deg)

    def aimed(self, frame: int, home_deg: Floats, doubt: Doubt | None) -> Floats:
        groups = self.groups(home_deg)
        if doubt is None:
            return self.offsets(frame, len(groups))
        return AIMS[self.method](doubt, groups, self.half_range_deg, self.apart_deg)

    @model_validator(mode="after")
    def _known_method(self) -> Adaptive:
        AIMS[self.method]
        return self


def directions(angles_deg: Any) -> Floats:
    """Unit vectors (..., 3) in the optical frame of azimuths and elevations (..., 2)."""
    azimuth, elevation = np.moveaxis(np.radians(angles_deg), -1, 0)
    return np.stack(
        [
            np.cos(elevation) * np.sin(azimuth),
            -np.sin(elevation),
            np.cos(elevation) * np.cos(azimuth),
        ],
        axis=-1,
    )


#: Any mode, as a field of a file.
AnySteering: TypeAlias = Annotated[
    Fixed | Listed | Raster | Lissajous | Random | Adaptive, Discriminator("mode")
]
