"""What a user should know before building an instrument."""

from __future__ import annotations

import numpy as np

from spisim.budget.eye_safety import safety_warnings
from spisim.budget.link import BucketLink, SpotLink, Target, bucket_link, spot_link
from spisim.budget.noise import reading_of
from spisim.instrument import Detector, Instrument, Spad

#: Detections per dead time, or per gate, from which on a counter falls behind.
PILE_UP = 0.05


def budget_warnings(instrument: Instrument, target: Target) -> list[str]:
    """Sentences about what does not fit, for one target."""
    bucket, spots = bucket_link(instrument, target), spot_link(instrument, target)
    return [
        *_range_warnings(instrument, target, spots),
        *_bucket_warnings(instrument, bucket),
        *_spot_warnings(instrument, spots),
        *safety_warnings(instrument),
    ]


def _range_warnings(instrument: Instrument, target: Target, link: SpotLink) -> list[str]:
    warnings = []
    longest = instrument.tof.unambiguous_range_m
    if float(np.max(link.path_m)) > 2 * longest:
        warnings.append(
            f"ranges at {target.distance_m:g} m are ambiguous: tof.method {instrument.tof.method} "
            f"tells ranges apart up to {longest:.4g} m"
        )
    unseen = np.flatnonzero(link.echo_w == 0)
    if unseen.size:
        names = ", ".join(str(spot) for spot in unseen)
        warnings.append(
            f"at {target.distance_m:g} m spots {names} are beyond tof.detector.field_of_view_deg"
        )
    return warnings


def _bucket_warnings(instrument: Instrument, link: BucketLink) -> list[str]:
    detector = instrument.detector
    background = float(link.daylight_electrons + link.dark_electrons)
    whole = background + float(link.signal_electrons)
    if isinstance(detector.sensor, Spad):
        each_per_s = whole / len(detector.positions_m) / instrument.exposure_time_s
        blind = each_per_s * detector.sensor.dead_time_s
        return [] if blind < PILE_UP else [_blind(blind)]
    amplifier = detector.amplifier
    if amplifier is not None and amplifier.coupling == "ac":
        return []  # only changes reach the converter
    return _converter_warnings("detector", detector, background, whole)


def _spot_warnings(instrument: Instrument, link: SpotLink) -> list[str]:
    tof = instrument.tof
    if isinstance(tof.detector.sensor, Spad):
        assert tof.method == "dtof"
        first = float(np.max(link.steady_per_s * tof.gate_s))
        return [] if first < PILE_UP else [_pile_up(first)]
    if tof.method == "dtof":
        return []
    reading = reading_of(tof)
    background = float(np.max(link.steady_per_s * reading.steady_s))
    swing = 2.0 if tof.method == "cw" else 1.0
    whole = background + swing * float(np.max(link.echo_per_s * reading.echo_s))
    return _converter_warnings("tof.detector", tof.detector, background, whole)


def _pile_up(first: float) -> str:
    return (
        f"tof.detector fires {first:.2g} times per gate without any echo, which hides later "
        f"arrivals; below {PILE_UP:g} it would not"
    )


def _blind(detections: float) -> str:
    return (
        f"detector would fire {detections:.2g} times in a dead time, and counts fall behind; "
        f"below {PILE_UP:g} they would not"
    )


def _converter_warnings(
    name: str, detector: Detector, background: float, whole: float
) -> list[str]:
    assert detector.adc is not None
    room = detector.adc.headroom_electrons
    if background > room:
        return [
            f"{name}.adc holds {room:.3g} electrons, and daylight and dark current alone are "
            f"{background:.3g}: every reading saturates"
        ]
    if whole > room:
        return [
            f"{name}.adc holds {room:.3g} electrons, and signal and background together are "
            f"{whole:.3g}: bright readings saturate"
        ]
    return []
