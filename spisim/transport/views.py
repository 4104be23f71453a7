"""Where the ends of the light paths are in the world: plain numbers, no Mitsuba."""

from __future__ import annotations

from dataclasses import dataclass
from typing import TYPE_CHECKING

import numpy as np

from reconstruction.arrays import Floats
from reconstruction.errors import InputError

if TYPE_CHECKING:
    from spisim.instrument import Instrument
    from spisim.scene import Scene


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
    def placed(cls, scene: Scene, instrument: Instrument) -> InstrumentView:
        """Where the scene has its drone. InputError for a scene of another wavelength."""
        if scene.wavelength_nm != instrument.wavelength_nm:
            raise InputError(
                f"wavelength_nm {instrument.wavelength_nm:g} of the instrument is not that of "
                f"scene {scene.name!r}, {scene.wavelength_nm:g}: load the scene with "
                f"wavelength_nm={instrument.wavelength_nm:g}, or move the instrument with "
                f"at_wavelength({scene.wavelength_nm:g})"
            )
        return cls.of(instrument, scene.drone_pose)

    @classmethod
    def of(cls, instrument: Instrument, pose: Floats) -> InstrumentView:
        """`pose` (4, 4): world from optical frame."""
        rotation, origin = pose[:3, :3], pose[:3, 3]
        headings = instrument.lasers.directions @ rotation.T
        bucket, ranging = instrument.detector, instrument.tof.detector
        ahead = np.repeat(rotation[None, :, 2], 4, axis=0)
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
                origin + np.asarray(bucket.positions_m) @ rotation.T,
                np.repeat(rotation[None, :, 2], len(bucket.positions_m), axis=0),
                bucket.aperture_area_m2,
                np.radians(bucket.field_of_view_deg) / 2,
                bucket.vignetting,
            ),
            beams=BeamView(
                np.repeat(origin[None], len(headings), axis=0),
                headings,
                instrument.lasers.divergence_mrad * 1e-3,
                instrument.lasers.waist_mm * 1e-3,
            ),
            tof=DetectorView(
                origin + instrument.tof.detector.spot_positions_m @ rotation.T,
                ahead if ranging.shared else headings,
                ranging.aperture_area_m2,
                np.radians(ranging.field_of_view_deg) / 2,
                ranging.vignetting,
            ),
        )
