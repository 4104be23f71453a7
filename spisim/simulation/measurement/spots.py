"""Light on the detectors of the spots, that of the lasers over path length."""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument, SpotLight
from spisim.instrument.model import Source
from spisim.simulation.drops import FallingDrops, on_spots
from spisim.simulation.light import Light, Transport


def spot_light(
    instrument: Instrument, light: Light, frames: int, drops: Sequence[FallingDrops] = ()
) -> SpotLight:
    """Rates from the fractions of emitted power that the light transport found.

    Falling drops change them by their mean over a frame.
    """
    ranging, keys = instrument.ranging, light.transports
    detector, zones = ranging.tof.detector, ranging.zones
    lengths, histograms = _over_the_same_lengths(keys)
    echoes = np.array(histograms)
    daylight, crosstalk = (
        np.array([getattr(key, name) for key in keys])
        for name in ("spot_daylight_w", "spot_crosstalk_w")
    )
    per_joule = instrument.electrons_per_joule(detector, "laser")
    change = on_spots(drops, lengths) if drops else None

    def during(start: float, stop: float) -> SpotLight:
        """Light in a part of each frame, or of each spot's turn in it."""
        turns = np.arange(ranging.spots if ranging.shared else 1)
        parts = [
            light.during(frames, *((turn + np.array([start, stop])) / turns.size)) for turn in turns
        ]

        def rate(values: Floats, source: Source) -> Floats:
            each = np.array_split(values, turns.size, axis=1)
            means = [part.means(own) for part, own in zip(parts, each, strict=True)]
            return np.concatenate(means, axis=1) * instrument.electrons_per_joule(detector, source)

        steady = rate(daylight, "daylight") + rate(crosstalk, "projector")
        echo = rate(echoes, "laser")
        if change is not None:
            seen = 1.0 if zones is None else zones.responses(detector.vignetting)[:, None]
            echo = echo * change.passed + seen * change.echo * per_joule
        if zones is not None:
            echo, steady = zones.mixing @ (echo * zones.overlap(lengths)), steady @ zones.mixing.T
            echo[..., 0] += zones.cover_glass * per_joule / ranging.spots
        return SpotLight(
            path_length_m=lengths,
            echo_per_s=echo * ranging.lasers.power_w,
            steady_per_s=steady + detector.sensor.dark_rate_hz,
            laser_power_w=ranging.lasers.power_w,
        )

    return replace(during(0.0, 1.0), of_part=during if len(keys) > 1 else None)


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
