"""Which noise a reading has, source by source.

Light and dark current arrive as Poisson processes, and an avalanche multiplies their variance by
its excess noise factor F; amplifier and converter add theirs. Everything is in primary electrons.
Breaks for single-photon diodes near saturation, whose dead time makes counts more regular than
Poisson's.
"""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from functools import singledispatch
from typing import Any

import numpy as np
from numpy.typing import NDArray

from spisim.budget.link import BucketLink, SpotLink
from spisim.instrument import CwTof, Detector, DirectTof, Instrument, PulsedTof, Spad
from spisim.instrument.demodulation import TAPS

Floats = NDArray[np.float64]

#: Sources of noise, in the order of tables and pictures: shot noise first, electronics last.
SOURCES = ("signal", "daylight", "patterns", "dark current", "amplifier", "ADC")


@dataclass(frozen=True, eq=False)
class NoiseBudget:
    """One reading: mean signal, and variance by source in electrons² (...)."""

    signal_electrons: Floats
    variances: Mapping[str, Floats]

    @property
    def total_electrons(self) -> Floats:
        """Rms noise (...)."""
        return np.sqrt(np.asarray(sum(self.variances.values())))

    @property
    def snr(self) -> Floats:
        """Signal over rms noise (...)."""
        return np.asarray(self.signal_electrons / self.total_electrons)

    @property
    def dominating(self) -> tuple[str, float]:
        """The largest source of a single reading, and its share of the variance."""
        totals = {name: float(np.sum(variance)) for name, variance in self.variances.items()}
        name = max(totals, key=lambda source: totals[source])
        return name, totals[name] / sum(totals.values())


@dataclass(frozen=True)
class Reading:
    """What one reading of a ranging detector collects: for how long light, echo and amplifier.

    `echo_s` is the time for which a laser that is on would have to shine to leave as much.
    """

    steady_s: float
    echo_s: float
    amplifier_s: float
    converted: bool  # by an ADC


def bucket_noise(instrument: Instrument, link: BucketLink) -> NoiseBudget:
    """Noise of one exposure with all pixels on; of modulated ones, of the sum over the taps."""
    modulation = instrument.projector.modulation
    taps = None if modulation is None else modulation.taps
    conversions, share, noise_share = (
        (1, 1.0, 1.0) if taps is None else (TAPS, TAPS * taps.share, TAPS * taps.noise_share)
    )
    light = {
        "signal": share * link.signal_electrons,
        "daylight": share * link.daylight_electrons,
        "dark current": np.asarray(share * link.dark_electrons),
    }
    time_s = noise_share * instrument.exposure_time_s
    return _noise(instrument.detector, light, time_s, conversions=conversions)


def spot_noise(instrument: Instrument, link: SpotLink) -> NoiseBudget:
    """Noise of one reading of the ranging detectors (..., 4).

    That is one tap of the lowest frequency (cw), one window, the echo in it entirely (pulsed), all
    time stamps within the width of the response (dtof with a single-photon diode) or the current
    of one pulse at its peak, as charge within half the amplifier's reciprocal bandwidth (dtof with
    a threshold).
    """
    reading = reading_of(instrument.tof)
    light = {
        "signal": link.echo_per_s * reading.echo_s,
        "daylight": link.daylight_per_s * reading.steady_s,
        "patterns": link.patterns_per_s * reading.steady_s,
        "dark current": np.asarray(link.dark_per_s * reading.steady_s),
    }
    detector = instrument.tof.detector
    return _noise(detector, light, reading.amplifier_s, conversions=int(reading.converted))


@singledispatch
def reading_of(tof: Any) -> Reading:
    """Times of one reading of a ranging method."""
    raise TypeError(f"no such method: {tof!r}")


@reading_of.register
def _(tof: CwTof) -> Reading:
    return cw_reading(tof, min(tof.modulation.frequencies_hz))


def cw_reading(tof: CwTof, frequency_hz: float) -> Reading:
    """Times of one tap at a frequency; the echo's is its mean over all phases."""
    time_s = tof.tap_time_s(frequency_hz)
    periods_s = tof.periods / frequency_hz
    return Reading(time_s, time_s, periods_s * tof.modulation.taps.noise_share, converted=True)


@reading_of.register
def _(tof: PulsedTof) -> Reading:
    time_s = tof.pulses * tof.pulse_width_s
    return Reading(time_s, time_s, time_s, converted=True)


@reading_of.register
def _(tof: DirectTof) -> Reading:
    if isinstance(tof.detector.sensor, Spad):
        widths = np.sqrt(2 * np.pi) * tof.pulses * np.array([tof.response_sigma_s, 1.0])
        return Reading(widths[0], widths[1] * tof.pulse_sigma_s, 0.0, converted=False)
    time_s = threshold_time_s(tof)
    return Reading(time_s, time_s * peak_share(tof), time_s, converted=False)


def threshold_time_s(tof: DirectTof) -> float:
    """Window whose charge is as noisy as a current in the amplifier's bandwidth B: 1 / 2B."""
    amplifier = tof.detector.amplifier
    assert amplifier is not None
    assert amplifier.bandwidth_hz is not None
    return 1 / (2 * amplifier.bandwidth_hz)


def peak_share(tof: DirectTof) -> float:
    """Height of the pulse behind the amplifier over that in front: it keeps its charge."""
    return tof.pulse_sigma_s / tof.amplified_sigma_s


def _noise(
    detector: Detector, light: Mapping[str, Floats], amplifier_s: float, *, conversions: int
) -> NoiseBudget:
    excess = detector.sensor.excess_noise_factor
    electronics = {}
    if detector.amplifier is not None:
        electronics["amplifier"] = detector.amplifier_noise_electrons(amplifier_s)
    if detector.adc is not None and conversions:
        steps = detector.adc.quantisation_noise_electrons
        electronics["ADC"] = steps * float(np.sqrt(conversions))
    shape = np.broadcast_shapes(*(np.shape(mean) for mean in light.values()))
    variances = {name: excess * mean for name, mean in light.items()}
    variances |= {name: np.asarray(rms**2) for name, rms in electronics.items()}
    return NoiseBudget(
        signal_electrons=np.broadcast_to(light["signal"], shape),
        variances={
            name: np.broadcast_to(variances[name], shape) for name in SOURCES if name in variances
        },
    )
