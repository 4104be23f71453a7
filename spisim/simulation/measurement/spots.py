"""Light on the detectors of the spots, that of the lasers over path length."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument, SpotLight
from spisim.simulation.drops import FallingDrops, on_spots
from spisim.simulation.light import Light, Transport


def spot_light(
    instrument: Instrument, light: Light, frames: int, drops: Sequence[FallingDrops] = ()
) -> SpotLight:
    """Rates from the fractions of emitted power that the light transport found.

    Falling drops change them by their mean over a frame.
    """
    detector = instrument.ranging.tof.detector
    between = light.between(instrument.exposure_times_s(frames))

    def rate(values: Sequence[Floats], source: Any) -> Floats:
        per_watt = instrument.electrons_per_joule(detector, source)
        return between.means(np.array(values)) * per_watt

    keys = light.transports
    steady = rate([key.spot_daylight_w for key in keys], "daylight")
    steady = steady + rate([key.spot_crosstalk_w for key in keys], "projector")
    lengths, histograms = _over_the_same_lengths(keys)
    echo, per_joule = rate(histograms, "laser"), instrument.electrons_per_joule(detector, "laser")
    zones = instrument.ranging.zones
    if drops:
        change = on_spots(drops, lengths)
        seen = 1.0 if zones is None else zones.responses(detector.vignetting)[:, None]
        echo = echo * change.passed + seen * change.echo * per_joule
    if zones is not None:
        echo, steady = zones.mixing @ (echo * zones.overlap(lengths)), steady @ zones.mixing.T
        echo[..., 0] += zones.cover_glass * per_joule / instrument.ranging.spots
    return SpotLight(
        path_length_m=lengths,
        echo_per_s=echo * instrument.ranging.lasers.power_w,
        steady_per_s=steady + detector.sensor.dark_rate_hz,
        laser_power_w=instrument.ranging.lasers.power_w,
    )


def _over_the_same_lengths(keys: Sequence[Transport]) -> tuple[Floats, list[Floats]]:
    """Common path lengths (bins,) of all key times, and the light (spots, bins) of each."""
    first = keys[0].path_length_m
    if all(np.array_equal(key.path_length_m, first) for key in keys):
        return first, [key.spot_histogram for key in keys]
    lengths = np.unique(np.concatenate([key.path_length_m for key in keys]))
    histograms = [np.zeros((len(key.spot_histogram), lengths.size)) for key in keys]
    for histogram, key in zip(histograms, keys, strict=True):
        histogram[:, np.searchsorted(lengths, key.path_length_m)] = key.spot_histogram
    return lengths, histograms
