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
    """Pose (4, 4) in the world, pattern shape (H, W), half extents at unit distance.

    A pinhole, unless its lens has a radius; then it is sharp at the focal distance.
    """

    pose: Floats
    shape: tuple[int, int]
    tan_half_width: float
    tan_half_height: float
    lens_radius_m: float = 0.0
    focus_m: float = 1.0

    @property
    def pixels(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def pixel_area(self) -> float:
        """Of a virtual pixel on the image plane at unit distance."""
        return 4 * self.tan_half_width * self.tan_half_height / self.pixels


@dataclass(frozen=True, eq=False)
class DetectorView:
    """Disc apertures in the world: positions and optical axes (detectors, 3), area and field.

    Area (of each) and field are the same for all.
    `vignetting` m: inside its hard edge the field falls off with cos^m of the angle to the axis.
    """

    positions_m: Floats
    axes: Floats
    area_m2: float
    half_angle_rad: float
    vignetting: float = 0.0


@dataclass(frozen=True, eq=False)
class BeamView:
    """Laser beams in the world: origins and unit directions (beams, 3).

    Gaussian in angle and in place, with standard deviations per axis; pencils without.
    """

    origins_m: Floats
    directions: Floats
    divergence_rad: float = 0.0
    waist_m: float = 0.0


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
        apertures = origin + np.atleast_2d(instrument.detector.position_m) @ rotation.T
        return cls(
            projector=ProjectorView(
                pose,
                instrument.projector.shape,
                instrument.projector.tan_half_width,
                instrument.projector.tan_half_height,
                instrument.projector.lens_radius_m,
                instrument.projector.focus_m,
            ),
            bucket=DetectorView(
                apertures,
                np.repeat(rotation[None, :, 2], len(apertures), axis=0),
                instrument.detector.aperture_area_m2,
                np.radians(instrument.detector.field_of_view_deg) / 2,
                instrument.detector.vignetting,
            ),
            beams=BeamView(
                np.repeat(origin[None], len(headings), axis=0),
                headings,
                instrument.lasers.divergence_mrad * 1e-3,
                instrument.lasers.waist_mm * 1e-3,
            ),
            tof=DetectorView(
                origin + np.asarray(instrument.tof.detector.positions_m) @ rotation.T,
                headings,
                instrument.tof.detector.aperture_area_m2,
                np.radians(instrument.tof.detector.field_of_view_deg) / 2,
                instrument.tof.detector.vignetting,
            ),
        )
