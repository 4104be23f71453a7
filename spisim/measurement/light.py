"""Mean photo-electrons of every reading: the light budget, before any noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from reconstruction.patterns import expose
from spisim.instrument import Instrument
from spisim.instrument.parts import Detector
from spisim.transport import Transport

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeanElectrons:
    """Mean electrons per reading of one frame, dark current and daylight included.

    `image` (H, W) is what each virtual pixel alone, fully on, adds to one exposure.
    """

    image: Floats
    buckets: Floats  # (M,)
    taps: Floats  # (4, taps)


def mean_electrons(instrument: Instrument, light: Transport) -> MeanElectrons:
    """Electrons from the fractions of emitted power that the light transport found."""
    image = light.image * (pixel_power_w(instrument) * bucket_gain(instrument))
    steady = light.daylight_w * bucket_gain(instrument)
    steady += instrument.detector.dark_electrons(instrument.exposure_time_s)
    return MeanElectrons(
        image=image,
        buckets=expose(instrument.pattern_plan, image) + steady,
        taps=_taps(instrument, light),
    )


def pixel_power_w(instrument: Instrument) -> float:
    """In-band power of one virtual pixel, fully on."""
    projector = instrument.projector
    height, width = projector.shape
    return projector.power_w * projector.in_band_fraction / (height * width)


def bucket_gain(instrument: Instrument) -> float:
    """Electrons per exposure and watt on the bucket detector's aperture."""
    return _electrons_per_joule(instrument, instrument.detector) * instrument.exposure_time_s


def _taps(instrument: Instrument, light: Transport) -> Floats:
    """Taps from path lengths: sinusoidal light of power 1 + m cos(2πft), rectangular windows.

    Light that travelled L arrives 2πfL/c late. A window of width x periods, centred on phase p,
    collects x · [1 + m sinc(x) cos(2πfL/c - p)] per period (Lange & Seitz, IEEE J. Quantum
    Electron. 37, 390 (2001)).
    """
    tof = instrument.tof
    frequency = tof.modulation_frequency_hz
    phase = 2 * np.pi * frequency / c * light.path_length_m
    window = 1 + tof.demodulation_contrast * np.cos(phase - tof.tap_phases_rad[:, None])
    gain = _electrons_per_joule(instrument, tof.detector) * tof.tap_time_s
    laser = instrument.lasers.power_w * light.spot_histogram @ window.T
    dark = tof.detector.dark_electrons(tof.tap_time_s)
    return np.asarray((laser + light.spot_daylight_w[:, None]) * gain + dark)


def _electrons_per_joule(instrument: Instrument, detector: Detector) -> float:
    """Electrons per joule on the aperture: through filter and lens onto the photodiode."""
    transmittance = instrument.filter.transmittance * detector.lens_transmittance
    return transmittance * detector.electrons_per_joule
