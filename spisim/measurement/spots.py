"""The four spots: path lengths of the lasers' light, and all that falls onto their detectors."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from reconstruction.arrays import Floats
from spisim.instrument import Instrument, SpotLight
from spisim.transport import LightSequence
from spisim.transport.drops import FallingDrops, on_spots


def spot_light(
    instrument: Instrument,
    light: LightSequence,
    frames: int,
    drops: Sequence[FallingDrops] = (),
) -> SpotLight:
    """Rates from the fractions of emitted power that the light transport found.

    Falling drops change them by their mean over a frame.
    """
    detector = instrument.tof.detector
    between = light.between(instrument.exposure_times_s(frames))

    def rate(name: str, source: Any) -> Floats:
        values = np.array([getattr(key, name) for key in light.transports])
        per_watt = instrument.electrons_per_joule(detector, source)
        return between.means(values) * per_watt

    steady = rate("spot_daylight_w", "daylight") + rate("spot_crosstalk_w", "projector")
    lengths = light.transports[0].path_length_m
    echo = rate("spot_histogram", "laser")
    if drops:
        change = on_spots(drops, lengths)
        echo = echo * change.passed + change.echo * instrument.electrons_per_joule(
            detector, "laser"
        )
    return SpotLight(
        path_length_m=lengths,
        echo_per_s=echo * instrument.lasers.power_w,
        steady_per_s=steady + detector.sensor.dark_rate_hz,
        laser_power_w=instrument.lasers.power_w,
    )
