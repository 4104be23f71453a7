"""Bucket readings, one per exposure or one per tap."""

import numpy as np
from scipy.constants import elementary_charge

from reconstruction.base.arrays import Floats
from reconstruction.capture import Buckets, PatternTaps
from spisim.instrument import Instrument, Modulation
from spisim.instrument.flicker import flicker_electrons
from spisim.simulation.measurement.electronics import drifting_current_a
from spisim.simulation.measurement.light import BucketLight

Random = np.random.Generator | None

MAX_INT32 = np.iinfo(np.int32).max


def record_buckets(
    instrument: Instrument, light: BucketLight, rng: Random, first: int = 0
) -> tuple[Buckets, PatternTaps | None]:
    """Readings of every exposure, and the taps of each where the projector is modulated.

    `first` is the index of the first frame, before which currents have drifted.

    Without `rng`, they are the expected readings of an ideal instrument with unknown noise, which
    the reconstruction trusts completely. Taps state the noise of a real reading, as spots do.
    """
    modulation = instrument.imaging.projector.modulation
    if modulation is not None:
        return _demodulated(instrument, modulation, light, rng, first)
    taken_off = light.taken_off - _drifting(instrument, light, rng, first)
    readings = instrument.imaging.detector.read(
        light.buckets, instrument.imaging.exposure_time_s, rng, taken_off
    )
    buckets = Buckets(
        counts=readings.counts,
        saturated=readings.saturated,
        **_timing(instrument),
        **readings.charge | _noise(instrument, readings.noise_electrons, rng),
        dead_time_s=readings.dead_time_s,
        baseline_electrons=float(light.taken_off.mean()),
    )
    return buckets, None


def _demodulated(
    instrument: Instrument, modulation: Modulation, light: BucketLight, rng: Random, first: int
) -> tuple[Buckets, PatternTaps]:
    """Each tap has a converter of its own; the bucket is their sum, formed by the recorder."""
    detector = instrument.imaging.detector
    assert detector.adc is not None
    assert detector.amplifier is not None
    assert light.taps is not None
    taps = light.taps.shape[-1]
    time_s = instrument.imaging.exposure_time_s * modulation.taps.noise_share
    drifting = _drifting(instrument, light, rng, first)[..., None] * modulation.taps.fraction
    readings = detector.read(light.taps, time_s, rng, -drifting)
    frequency = modulation.frequencies_hz[0]
    offset = modulation.phase_offset_rad(frequency, detector.amplifier.response)
    fits = taps * detector.adc.max_count <= MAX_INT32
    buckets = Buckets(
        counts=readings.counts.sum(axis=-1, dtype=readings.counts.dtype if fits else np.float64),
        saturated=np.asarray(readings.saturated.any(axis=-1)),
        **_timing(instrument),
        electrons_per_count=readings.electrons_per_count,
        offset_counts=taps * readings.offset_counts,
        **_noise(
            instrument,
            readings.noise_electrons * np.sqrt(taps),
            rng,
            taps * modulation.taps.fraction,
        ),
        excess_noise_factor=readings.excess_noise_factor,
        dead_time_s=0.0,
    )
    return buckets, PatternTaps(
        taps=readings.counts,
        saturated=readings.saturated,
        tap_frequencies_hz=np.full(taps, frequency),
        tap_phases_rad=modulation.taps.phases_rad,
        phase_offsets_rad=np.full(taps, offset),
        **readings.charge,
        detector_position_m=np.mean(detector.positions_m, axis=0),
    )


def _drifting(instrument: Instrument, light: BucketLight, rng: Random, first: int) -> Floats:
    """Primary electrons (frames, M) of the amplifier's 1/f noise and drift."""
    detector, time_s = instrument.imaging.detector, instrument.imaging.exposure_time_s
    if rng is None or detector.amplifier is None:
        return np.zeros_like(light.buckets)
    frames, exposures = light.buckets.shape
    current_a = drifting_current_a(
        detector.amplifier,
        frames * exposures,
        instrument.pattern_period_s,
        time_s,
        rng,
        first * exposures,
    )
    electrons = current_a * time_s / (elementary_charge * detector.sensor.gain)
    return np.asarray(electrons.reshape(light.buckets.shape))


def _noise(
    instrument: Instrument, white: float, rng: Random, collected: float = 1.0
) -> dict[str, float]:
    """Noise of a reading, from its white part and the fraction of an exposure that it collects."""
    if rng is None:
        return {"noise_electrons": np.nan}
    flicker = collected * flicker_electrons(instrument)
    return {"noise_electrons": float(np.hypot(white, flicker))}


def _timing(instrument: Instrument) -> dict[str, float]:
    return {
        "exposure_time_s": instrument.imaging.exposure_time_s,
        "pattern_period_s": instrument.pattern_period_s,
    }
