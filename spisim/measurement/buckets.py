"""The bucket readings: charge of a photodiode or counts of a single-photon diode."""

from __future__ import annotations

from typing import Any

import numpy as np

from reconstruction.capture import Buckets, PatternTaps
from spisim.instrument import Instrument, Modulation, Spad
from spisim.measurement.counting import dead_time_per_primary, draw_counts, expected_counts
from spisim.measurement.electronics import expected_readings, read_out
from spisim.measurement.light import BucketLight

Random = np.random.Generator | None

#: A counter this close to one count per dead time tells nothing about the light.
MOST_OF_FULL = 0.95


def record_buckets(
    instrument: Instrument, light: BucketLight, rng: Random
) -> tuple[Buckets, PatternTaps | None]:
    """Readings of every exposure, and the taps of each where the projector is modulated.

    Without `rng`: the expected readings of an ideal instrument, whose noise is unknown, so that
    reconstruction takes every reading at its word.
    """
    if isinstance(instrument.detector.sensor, Spad):
        return _counted(instrument, instrument.detector.sensor, light, rng), None
    modulation = instrument.projector.modulation
    if modulation is None:
        return _integrated(instrument, light, rng), None
    return _demodulated(instrument, modulation, light, rng)


def _integrated(instrument: Instrument, light: BucketLight, rng: Random) -> Buckets:
    detector, time_s = instrument.detector, instrument.exposure_time_s
    adc = detector.adc
    assert adc is not None
    if rng is None:
        readings, noise = expected_readings(light.buckets, adc, light.taken_off), np.nan
    else:
        amplifier = detector.amplifier_noise_electrons(time_s)
        readings = read_out(light.buckets, detector, amplifier, rng, light.taken_off)
        noise = detector.electronics_noise_electrons(time_s)
    return Buckets(
        counts=readings.counts,
        saturated=readings.saturated,
        **_timing(instrument),
        electrons_per_count=adc.electrons_per_count,
        offset_counts=float(adc.offset_counts),
        noise_electrons=noise,
        excess_noise_factor=detector.sensor.excess_noise_factor,
        dead_time_s=0.0,
        baseline_electrons=float(light.taken_off.mean()),
    )


def _counted(instrument: Instrument, sensor: Spad, light: BucketLight, rng: Random) -> Buckets:
    time_s, diodes = instrument.exposure_time_s, len(instrument.detector.positions_m)
    # Diodes in parallel share the light, and each has a dead time of its own.
    each = light.buckets / diodes
    if rng is None:
        counts: Any = diodes * expected_counts(each, sensor, time_s)
    else:
        counts = sum(draw_counts(each, sensor, time_s, rng) for _ in range(diodes))
    most = diodes * time_s / sensor.dead_time_s if sensor.dead_time_s > 0 else np.inf
    return Buckets(
        counts=counts,
        saturated=np.asarray(counts >= MOST_OF_FULL * most),
        **_timing(instrument),
        electrons_per_count=1 - sensor.afterpulse_probability,
        offset_counts=0.0,
        noise_electrons=np.nan if rng is None else 0.0,
        excess_noise_factor=sensor.excess_noise_factor,
        dead_time_s=dead_time_per_primary(sensor) / diodes,
    )


def _demodulated(
    instrument: Instrument, modulation: Modulation, light: BucketLight, rng: Random
) -> tuple[Buckets, PatternTaps]:
    """Each tap has a converter of its own; the bucket is their sum, formed by the recorder."""
    detector, adc = instrument.detector, instrument.detector.adc
    assert adc is not None
    assert light.taps is not None
    assert detector.amplifier is not None
    taps = light.taps.shape[-1]
    if rng is None:
        readings, noise = expected_readings(light.taps, adc), np.nan
    else:
        time_s = instrument.exposure_time_s * modulation.taps.noise_share
        readings = read_out(light.taps, detector, detector.amplifier_noise_electrons(time_s), rng)
        noise = detector.electronics_noise_electrons(time_s)
    frequency = modulation.frequencies_hz[0]
    offset = modulation.phase_offset_rad(frequency, detector.amplifier.response)
    charge: dict[str, Any] = {
        "electrons_per_count": adc.electrons_per_count,
        "excess_noise_factor": detector.sensor.excess_noise_factor,
    }
    buckets = Buckets(
        counts=readings.counts.sum(axis=-1, dtype=readings.counts.dtype),
        saturated=np.asarray(readings.saturated.any(axis=-1)),
        **_timing(instrument),
        **charge,
        offset_counts=float(taps * adc.offset_counts),
        noise_electrons=float(noise * np.sqrt(taps)),
        dead_time_s=0.0,
    )
    return buckets, PatternTaps(
        taps=readings.counts,
        saturated=readings.saturated,
        tap_frequencies_hz=np.full(taps, frequency),
        tap_phases_rad=modulation.taps.phases_rad,
        phase_offsets_rad=np.full(taps, offset),
        **charge,
        offset_counts=float(adc.offset_counts),
        noise_electrons=noise,
        detector_position_m=np.mean(detector.positions_m, axis=0),
    )


def _timing(instrument: Instrument) -> dict[str, float]:
    return {
        "exposure_time_s": instrument.exposure_time_s,
        "pattern_period_s": instrument.pattern_period_s,
    }
