"""Error of traced light relative to the noise of the detectors, which decides when to stop.

The noise share of a reading is the standard error of its light transport over the detector's noise:
photons, amplifier and converter, as in `spisim.budget`.
"""

from __future__ import annotations

from collections.abc import Mapping

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.operators import Decoder, PatternPlan, decoder_for, expose
from spisim.budget import collected_fraction, exposure_noise, ranging_noise
from spisim.instrument import Instrument
from spisim.transport.engine.sampling import ErrorMetric

#: Minimum variance of a reading, electrons²; avoids division by 0.
MIN_VARIANCE = 1e-12


def image_error_metric(instrument: Instrument, daylight_w: float) -> ErrorMetric:
    """Rms noise share of the decoded coefficients, for `image` sums.

    For a plan that cannot be decoded or is not orthogonal, it is that of the exposures.
    """
    plans = instrument.pattern_plans
    decoders = [_decoder(plan) for plan in plans]
    detector, time_s = instrument.imaging.detector, instrument.imaging.exposure_time_s
    per_joule = instrument.electrons_per_joule
    electrons = instrument.pixel_powers_w * (per_joule(detector, "projector") * time_s)
    dark_level = instrument.imaging.projector.dark_level
    others = {
        "daylight": np.asarray(daylight_w * per_joule(detector, "daylight") * time_s),
        "dark current": np.asarray(
            len(detector.positions_m) * detector.dark_electrons(time_s), dtype=np.float64
        ),
    }
    collected = collected_fraction(instrument)

    def readings(sums: Mapping[str, Floats]) -> Floats:
        image = sums["image"].reshape(electrons.shape) * electrons
        dark = dark_level * image.sum()
        exposed = [(1 - dark_level) * expose(plan, image) + dark for plan in plans]
        decoded = [
            each if decoder is None else decoder.decode(each)
            for each, decoder in zip(exposed, decoders, strict=True)
        ]
        return np.concatenate([*exposed, *decoded])

    def size(mean: Floats, error: Floats) -> float:
        exposures = np.split(mean, np.cumsum([plan.exposures for plan in plans]))[: len(plans)]
        variances = [
            _variance(
                decoder, exposure_noise(instrument, {"signal": each, **others}).total_variance
            )
            for each, decoder in zip(exposures, decoders, strict=True)
        ]
        errors = collected * error[sum(plan.exposures for plan in plans) :]
        return _fraction(errors, np.concatenate(variances))

    return ErrorMetric(readings, size)


def spot_error_metric(
    instrument: Instrument, daylight_w: Floats, crosstalk_w: Floats, phase_rad: Floats
) -> ErrorMetric:
    """Rms noise share of the spots' phasors, for `histogram` sums over path lengths.

    `phase_rad` (bins,) is the phase of the light, a turn for the longest unambiguous path. The
    noise of a phasor is that of four readings, one reading's over √2 in either part (Lange & Seitz,
    IEEE J. Quantum Electron. 37, 390 (2001)), with their contrast taken as one.
    """
    tof = instrument.ranging.tof
    per_joule = instrument.electrons_per_joule
    echo = per_joule(tof.detector, "laser") * instrument.ranging.lasers.power_w
    others = {
        "daylight": np.asarray(daylight_w * per_joule(tof.detector, "daylight")),
        "patterns": np.asarray(crosstalk_w * per_joule(tof.detector, "projector")),
        "dark current": np.asarray(tof.detector.sensor.dark_rate_hz, dtype=np.float64),
    }
    waves = np.stack([np.ones_like(phase_rad), np.cos(phase_rad), np.sin(phase_rad)])

    def readings(sums: Mapping[str, Floats]) -> Floats:
        return np.asarray(waves @ sums["histogram"].T * echo)  # (3, spots)

    def size(mean: Floats, error: Floats) -> float:
        noise = ranging_noise(instrument, {"signal": mean[0], **others})
        return _fraction(error[1:] * tof.reading.echo_s, noise.total_variance / 2)

    return ErrorMetric(readings, size)


def _decoder(plan: PatternPlan) -> Decoder | None:
    if not plan.patterns.orthogonal:
        return None
    try:
        return decoder_for(plan)
    except InputError:
        return None


def _variance(decoder: Decoder | None, variance: Floats) -> Floats:
    """Variance of coefficients, from that of the readings."""
    if decoder is None:
        return variance
    shared = decoder.shared_columns() ** 2 @ variance[decoder.shared]
    return np.asarray(decoder.own_variance(variance) + shared)


def _fraction(error: Floats, variance: Floats) -> float:
    return float(np.sqrt(np.mean(error**2 / np.maximum(variance, MIN_VARIANCE))))
