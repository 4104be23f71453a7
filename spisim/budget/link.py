"""Light returned by a flat target, and the electrons it generates.

A surface of reflectance ρ and irradiance E has the radiance ρ E / π in every direction (Lambert). A
patch that receives the power P therefore sends

    P ρ A cosθ_s cosθ_d cosᵐθ_d / (π r²)

onto an aperture of area A at the distance r, where θ_s and θ_d are the angles to the target's
normal and the detector's axis, and m is the detector's vignetting. Daylight on a target that fills
a field of half angle θ adds ρ E / π · A · 2π (1 - cosᵐ⁺²θ) / (m + 2), which is ρ E A sin²θ for a
hard edge. With A from the étendue this is τ ρ E A_ph / (4 N²) of the paper's Eq. (1).

Assumptions: the target fills the field; fog attenuates direct light, exp(-σ (way out + way back)),
but returns none; daylight in fog is as bright as without, since scattered daylight makes up for the
loss; spots lie within the field of their photodiode; and spots and lenses are points, as they are
at many lens diameters.
"""

from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture import Optics
from reconstruction.depth import pixel_rays
from spisim.instrument import Detector, Instrument
from spisim.instrument.fitting import Receivers

#: Directions that probe the field of a ranging detector for the projector's light. With sharp pixel
#: edges and a lens as a point, this many find it to 0.2 %.
FIELD_SAMPLES = 512
GOLDEN_ANGLE = np.pi * (3 - np.sqrt(5))


@dataclass(frozen=True, eq=False)
class Target:
    """A flat Lambertian target, and the air in front of it.

    Parameters
    ----------
    distance_m : float or array
        Of its plane, along the optical axis. Parameters broadcast to the results' shape (...).
    reflectance : float or array
    illuminance_klx : float or array
        Daylight on the target.
    extinction_per_m : float or array
        Of the air.
    """

    distance_m: float | Floats
    reflectance: float | Floats = 0.5
    illuminance_klx: float | Floats = 0.0
    extinction_per_m: float | Floats = 0.0


@dataclass(frozen=True, eq=False)
class BucketLink:
    """Light (...) of one exposure with all pixels on; powers are in-band, before the filter."""

    emitted_w: float
    irradiance_w_per_m2: Floats  # mean over the lit field, on the target
    signal_w: Floats
    daylight_w: Floats
    signal_electrons: Floats
    daylight_electrons: Floats
    dark_electrons: float


@dataclass(frozen=True, eq=False)
class SpotLink:
    """Light of the spots on their detectors (..., spots), before the filter; laser on."""

    path_m: Floats  # whole optical path, laser to target to detector
    range_per_path: Floats  # change of the range along the laser's ray with that of the path
    echo_w: Floats
    daylight_w: Floats
    patterns_w: Floats  # of the projector, on average over its patterns
    echo_per_s: Floats
    daylight_per_s: Floats
    patterns_per_s: Floats
    dark_per_s: float

    @property
    def steady_per_s(self) -> Floats:
        """Everything but the echo (..., spots)."""
        return self.daylight_per_s + self.patterns_per_s + self.dark_per_s


def bucket_link(instrument: Instrument, target: Target) -> BucketLink:
    """Light and electrons of one exposure with all pixels on, for a target (...)."""
    projector, detector = instrument.imaging.projector, instrument.imaging.detector
    powers = instrument.pixel_powers_w.ravel()
    optics = Optics(projector.tan_half_width, projector.tan_half_height)
    rays = pixel_rays(optics, projector.shape).reshape(-1, 3)
    distance, extinction = (
        np.asarray(value, dtype=np.float64)[..., None]
        for value in (target.distance_m, target.extinction_per_m)
    )
    points = distance[..., None] * rays  # (..., pixels, 3)
    way_out = np.linalg.norm(points, axis=-1)
    axis = np.array([0.0, 0.0, 1.0])
    per_white_w = np.zeros(np.broadcast_shapes(way_out.shape[:-1], extinction.shape[:-1]))
    half_field, area = np.radians(detector.field_of_view_deg) / 2, detector.aperture_area_m2
    for position in np.asarray(detector.positions_m):
        one = Receivers(position, axis, half_field, detector.vignetting, np.array(area))
        fraction, way_back = _seen(one, points)
        per_white_w = per_white_w + (fraction * np.exp(-extinction * (way_out + way_back))) @ powers
    lit_m2 = 4 * projector.tan_half_width * projector.tan_half_height * distance[..., 0] ** 2
    signal = target.reflectance * per_white_w
    daylight = _daylight_radiance(instrument, target) * area * _solid_angle(detector)
    daylight = len(detector.positions_m) * np.asarray(daylight)
    time_s = instrument.imaging.exposure_time_s
    return BucketLink(
        emitted_w=float(powers.sum()),
        irradiance_w_per_m2=powers.sum() / lit_m2,
        signal_w=signal,
        daylight_w=daylight,
        signal_electrons=signal * time_s * instrument.electrons_per_joule(detector, "projector"),
        daylight_electrons=daylight * time_s * instrument.electrons_per_joule(detector, "daylight"),
        dark_electrons=len(detector.positions_m) * detector.dark_electrons(time_s),
    )


