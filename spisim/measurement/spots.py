"""The four spots: from path lengths of the lasers' light to what each method of ranging records."""

from __future__ import annotations

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c
from scipy.signal import lfilter

from reconstruction.capture import Spots
from reconstruction.capture.readings.cw import CwSpots
from reconstruction.capture.readings.dtof import HistogramSpots
from reconstruction.capture.readings.pulsed import PulsedSpots
from spisim.instrument import CwTof, DirectTof, Instrument, PulsedTof, Spad, TofDetector
from spisim.measurement.arrivals import tcspc_arrivals, threshold_arrivals
from spisim.measurement.electronics import expected_readings, read_out
from spisim.transport import LightSequence
from spisim.transport.drops import FallingDrops, on_spots

Floats = NDArray[np.float64]

#: Points of a pulse's wave form per window.
WAVE_POINTS = 2000
#: Where more cycles than this end with a photon, too few are left to tell late light from early.
MOST_OF_CYCLES = 0.99


@dataclass(frozen=True, eq=False)
class SpotLight:
    """What reaches the four ranging detectors, in primary electrons.

    `echo_per_s` (frames, 4, bins) is the rate per histogram bin of the path length
    `path_length_m` (bins,), for a laser that is on; `steady_per_s` (frames, 4) that of daylight,
    the projector's patterns and the dark current.
    """

    path_length_m: Floats
    echo_per_s: Floats
    steady_per_s: Floats


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
    in_frame = light.weights(instrument.exposure_times_s(frames)).mean(axis=1)  # (frames, keys)

    def rate(name: str, source: Any) -> Floats:
        values = np.array([getattr(key, name) for key in light.transports])
        per_watt = instrument.electrons_per_joule(detector, source)
        return np.asarray(np.tensordot(in_frame, values, 1) * per_watt)

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
    )


@singledispatch
def record_spots(
    tof: Any, light: SpotLight, directions: Floats, rng: np.random.Generator | None
) -> Spots:
    """What the ranging method `tof` records of the spots.

    Without `rng`: the expected readings of an ideal instrument, whose noise is unknown, so that
    reconstruction takes every reading at its word.
    """
    raise TypeError(f"no such method: {tof!r}")


@record_spots.register
def _(tof: CwTof, light: SpotLight, directions: Floats, rng: np.random.Generator | None) -> Spots:
    electrons = np.concatenate(
        [cw_taps(tof, light, frequency) for frequency in tof.modulation.frequencies_hz], axis=-1
    )
    modulation, response = tof.modulation, _response(tof.detector)
    frequencies = np.array(modulation.frequencies_hz)
    taps = modulation.taps.phases_rad
    offsets = [modulation.phase_offset_rad(frequency, response) for frequency in frequencies]
    tap_frequencies = np.repeat(frequencies, taps.size)
    times_s = tof.periods / tap_frequencies * modulation.taps.noise_share
    return CwSpots(
        **_common(tof.detector, directions),
        **_charge(tof.detector, electrons, times_s, rng),
        tap_frequencies_hz=tap_frequencies,
        tap_phases_rad=np.tile(taps, frequencies.size),
        phase_offsets_rad=np.repeat(offsets, taps.size),
        periods=tof.periods,
    )


def cw_taps(tof: CwTof, light: SpotLight, frequency_hz: float) -> Floats:
    """Mean electrons of the four taps at one frequency, (frames, 4, taps)."""
    phase = 2 * np.pi * frequency_hz / c * light.path_length_m
    modulation = tof.modulation
    window = modulation.correlation(phase, frequency_hz, _response(tof.detector))  # (taps, bins)
    steady = light.steady_per_s[..., None] * modulation.taps.share
    return np.asarray((light.echo_per_s @ window.T + steady) * tof.periods / frequency_hz)


@record_spots.register
def _(
    tof: PulsedTof, light: SpotLight, directions: Floats, rng: np.random.Generator | None
) -> Spots:
    time_s = tof.pulses * tof.pulse_width_s
    amplifier = tof.detector.amplifier
    return PulsedSpots(
        **_common(tof.detector, directions),
        **_charge(tof.detector, pulsed_windows(tof, light), time_s, rng),
        window_starts_s=np.array(tof.window_starts_s),
        pulse_width_s=tof.pulse_width_s,
        pulses=tof.pulses,
        delay_offset_s=0.0 if amplifier is None else amplifier.time_constant_s,
    )


