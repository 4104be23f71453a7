"""Parts that make an image and parts that range, and checks that they fit together."""

from __future__ import annotations

import math
from collections.abc import Callable, Mapping
from typing import Any, NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.operators import PatternPlan
from spisim.instrument.detector import BucketDetector
from spisim.instrument.parts import Filter, Lasers, Plan, Projector
from spisim.instrument.sensor import quantum_efficiency
from spisim.instrument.tof import Tof
from spisim.instrument.zones import BARE_LENS, Zones
from spisim.scene.sun import in_band_irradiance

#: Wavelengths across the filter's band at which spectra are weighted.
BAND_POINTS = 49
#: Minimum period of a pattern in time constants, so that it affects only the next one.
SETTLING_TIMES = 5
#: Fields that make an image, and fields that range: with lasers or with zones.
IMAGING, RANGING = ("projector", "plan", "detector"), ("lasers", "tof")
ZONING = ("zones", "tof")


class Imaging(NamedTuple):
    """The parts that make an image."""

    projector: Projector
    plan: Plan
    detector: BucketDetector
    exposure_time_s: float

    @property
    def pattern_period_s(self) -> float:
        """Time from one pattern to the next."""
        return 1 / self.projector.pattern_rate_hz


class Receivers(NamedTuple):
    """Round apertures that collect what beams send back, at positions (spots, 3) from their starts.

    They see cones about their axes (spots, 3), with a response of cosᵐ, m = `falloff`.
    """

    positions_m: Floats
    axes: Floats
    half_field_rad: float
    falloff: float
    areas_m2: Floats


class Ranging(NamedTuple):
    """The parts that measure the ranges of the spots, which may be zones."""

    lasers: Lasers | Zones
    tof: Tof

    @property
    def zones(self) -> Zones | None:
        """The zones; None with lasers."""
        return self.lasers if isinstance(self.lasers, Zones) else None

    @property
    def spots(self) -> int:
        """Number of lasers or zones."""
        return len(self.lasers.directions_deg)

    @property
    def shared(self) -> bool:
        """Whether one photodiode serves several spots."""
        return self.zones is None and len(self.tof.detector.positions_m) < self.spots

    @property
    def frame_time_s(self) -> float:
        """Time of the ranges of a frame, once its mirrors have settled; with a shared photodiode
        the lasers fire in turn.
        """
        steering = self.lasers.steering
        settling_s = 0.0 if steering is None else steering.settling_time_s
        return settling_s + self.tof.frame_time_s * (self.spots if self.shared else 1)

    @property
    def detector_positions_m(self) -> Floats:
        """Position (spots, 3) of each spot's photodiode."""
        positions = self.tof.detector.positions_m
        return np.asarray(np.broadcast_to(positions, (self.spots, 3)), dtype=np.float64)

    @property
    def detector_axes(self) -> Floats:
        """Unit vectors (spots, 3) that the photodiodes face."""
        if self.shared:
            return self._forward
        return self.lasers.directions

    @property
    def receivers(self) -> Receivers:
        """What collects the light of each spot.

        Light is the same both ways: a zone counts as a beam from the receiver, which is collected
        where the flood leaves. An aperture of the area A Ω I₀ there, for a receiver's aperture A,
        a zone of the solid angle Ω and the flood's intensity I₀ per watt, makes the light equal.
        """
        detector, zones = self.tof.detector, self.zones
        if zones is not None:
            return Receivers(
                -self.detector_positions_m,
                self._forward,
                math.radians(zones.flood_deg) / 2,
                zones.flood_falloff - 1,  # on the plane of the aperture
                self.zone_etendue * zones.axial_intensity * zones.responses(detector.vignetting),
            )
        return Receivers(
            self.detector_positions_m,
            self.detector_axes,
            math.radians(detector.field_of_view_deg) / 2,
            detector.vignetting,
            np.full(self.spots, detector.aperture_area_m2),
        )

    @property
    def zone_etendue(self) -> float:
        """Aperture times solid angle of a zone on the axis, m² sr."""
        assert self.zones is not None
        return self.tof.detector.aperture_area_m2 * self.zones.solid_angle

    @property
    def zone_falloff(self) -> float:
        """Exponent of the zones' response over the image plane."""
        return BARE_LENS + self.tof.detector.vignetting

    @property
    def _forward(self) -> Floats:
        return np.tile([0.0, 0.0, 1.0], (self.spots, 1))


