"""Warnings about an instrument before it is built."""

import numpy as np

from spisim.budget.eye_safety import safety_warnings
from spisim.budget.image import image_warnings
from spisim.budget.link import Target, bucket_link, spot_link
from spisim.instrument import Instrument

#: Relative excess of ranging over patterns: whole numbers of periods seldom fit.
SLACK = 0.01


def budget_warnings(instrument: Instrument, target: Target) -> list[str]:
    """Warnings about an instrument and one target, of plain numbers."""
    return [
        *(_image_warnings(instrument, target) if instrument.images else []),
        *(_range_warnings(instrument, target) if instrument.ranges else []),
        *instrument_warnings(instrument),
    ]


def instrument_warnings(instrument: Instrument) -> list[str]:
    """Warnings about an instrument, whatever the target."""
    return [*safety_warnings(instrument), *_timing_warnings(instrument)]


def _timing_warnings(instrument: Instrument) -> list[str]:
    if not (instrument.images and instrument.ranges):
        return []
    spots_s, patterns_s = instrument.ranging.frame_time_s, instrument.frame_time_s
    if spots_s <= patterns_s * (1 + SLACK):
        return []
    return [
        f"the spots take {1e3 * spots_s:.3g} ms, longer than the {1e3 * patterns_s:.3g} ms "
        "of a frame's patterns: frames cannot follow one another without a pause"
    ]


def background_warnings(
    instrument: Instrument, bucket_electrons: float, spots_per_s: float
) -> list[str]:
    """Warnings about detectors that the background alone saturates.

    Parameters
    ----------
    bucket_electrons : float
        Background electrons of one exposure.
    spots_per_s : float
        Background electrons per second on the brightest ranging detector.
    """
    warnings = []
    if instrument.images:
        warnings += _bucket_warnings(instrument, bucket_electrons, bucket_electrons)
    if instrument.ranges:
        warnings += instrument.ranging.tof.warnings(spots_per_s, 0.0)
    return warnings


def _image_warnings(instrument: Instrument, target: Target) -> list[str]:
    bucket = bucket_link(instrument, target)
    background = float(bucket.daylight_electrons + bucket.dark_electrons)
    return [
        *image_warnings(instrument, target),
        *_bucket_warnings(instrument, background, background + float(bucket.signal_electrons)),
    ]


def _range_warnings(instrument: Instrument, target: Target) -> list[str]:
    warnings = []
    link, tof = spot_link(instrument, target), instrument.ranging.tof
    longest = tof.unambiguous_range_m
    if float(np.max(link.path_m)) > 2 * longest:
        warnings.append(
            f"ranges at {target.distance_m:g} m are ambiguous: tof.method {tof.method} "
            f"resolves ranges up to {longest:.4g} m"
        )
    unseen = np.flatnonzero(link.echo_w == 0)
    if unseen.size:
        names = ", ".join(str(spot) for spot in unseen)
        warnings.append(
            f"at {target.distance_m:g} m spots {names} are beyond tof.detector.field_of_view_deg"
        )
    overflow = tof.warnings(float(link.steady_per_s.max()), float(link.echo_per_s.max()))
    return warnings + overflow


def _bucket_warnings(instrument: Instrument, background: float, whole: float) -> list[str]:
    """For the electrons of one exposure."""
    detector, modulation = instrument.imaging.detector, instrument.imaging.projector.modulation
    # each tap has its own converter
    fraction = 1.0 if modulation is None else modulation.taps.fraction
    time_s = instrument.imaging.exposure_time_s
    return detector.sensor.warnings(
        "detector", detector, time_s, fraction * background, fraction * whole
    )
