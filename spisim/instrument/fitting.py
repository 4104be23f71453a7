"""Whether the parts of an instrument fit together."""

from __future__ import annotations

from collections.abc import Callable
from typing import TYPE_CHECKING

import numpy as np

from reconstruction.base.errors import InputError
from spisim.instrument.sensor import quantum_efficiency

if TYPE_CHECKING:
    from spisim.instrument.model import Instrument

#: Wavelengths at which a spectrum within the filter's band is weighted.
BAND_POINTS = 49
#: Time constants that a pattern's period must last, so that a pattern is felt in the next one only.
SETTLING_TIMES = 5
#: Parts of the image, and of the ranges.
IMAGING, RANGING = ("projector", "plan", "detector"), ("lasers", "tof")


def errors_of(instrument: Instrument) -> list[InputError]:
    """All that does not fit, each with its fields, values and what is allowed."""
    errors = _missing_parts(instrument)
    if errors:
        return errors
    checks: list[Callable[[Instrument], None]] = [_check_band, _check_efficiency]
    if instrument.images:
        checks += [_check_plan, _check_exposure, _check_settling, _check_modulation]
    if instrument.ranges:
        checks.append(_check_spots)
    for check in checks:
        try:
            check(instrument)
        except InputError as error:
            errors.append(error)
    return errors


def _missing_parts(instrument: Instrument) -> list[InputError]:
    errors = []
    for what, parts in (("an image", IMAGING), ("ranges", RANGING)):
        missing = [name for name in parts if getattr(instrument, name) is None]
        if 0 < len(missing) < len(parts):
            names = f"{' and '.join(missing)} {'is' if len(missing) == 1 else 'are'} missing"
            errors.append(InputError(f"{names}: {_listed(parts)} make {what} together"))
    if not errors and not (instrument.images or instrument.ranges):
        errors.append(
            InputError(
                f"the instrument is empty: {_listed(IMAGING)} make an image, {_listed(RANGING)} "
                "ranges; at least one of the two is needed"
            )
        )
    if not instrument.images and instrument.exposure_time_s is not None:
        errors.append(InputError("exposure_time_s is that of patterns, and projector is missing"))
    return errors


def _listed(names: tuple[str, ...]) -> str:
    return f"{', '.join(names[:-1])} and {names[-1]}"


def _check_plan(instrument: Instrument) -> None:
    try:
        instrument.pattern_plan  # noqa: B018 - raises where there is no such plan
    except InputError as error:
        raise InputError(f"plan: {error}") from None


def _check_band(instrument: Instrument) -> None:
    try:
        instrument.daylight_irradiance(1.0)
    except InputError as error:
        raise InputError(f"filter.{error}") from None
    low, high = instrument.filter.band_nm
    if not low <= instrument.wavelength_nm <= high:
        raise InputError(
            f"wavelength_nm {instrument.wavelength_nm} is outside filter.band_nm, {low} to {high}"
        )
    spectrum = instrument.imaging.projector.spectrum if instrument.images else None
    if spectrum is not None and spectrum.fraction_within(instrument.filter.band_nm) < 1e-9:
        raise InputError(f"projector.spectrum has no light within filter.band_nm, {low} to {high}")


def _check_exposure(instrument: Instrument) -> None:
    exposure_time_s = instrument.imaging.exposure_time_s
    if exposure_time_s > instrument.pattern_period_s * (1 + 1e-9):
        raise InputError(
            f"exposure_time_s {exposure_time_s} is longer than a pattern's period "
            f"{instrument.pattern_period_s:.6g}, 1 / projector.pattern_rate_hz"
        )


def _check_settling(instrument: Instrument) -> None:
    """Patterns are over within their period."""
    projector, amplifier = instrument.imaging.projector, instrument.imaging.detector.amplifier
    times_s = {
        "projector.settling_time_s": projector.settling_time_s,
        "the time constant of detector.amplifier.bandwidth_hz,": (
            0.0 if amplifier is None else amplifier.time_constant_s
        ),
    }
    for name, time_s in times_s.items():
        if time_s * SETTLING_TIMES > instrument.pattern_period_s:
            raise InputError(
                f"{name} {time_s:.4g} s is too long for patterns of "
                f"{instrument.pattern_period_s:.4g} s, 1 / projector.pattern_rate_hz: at most "
                f"{instrument.pattern_period_s / SETTLING_TIMES:.4g} s"
            )


def _check_efficiency(instrument: Instrument) -> None:
    """One electron per photon at most."""
    low, _ = band = instrument.filter.band_nm
    for name, detector in instrument.detectors.items():
        sensor = detector.sensor
        if quantum_efficiency(sensor, np.linspace(*band, BAND_POINTS)).max() > 1:
            raise InputError(f"{name}.sensor.{sensor.too_efficient(low)}")


def _check_spots(instrument: Instrument) -> None:
    """A photodiode for each laser, or one for all."""
    spots = instrument.ranging.spots
    positions = len(instrument.ranging.tof.detector.positions_m)
    if positions not in (1, spots):
        raise InputError(
            f"tof.detector.positions_m has {positions} positions, lasers.directions_deg {spots} "
            f"spots; one photodiode for all, or {spots}, are possible"
        )


def _check_modulation(instrument: Instrument) -> None:
    """Modulated patterns are demodulated."""
    projector, _, detector, exposure_time_s = instrument.imaging
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