def spot_link(instrument: Instrument, target: Target) -> SpotLink:
    """Light of lasers, sun and patterns on the ranging detectors, for a target (...)."""
    ranging = instrument.ranging
    (lasers, tof), directions = ranging, ranging.lasers.directions
    detector, receivers = tof.detector, ranging.receivers
    distance, extinction, reflectance = (
        np.asarray(value, dtype=np.float64)[..., None]
        for value in (target.distance_m, target.extinction_per_m, target.reflectance)
    )
    points = distance[..., None] / directions[:, 2:] * directions  # (..., spots, 3)
    way_out = np.linalg.norm(points, axis=-1)
    fraction, way_back = _seen(receivers, points)
    along_ray = np.sum(directions * (points - receivers.positions_m), axis=-1)
    path = way_out + way_back
    echo = lasers.power_w * reflectance * fraction * np.exp(-extinction * path)
    field = np.full(len(directions), _solid_angle(detector))
    half_angle, vignetting = np.radians(detector.field_of_view_deg) / 2, detector.vignetting
    relative: float | Floats = 1.0
    if (zones := ranging.zones) is not None:  # for the patterns, cones of the same étendue
        field = zones.solid_angle * zones.responses(vignetting)
        half_angle, vignetting = np.arcsin(np.sqrt(field.mean() / np.pi)), 0.0
        relative = field / field.mean()
    radiance = np.asarray(_daylight_radiance(instrument, target))[..., None]
    daylight = radiance * detector.aperture_area_m2 * field
    patterns = np.zeros(np.shape(echo))
    if instrument.images:
        seen = _pattern_light_w(instrument, half_angle, vignetting, distance, extinction)
        patterns = reflectance * seen * relative
    echo, daylight, patterns = np.broadcast_arrays(echo, daylight, patterns)
    return SpotLink(
        path_m=path,
        range_per_path=1 / (1 + along_ray / way_back),
        echo_w=echo,
        daylight_w=daylight,
        patterns_w=patterns,
        echo_per_s=echo * instrument.electrons_per_joule(detector, "laser"),
        daylight_per_s=daylight * instrument.electrons_per_joule(detector, "daylight"),
        patterns_per_s=patterns * instrument.electrons_per_joule(detector, "projector"),
        dark_per_s=detector.sensor.dark_rate_hz,
    )


def _seen(receivers: Receivers, points: Floats) -> tuple[Floats, Floats]:
    """Fraction of the light of white patches at `points` (..., 3) on the aperture, and its path."""
    offset = points - receivers.positions_m
    way = np.linalg.norm(offset, axis=-1)
    at_target, at_detector = offset[..., 2] / way, np.sum(offset * receivers.axes, axis=-1) / way
    inside = at_detector >= np.cos(receivers.half_field_rad)
    response = np.maximum(at_detector, 0) ** (1 + receivers.falloff) * inside
    return receivers.areas_m2 * at_target * response / (np.pi * way**2), way


def _daylight_radiance(instrument: Instrument, target: Target) -> float | Floats:
    """Radiance (...) of a target in daylight, which fills all fields."""
    irradiance = instrument.daylight_irradiance(1.0) * np.asarray(target.illuminance_klx)
    return target.reflectance * irradiance / np.pi


def _solid_angle(detector: Detector) -> float:
    """∫ cosθ cosᵐθ dΩ over the field."""
    power = detector.vignetting + 2
    cosine = np.cos(np.radians(detector.field_of_view_deg) / 2)
    return float(2 * np.pi * (1 - cosine**power) / power)


def _pattern_light_w(
    instrument: Instrument,
    half_angle: float,
    vignetting: float,
    distance: Floats,
    extinction: Floats,
) -> Floats:
    """Mean power (..., spots) of the patterns on the detectors from a white target."""
    axes = instrument.ranging.detector_axes
    probes = _directions_within(axes, half_angle)  # (spots, n, 3)
    positions = instrument.ranging.detector_positions_m[:, None]
    way_back = (distance[..., None] - positions[..., 2]) / probes[..., 2]
    points = positions + way_back[..., None] * probes  # (..., spots, n, 3)
    irradiance = _pattern_irradiance(instrument, points)
    way = np.linalg.norm(points, axis=-1) + way_back
    vignetted = np.sum(probes * axes[:, None], axis=-1) ** vignetting
    light = irradiance * np.exp(-extinction[..., None] * way) * vignetted
    area = instrument.ranging.tof.detector.aperture_area_m2
    return np.asarray(light.mean(axis=-1) * area * np.sin(half_angle) ** 2)


def _pattern_irradiance(instrument: Instrument, points: Floats) -> Floats:
    """Mean irradiance (...) of the patterns at points (..., 3) of a target across z."""
    projector = instrument.imaging.projector
    height, width = projector.shape
    powers = instrument.mean_powers_w
    x, y = (points[..., k] / points[..., 2] for k in (0, 1))
    column = np.floor((x / projector.tan_half_width + 1) / 2 * width).astype(int)
    row = np.floor((y / projector.tan_half_height + 1) / 2 * height).astype(int)
    lit = (column >= 0) & (column < width) & (row >= 0) & (row < height)
    power = np.where(lit, powers[np.clip(row, 0, height - 1), np.clip(column, 0, width - 1)], 0)
    pixel_area = 4 * projector.tan_half_width * projector.tan_half_height / (height * width)
    return np.asarray(power / (pixel_area * points[..., 2] ** 2))


def _directions_within(axes: Floats, half_angle: float) -> Floats:
    """Unit vectors (spots, n, 3) around each axis, uniform in projected solid angle (sunflower)."""
    count = np.arange(FIELD_SAMPLES)
    sine = np.sin(half_angle) * np.sqrt((count + 0.5) / FIELD_SAMPLES)
    turn = GOLDEN_ANGLE * count
    across = np.cross(axes, [0.0, 1.0, 0.0])
    across /= np.linalg.norm(across, axis=-1, keepdims=True)
    up = np.cross(axes, across)
    return np.asarray(
        np.sqrt(1 - sine**2)[:, None] * axes[:, None]
        + (sine * np.cos(turn))[:, None] * across[:, None]
        + (sine * np.sin(turn))[:, None] * up[:, None]
    )
