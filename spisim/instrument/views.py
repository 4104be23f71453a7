"""Positions of the ends of light paths in the world, as plain numbers without Mitsuba."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, fields, replace
from typing import TYPE_CHECKING

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError

if TYPE_CHECKING:
    from spisim.instrument import Detector, Instrument
    from spisim.scene import Scene


@dataclass(frozen=True, eq=False)
class ProjectorView:
    """Pose (4, 4) in the world, pattern shape (H, W), half extents at unit distance.

    A pinhole, unless its lens has a radius; then it is sharp at the focal distance. As a receiver
    it sees along the rays that it would emit: an aperture of `aperture_m2`, whose pixels respond
    with cosᵏ of the angle to the axis, k = `falloff`, per area on the image plane (4 for a bare
    aperture).
    """

    pose: Floats
    shape: tuple[int, int]
    tan_half_width: float
    tan_half_height: float
    lens_radius_m: float = 0.0
    focus_m: float = 1.0
    falloff: float = 0.0
    aperture_m2: float = 0.0

    @property
    def pixels(self) -> int:
        return self.shape[0] * self.shape[1]

    @property
    def pixel_area(self) -> float:
        """Area of a virtual pixel on the image plane at unit distance."""
        return 4 * self.tan_half_width * self.tan_half_height / self.pixels

    @property
    def area_m2(self) -> float:
        """Power received from unit radiance all over a pixel without falloff, m² sr."""
        return self.aperture_m2 * self.pixel_area


@dataclass(frozen=True, eq=False)
class DetectorView:
    """Disc apertures in the world: positions and optical axes (detectors, 3), area and field.

    Inside its hard edge the field falls off with cos^m of the angle to the axis, m = `vignetting`.
    """

    positions_m: Floats
    axes: Floats
    area_m2: float
    half_angle_rad: float
    vignetting: float = 0.0


@dataclass(frozen=True, eq=False)
class BeamView:
    """Laser beams in the world: origins and unit directions (beams, 3).

    Gaussian in angle and position, with standard deviations per axis; by default pencils.
    """

    origins_m: Floats
    directions: Floats
    divergence_rad: float = 0.0
    waist_m: float = 0.0


NO_DETECTOR = DetectorView(np.zeros((0, 3)), np.zeros((0, 3)), 0.0, 0.0)
NO_BEAMS = BeamView(np.zeros((0, 3)), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class InstrumentView:
    """An instrument placed in the world."""

    projector: ProjectorView
    bucket: DetectorView
    beams: BeamView
    tof: DetectorView
    zones: ProjectorView | None = None  # then `beams` are their axes, and `tof` is the flood

    @classmethod
    def placed(cls, scene: Scene, instrument: Instrument) -> InstrumentView:
        """Place it at the scene's drone; InputError for a scene of another wavelength."""
        if scene.wavelength_nm != instrument.wavelength_nm:
            raise InputError(
                f"wavelength_nm {instrument.wavelength_nm:g} of the instrument differs from "
                f"{scene.wavelength_nm:g} of scene {scene.name!r}: load the scene with "
                f"wavelength_nm={instrument.wavelength_nm:g}, or move the instrument with "
                f"at_wavelength({scene.wavelength_nm:g})"
            )
        return cls.of(instrument, scene.drone_pose)

    @classmethod
    def of(cls, instrument: Instrument, pose: Floats) -> InstrumentView:
        """Place it at `pose` (4, 4), world from optical frame; what it lacks is empty."""
        rotation, origin = pose[:3, :3], pose[:3, 3]
        projector, bucket = ProjectorView(pose, (1, 1), 0.0, 0.0), NO_DETECTOR
        beams, tof, zones = NO_BEAMS, NO_DETECTOR, None
        if instrument.images:
            lit, _, detector, _ = instrument.imaging
            projector = ProjectorView(
                pose,
                lit.shape,
                lit.tan_half_width,
                lit.tan_half_height,
                lit.lens_radius_m,
                lit.focus_m,
            )
            positions = np.asarray(detector.positions_m)
            bucket = _placed(
                detector, positions, np.tile([0.0, 0.0, 1.0], (len(positions), 1)), pose
            )
        if instrument.ranges:
            ranging = instrument.ranging
            headings = ranging.lasers.directions @ rotation.T
            flood, starts = ranging.zones, np.repeat(origin[None], len(headings), axis=0)
            if flood is None:
                tof = _placed(
                    ranging.tof.detector, ranging.detector_positions_m, ranging.detector_axes, pose
                )
            else:
                lens, receivers = ranging.tof.detector.aperture_area_m2, ranging.receivers
                tof = DetectorView(
                    starts,
                    receivers.axes @ rotation.T,
                    ranging.zone_etendue * flood.axial_intensity,
                    receivers.half_field_rad,
                    receivers.falloff,
                )
                starts = starts + ranging.detector_positions_m @ rotation.T
                seen_from = pose.copy()
                seen_from[:3, 3] = starts[0]
                zones = ProjectorView(
                    seen_from,
                    flood.shape,
                    *flood.tan_half,
                    falloff=ranging.zone_falloff,
                    aperture_m2=lens,
                )
            beams = BeamView(
                starts,
                headings,
                ranging.lasers.divergence_mrad * 1e-3,
                ranging.lasers.waist_mm * 1e-3,
            )
        return cls(projector, bucket, beams, tof, zones)


def together(views: Sequence[InstrumentView]) -> InstrumentView:
    """Beams and ranging detectors of several views of one instrument with lasers, in their order.

    Projector and bucket are those of the first.
    """

    def joined(name: str) -> dict[str, Floats]:
        parts = [getattr(view, name) for view in views]
        arrays = [each.name for each in fields(parts[0]) if np.ndim(getattr(parts[0], each.name))]
        return {each: np.concatenate([getattr(part, each) for part in parts]) for each in arrays}

    beams, tof = (replace(getattr(views[0], name), **joined(name)) for name in ("beams", "tof"))
    return replace(views[0], beams=beams, tof=tof)


def _placed(detector: Detector, positions_m: Floats, axes: Floats, pose: Floats) -> DetectorView:
    """Detectors of an instrument, positions and axes (detectors, 3) in its optical frame."""
    rotation, origin = pose[:3, :3], pose[:3, 3]
    return DetectorView(
        origin + positions_m @ rotation.T,
        axes @ rotation.T,
        detector.aperture_area_m2,
        np.radians(detector.field_of_view_deg) / 2,
        detector.vignetting,
    )