def missing_parts(fields: Mapping[str, Any]) -> list[InputError]:
    """Errors of an instrument that is empty or lacks parts of image or ranges."""
    errors = []
    images, lasers, zones = (fields[name] is not None for name in ("projector", "lasers", "zones"))
    if lasers and zones:
        errors.append(InputError("lasers and zones are two ways to make ranges: leave one out"))
    ranges = lasers or zones
    for what, parts in (("an image", IMAGING), ("ranges", ZONING if zones else RANGING)):
        missing = [name for name in parts if fields[name] is None]
        if 0 < len(missing) < len(parts):
            names = f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
            errors.append(InputError(f"{names}: {_listed(parts)} make {what} together"))
    if not errors and not (images or ranges):
        errors.append(
            InputError(
                f"the instrument is empty: {_listed(IMAGING)} make an image, {_listed(RANGING)} "
                "ranges; at least one of the two is needed"
            )
        )
    if not images and fields["exposure_time_s"] is not None:
        errors.append(InputError("exposure_time_s is that of patterns, and projector is missing"))
    return errors


def misfits(
    band_pass: Filter,
    wavelength_nm: float,
    imaging: Imaging | None,
    ranging: Ranging | None,
    make_plans: Callable[[], tuple[PatternPlan, ...]],
) -> list[InputError]:
    """Errors of parts that do not fit together, with fields, values and what is allowed."""
    checks: list[Callable[[], None]] = [
        lambda: _check_band(band_pass, wavelength_nm, imaging),
        lambda: _check_efficiency(band_pass, imaging, ranging),
    ]
    if imaging is not None:
        checks += [
            lambda: _check_plan(make_plans),
            lambda: _check_exposure(imaging),
            lambda: _check_settling(imaging),
            lambda: _check_modulation(imaging),
        ]
    if ranging is not None:
        checks += [
            lambda: _check_spots(ranging),
            lambda: _check_steering(ranging, imaging, make_plans),
        ]
    errors = []
    for check in checks:
        try:
            check()
        except InputError as error:
            errors.append(error)
    return errors


