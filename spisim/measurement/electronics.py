"""Noise and conversion: from mean electrons to what the ADC reports."""

from __future__ import annotations

from typing import Any, NamedTuple

import numpy as np
from numpy.typing import NDArray

from spisim.instrument.parts import Detector

Floats = NDArray[np.float64]


class Readings(NamedTuple):
    """Counts (frames, ...) of one detector channel."""

    counts: NDArray[Any]
    saturated: NDArray[np.bool_]  # clipped at either end of the converter's range
    noise_electrons: float  # rms of amplifier and converter, per reading; nan if there is none


def read_out(
    mean_electrons: Floats,
    detector: Detector,
    window_s: float,
    frames: int,
    rng: np.random.Generator,
) -> Readings:
    """Draw `frames` recordings of the mean charges.

    Signal, daylight and dark current arrive as one Poisson process; the amplifier adds Gaussian
    charge noise, white over the window; the converter rounds and clips.
    """
    shape = (frames, *mean_electrons.shape)
    amplifier = detector.amplifier_noise_electrons(window_s)
    electrons = rng.poisson(mean_electrons, shape) + rng.normal(0, amplifier, shape)
    adc = detector.adc
    counts = np.rint(electrons / adc.electrons_per_count + adc.offset_counts)
    return Readings(
        counts=np.clip(counts, 0, adc.max_count).astype(np.int32),
        saturated=(counts <= 0) | (counts >= adc.max_count),
        noise_electrons=float(np.hypot(amplifier, adc.quantisation_noise_electrons)),
    )


def expected_readings(mean_electrons: Floats, detector: Detector, frames: int) -> Readings:
    """What an ideal instrument would report: no noise, no steps, no end of range.

    Its noise is marked unknown, so that reconstruction takes every reading at its word.
    """
    adc = detector.adc
    counts = mean_electrons / adc.electrons_per_count + adc.offset_counts
    repeated = np.repeat(counts[None], frames, axis=0)
    return Readings(repeated, np.zeros(repeated.shape, dtype=np.bool_), np.nan)
