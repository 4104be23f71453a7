"""Recordings of one plane, as they are and changed."""

from dataclasses import replace
from functools import cache

import numpy as np

import spisim
from reconstruction import Capture

FRAMES = 8


@cache
def recorded(seed: int, method: str = "paper") -> Capture:
    """A tilted plane in clear air."""
    scene = spisim.load_scene("target-tilted-plane")
    instrument = spisim.load_instrument(method)
    return spisim.simulate(scene, instrument, spp=8, seed=seed, frames=FRAMES).capture


def scaled(capture: Capture, patterns: float, spots: float = 1.0, added: float = 0.0) -> Capture:
    """Readings over their offset times factors, and electrons more in each reading of a pattern."""
    buckets, taps = capture.buckets, capture.spots
    counts = (buckets.counts - buckets.offset_counts) * patterns + buckets.offset_counts
    counts = counts + added / buckets.electrons_per_count
    own = taps.taps
    modulated = own - own.mean(axis=-1, keepdims=True)
    return replace(
        capture,
        buckets=replace(buckets, counts=counts),
        spots=replace(taps, taps=own + (spots - 1) * (modulated + np.abs(modulated).mean())),
    )


def with_readings(capture: Capture, **changes) -> Capture:
    return replace(capture, buckets=replace(capture.buckets, **changes))
