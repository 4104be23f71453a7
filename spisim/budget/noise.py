"""Noise of a reading by source.

Light and dark current are Poisson processes, whose variance an avalanche multiplies by its excess
noise factor F; amplifier and converter add theirs. Everything is in primary electrons. Not valid
for single-photon diodes near saturation, whose dead time makes counts sub-Poissonian.
"""

from collections.abc import Mapping
from dataclasses import dataclass

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.budget.link import BucketLink, SpotLink
from spisim.instrument import Detector, Instrument
from spisim.instrument.demodulation import TAPS
from spisim.instrument.flicker import flicker_electrons

#: Sources of noise in the order of tables and plots: shot noise first, electronics last.
SOURCES = ("signal", "daylight", "patterns", "dark current", "amplifier", "ADC")


@dataclass(frozen=True, eq=False)
class NoiseBudget:
    """Mean signal of one reading, and variance by source, electrons² (...)."""

    signal_electrons: Floats
    variances: Mapping[str, Floats]

    @property
    def total_variance(self) -> Floats:
        """Total variance, electrons² (...)."""
        return np.asarray(sum(self.variances.values()))

    @property
    def total_electrons(self) -> Floats:
        """Rms noise (...)."""
        return np.sqrt(self.total_variance)

    @property
    def snr(self) -> Floats:
        """Signal over rms noise (...)."""
        return np.asarray(self.signal_electrons / self.total_electrons)

    @property
    def dominating(self) -> tuple[str, float]:
        """The largest source of a single reading, and its fraction of the variance."""
        totals = {name: float(np.sum(variance)) for name, variance in self.variances.items()}
        name = max(totals, key=lambda source: totals[source])
        return name, totals[name] / sum(totals.values())


def bucket_noise(instrument: Instrument, link: BucketLink) -> NoiseBudget:
    """Noise of one exposure with all pixels on; of the sum over the taps if modulated."""
    return exposure_noise(
        instrument,
        {
            "signal": link.signal_electrons,
            "daylight": link.daylight_electrons,
            "dark current": np.asarray(link.dark_electrons),
        },
    )


def exposure_noise(instrument: Instrument, electrons: Mapping[str, Floats]) -> NoiseBudget:
    """Noise of exposures with these mean electrons (...) by source; see `bucket_noise`.

    1/f noise counts as white noise of the amplifier that adds as much to coefficients.
    """
    modulation = instrument.imaging.projector.modulation
    taps = None if modulation is None else modulation.taps
    conversions, noise_share = (1, 1.0) if taps is None else (TAPS, TAPS * taps.noise_share)
    collected = collected_fraction(instrument)
    light = {name: collected * mean for name, mean in electrons.items()}
    time_s = noise_share * instrument.imaging.exposure_time_s
    flicker = collected * flicker_electrons(instrument)
    return _noise(
        instrument.imaging.detector, light, time_s, conversions=conversions, flicker=flicker
    )


def collected_fraction(instrument: Instrument) -> float:
    """Fraction of an exposure's light that all taps together collect; 1 without modulation."""
    modulation = instrument.imaging.projector.modulation
    return 1.0 if modulation is None else TAPS * modulation.taps.fraction


def spot_noise(instrument: Instrument, link: SpotLink) -> NoiseBudget:
    """Noise of one reading (`Tof.reading`) of the ranging detectors (..., spots)."""
    return ranging_noise(
        instrument,
        {
            "signal": link.echo_per_s,
            "daylight": link.daylight_per_s,
            "patterns": link.patterns_per_s,
            "dark current": np.asarray(link.dark_per_s),
        },
    )


def ranging_noise(instrument: Instrument, electrons_per_s: Mapping[str, Floats]) -> NoiseBudget:
    """Noise of readings at these mean rates (..., spots) by source; see `spot_noise`."""
    reading = instrument.ranging.tof.reading
    light = {
        name: rate * (reading.echo_s if name == "signal" else reading.steady_s)
        for name, rate in electrons_per_s.items()
    }
    detector = instrument.ranging.tof.detector
    return _noise(detector, light, reading.amplifier_s, conversions=int(reading.converted))


def _noise(
    detector: Detector,
    light: Mapping[str, Floats],
    amplifier_s: float,
    *,
    conversions: int,
    flicker: float = 0.0,
) -> NoiseBudget:
    excess = detector.sensor.excess_noise_factor
    electronics = {}
    if detector.amplifier is not None:
        electronics["amplifier"] = np.hypot(
            detector.amplifier_noise_electrons(amplifier_s), flicker
        )
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