def pulsed_windows(tof: PulsedTof, light: SpotLight) -> Floats:
    """Mean electrons of background, first and second window, (frames, 4, 3)."""
    collected = _collected(tof)
    starts = np.array(tof.window_starts_s)[:, None] - light.path_length_m / c  # (windows, bins)
    window = collected(starts + tof.pulse_width_s) - collected(starts)
    steady = light.steady_per_s[..., None] * tof.pulse_width_s
    return np.asarray((light.echo_per_s @ window.T + steady) * tof.pulses)


def _collected(tof: PulsedTof) -> Callable[[Floats], Floats]:
    """Time integral of the pulse's wave form behind the amplifier, of height one, up to a time."""
    width, amplifier = tof.pulse_width_s, tof.detector.amplifier
    pole_s = 0.0 if amplifier is None else amplifier.time_constant_s
    step = width / WAVE_POINTS
    times = np.arange(-2 * WAVE_POINTS, 6 * WAVE_POINTS) * step
    rise = max(tof.rise_time_s, step)
    edges = [np.clip(0.5 + (times - edge) / rise, 0, 1) for edge in (0.0, width)]
    pulse = edges[0] - edges[1]
    if pole_s > 0:
        decay = np.exp(-step / pole_s)
        pulse = lfilter([(1 - decay) / 2, (1 - decay) / 2], [1, -decay], pulse)
    sums = np.concatenate([[0.0], np.cumsum((pulse[1:] + pulse[:-1]) / 2)]) * step
    return lambda at: np.asarray(np.interp(at, times, sums))


@record_spots.register
def _(
    tof: DirectTof, light: SpotLight, directions: Floats, rng: np.random.Generator | None
) -> Spots:
    counts_photons = isinstance(tof.detector.sensor, Spad)
    stamp = tcspc_arrivals if counts_photons else threshold_arrivals
    chances = _chances(tof, light, stamp)
    if rng is None:
        counts: NDArray[Any] = tof.pulses * chances
    else:
        none = np.maximum(1 - chances.sum(axis=-1, keepdims=True), 0)
        cases = np.concatenate([chances, none], axis=-1)
        drawn = rng.multinomial(tof.pulses, cases / cases.sum(axis=-1, keepdims=True))
        counts = drawn[..., :-1].astype(np.int32)
    return HistogramSpots(
        **_common(tof.detector, directions),
        counts=counts,
        saturated=counts_photons & (chances.sum(axis=-1) > MOST_OF_CYCLES),
        bin_width_s=tof.bin_width_s,
        start_s=0.0,
        pulses=tof.pulses,
        response_sigma_s=tof.response_sigma_s,
        delay_offset_s=0.0,
        piles_up=counts_photons,
    )


def _chances(tof: DirectTof, light: SpotLight, stamp: Callable[..., Floats]) -> Floats:
    """Chances (frames, 4, bins) of a time stamp; the same light is not computed twice."""
    known: dict[bytes, Floats] = {}

    def chances(echo: Floats, steady: Any) -> Floats:
        key = echo.tobytes() + steady.tobytes()
        if key not in known:
            known[key] = stamp(tof, light.path_length_m, echo, float(steady))
        return known[key]

    return np.array(
        [
            [chances(*spot) for spot in zip(*frame, strict=True)]
            for frame in zip(light.echo_per_s, light.steady_per_s, strict=True)
        ]
    )


def _common(detector: TofDetector, directions: Floats) -> dict[str, Any]:
    return {"directions": directions, "detector_positions_m": detector.spot_positions_m}


def _charge(
    detector: TofDetector,
    electrons: Floats,
    time_s: float | Floats,
    rng: np.random.Generator | None,
) -> dict[str, Any]:
    """Readings of the windows (frames, 4, windows), which are open for `time_s`, each or all."""
    adc = detector.adc
    assert adc is not None
    if rng is None:
        readings, noise = expected_readings(electrons, adc), np.nan * np.asarray(time_s)
    else:
        readings = read_out(electrons, detector, detector.amplifier_noise_electrons(time_s), rng)
        noise = detector.electronics_noise_electrons(time_s)
    return {
        "taps": readings.counts,
        "saturated": readings.saturated,
        "electrons_per_count": adc.electrons_per_count,
        "offset_counts": float(adc.offset_counts),
        "noise_electrons": noise,
        "excess_noise_factor": detector.sensor.excess_noise_factor,
    }


def _response(detector: TofDetector) -> Callable[[Any], Any]:
    assert detector.amplifier is not None
    return detector.amplifier.response
