"""What a user should know before building an instrument."""

import numpy as np

from spisim.budget.eye_safety import safety_warnings
from spisim.budget.image import image_warnings
from spisim.budget.link import SpotLink, Target, bucket_link, spot_link
from spisim.instrument import Instrument

#: What ranging may take longer than the patterns, relative: whole numbers of periods seldom fit.
SLACK = 0.01


def budget_warnings(instrument: Instrument, target: Target) -> list[str]:
    """Sentences about what does not fit, for one target."""
    bucket, spots = bucket_link(instrument, target), spot_link(instrument, target)
    background = float(bucket.daylight_electrons + bucket.dark_electrons)
    return [
        *image_warnings(instrument, target),
        *_range_warnings(instrument, target, spots),
        *_bucket_warnings(instrument, background, background + float(bucket.signal_electrons)),
        *instrument.tof.warnings(float(spots.steady_per_s.max()), float(spots.echo_per_s.max())),
        *instrument_warnings(instrument),
    ]


def instrument_warnings(instrument: Instrument) -> list[str]:
    """Sentences about what does not fit, whatever the instrument looks at."""
    spots_s = instrument.tof.frame_time_s
    patterns_s = instrument.pattern_plan.exposures * instrument.pattern_period_s
    late = spots_s > patterns_s * (1 + SLACK)
    return [
        *safety_warnings(instrument),
        *(
            [
                f"the spots take {1e3 * spots_s:.3g} ms, longer than the {1e3 * patterns_s:.3g} ms "
                "of a frame's patterns: frames cannot follow one another without a pause"
            ]
            if late
            else []
        ),
    ]


def background_warnings(
    instrument: Instrument, bucket_electrons: float, spots_per_s: float
) -> list[str]:
    """Detectors that the background alone, all but lasers and image, overwhelms.

    Electrons of one exposure, and per second on the brightest of the ranging detectors.
    """
    return [
        *_bucket_warnings(instrument, bucket_electrons, bucket_electrons),
        *instrument.tof.warnings(spots_per_s, 0.0),
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


def _bucket_warnings(instrument: Instrument, background: float, whole: float) -> list[str]:
    """By the electrons of one exposure."""
    detector, modulation = instrument.detector, instrument.projector.modulation
    share = 1.0 if modulation is None else modulation.taps.share  # each tap has its own converter
    time_s = instrument.exposure_time_s
    return detector.sensor.warnings("detector", detector, time_s, share * background, share * whole)
