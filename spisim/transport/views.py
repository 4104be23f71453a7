"""Where the ends of the light paths are in the world: plain numbers, no Mitsuba."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np
from numpy.typing import NDArray

if TYPE_CHECKING:
    from spisim.instrument import Instrument

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class ProjectorView:
    """Pinhole pose (4, 4) in the world, pattern shape (H, W), half extents at unit distance."""

    pose: Floats
    shape: tuple[int, int]
    tan_half_width: float
    tan_half_height: float

    @property
    def pixels(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def pixel_area(self) -> float:
        """Of a virtual pixel on the image plane at unit distance."""
        return 4 * self.tan_half_width * self.tan_half_height / self.pixels


@dataclass(frozen=True, eq=False)
class DetectorView:
    """Disc apertures in the world: positions and optical axes (detectors, 3), area and field."""

    positions_m: Floats
    axes: Floats
    area_m2: float
    half_angle_rad: float


@dataclass(frozen=True, eq=False)
class BeamView:
    """Laser pencils in the world: origins and unit directions (beams, 3)."""

    origins_m: Floats
    directions: Floats


@dataclass(frozen=True, eq=False)
class InstrumentView:
    """An instrument placed in the world."""

    projector: ProjectorView
    bucket: DetectorView
    beams: BeamView
    tof: DetectorView

    @classmethod
    def of(cls, instrument: Instrument, pose: Floats) -> InstrumentView:
        """`pose` (4, 4): world from optical frame."""
        rotation, origin = pose[:3, :3], pose[:3, 3]
        headings = instrument.lasers.directions @ rotation.T
        return cls(
            projector=ProjectorView(
                pose,
                instrument.projector.shape,
                instrument.projector.tan_half_width,
                instrument.projector.tan_half_height,
            ),
            bucket=DetectorView(
                origin + np.atleast_2d(instrument.detector.position_m) @ rotation.T,
                rotation[None, :, 2],
                instrument.detector.aperture_area_m2,
                np.radians(instrument.detector.field_of_view_deg) / 2,
            ),
            beams=BeamView(np.repeat(origin[None], len(headings), axis=0), headings),
            tof=DetectorView(
                origin + np.asarray(instrument.tof.detector.positions_m) @ rotation.T,
                headings,
                instrument.tof.detector.aperture_area_m2,
                np.radians(instrument.tof.detector.field_of_view_deg) / 2,
            ),
        )