def _listed(names: tuple[str, ...]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _check_plan(make_plans: Callable[[], tuple[PatternPlan, ...]]) -> None:
    try:
        make_plans()
    except InputError as error:
        raise InputError(f"plan: {error}") from None


def _check_band(band_pass: Filter, wavelength_nm: float, imaging: Imaging | None) -> None:
    try:
        in_band_irradiance(1.0, band_pass.band_nm)
    except InputError as error:
        raise InputError(f"filter.{error}") from None
    low, high = band_pass.band_nm
    if not low <= wavelength_nm <= high:
        raise InputError(
            f"wavelength_nm {wavelength_nm} is outside filter.band_nm, {low} to {high}"
        )
    spectrum = None if imaging is None else imaging.projector.spectrum
    if spectrum is not None and spectrum.fraction_within(band_pass.band_nm) < 1e-9:
        raise InputError(f"projector.spectrum has no light within filter.band_nm, {low} to {high}")


def _check_exposure(imaging: Imaging) -> None:
    if imaging.exposure_time_s > imaging.pattern_period_s * (1 + 1e-9):
        raise InputError(
            f"exposure_time_s {imaging.exposure_time_s} is longer than a pattern's period "
            f"{imaging.pattern_period_s:.6g}, 1 / projector.pattern_rate_hz"
        )


def _check_settling(imaging: Imaging) -> None:
    """A pattern settles within its period."""
    projector, amplifier = imaging.projector, imaging.detector.amplifier
    times_s = {
        "projector.settling_time_s": projector.settling_time_s,
        "the time constant of detector.amplifier.bandwidth_hz,": (
            0.0 if amplifier is None else amplifier.time_constant_s
        ),
    }
    for name, time_s in times_s.items():
        if time_s * SETTLING_TIMES > imaging.pattern_period_s:
            raise InputError(
                f"{name} {time_s:.4g} s is too long for patterns of "
                f"{imaging.pattern_period_s:.4g} s, 1 / projector.pattern_rate_hz: at most "
                f"{imaging.pattern_period_s / SETTLING_TIMES:.4g} s"
            )


def _check_efficiency(band_pass: Filter, imaging: Imaging | None, ranging: Ranging | None) -> None:
    """At most one electron per photon."""
    low, _ = band = band_pass.band_nm
    sensors = {} if imaging is None else {"detector": imaging.detector.sensor}
    sensors |= {} if ranging is None else {"tof.detector": ranging.tof.detector.sensor}
    for name, sensor in sensors.items():
        if quantum_efficiency(sensor, np.linspace(*band, BAND_POINTS)).max() > 1:
            raise InputError(f"{name}.sensor.{sensor.too_efficient(low)}")


def _check_spots(ranging: Ranging) -> None:
    """One photodiode per laser, or one for all; one for zones, which its field holds."""
    spots, positions = ranging.spots, len(ranging.tof.detector.positions_m)
    if (zones := ranging.zones) is not None:
        if positions != 1:
            raise InputError(
                f"tof.detector.positions_m has {positions} positions; zones share one receiver"
            )
        if zones.corner_deg > ranging.tof.detector.field_of_view_deg:
            raise InputError(
                f"tof.detector.field_of_view_deg {ranging.tof.detector.field_of_view_deg:g} does "
                f"not hold the corners of zones.fov_deg; at least {zones.corner_deg:.4g}"
            )
        return
    if positions not in (1, spots):
        raise InputError(
            f"tof.detector.positions_m has {positions} positions, lasers.directions_deg {spots} "
            f"spots; one photodiode for all, or {spots}, are possible"
        )


def _check_steering(
    ranging: Ranging, imaging: Imaging | None, make_plans: Callable[[], tuple[PatternPlan, ...]]
) -> None:
    """The mirrors' directions are possible, and they settle within a frame."""
    steering = ranging.lasers.steering
    if steering is None:
        return
    home_deg = np.array(ranging.lasers.directions_deg)
    half_field_deg = ranging.tof.detector.field_of_view_deg / 2
    try:
        steering.check(home_deg, half_field_deg, shared=ranging.shared)
    except InputError as error:
        raise InputError(f"lasers.steering.{error}") from None
    if imaging is None:
        return
    try:
        frame_s = make_plans()[0].exposures * imaging.pattern_period_s
    except InputError:  # reported as that of the plan
        return
    if ranging.frame_time_s > frame_s * (1 + 1e-9):
        raise InputError(
            f"lasers.steering.settling_time_s {steering.settling_time_s:.4g} and the time of "
            f"flight of {ranging.frame_time_s - steering.settling_time_s:.6g} s after it are "
            f"longer than a frame of {frame_s:.6g} s"
        )


def _check_modulation(imaging: Imaging) -> None:
    """Modulated patterns can be demodulated."""
    projector, _, detector, exposure_time_s = imaging
    modulation = projector.modulation
    if modulation is None:
        return
    if detector.amplifier is None:
        raise InputError("projector.modulation needs a detector that integrates charge")
    if detector.amplifier.coupling == "ac":
        raise InputError("projector.modulation needs detector.amplifier.coupling dc")
    if modulation.taps.arrangement == "in-turn":
        raise InputError(
            "projector.modulation.taps.arrangement should be parallel: one exposure holds all taps"
        )
    if len(modulation.frequencies_hz) > 1:
        raise InputError(
            "projector.modulation.frequencies_hz should be one frequency, that of all patterns"
        )
    if len(modulation.taps.phases_rad) * modulation.taps.fraction > 1 + 1e-9:
        raise InputError(
            "projector.modulation.taps should share the electrons of an exposure: rectangular, "
            "of width 0.25 at most"
        )
    if exposure_time_s * modulation.frequencies_hz[0] < 1:
        raise InputError(
            "projector.modulation.frequencies_hz should fit a period into exposure_time_s "
            f"{exposure_time_s:.4g}; at least {1 / exposure_time_s:.4g}"
        )
