"""Mean photo-electrons of every reading: the light budget, before any noise."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from reconstruction.patterns import expose
from spisim.instrument import Instrument
from spisim.instrument.parts import Detector
from spisim.measurement.sequence import LightSequence, exposure_times_s
from spisim.transport import Transport

Floats = NDArray[np.float64]


@dataclass(frozen=True, eq=False)
class MeanElectrons:
    """Mean electrons per reading, dark current and daylight included.

    `image` (H, W) is what each virtual pixel alone, fully on, adds to one exposure, on average
    over the first frame; `image_error` the standard error of the light transport in it.
    """

    image: Floats
    image_error: Floats
    buckets: Floats  # (frames, M)
    taps: Floats  # (frames, 4, taps)


def mean_electrons(instrument: Instrument, light: LightSequence, frames: int) -> MeanElectrons:
    """Electrons from the fractions of emitted power that the light transport found."""
    electrons = instrument.pixel_powers_w * bucket_gain(instrument)
    shares = light.weights(exposure_times_s(instrument, frames))  # (frames, M, keys)
    images = np.array([key.image for key in light.transports]) * electrons
    errors = np.array([key.image_error for key in light.transports]) * electrons
    steady = np.array([key.daylight_w for key in light.transports]) * bucket_gain(instrument)
    steady += instrument.detector.dark_electrons(instrument.exposure_time_s)
    readings = expose(instrument.pattern_plan, images) + steady[:, None]  # (keys, M)
    taps = np.array([_taps(instrument, key) for key in light.transports])
    in_frame = shares.mean(axis=1)  # (frames, keys)
    return MeanElectrons(
        image=np.tensordot(in_frame[0], images, 1),
        image_error=np.tensordot(in_frame[0], errors, 1),
        buckets=np.einsum("fmk,km->fm", shares, readings),
        taps=np.tensordot(in_frame, taps, 1),
    )


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
    steady = light.spot_daylight_w + light.spot_crosstalk_w
    return np.asarray((laser + steady[:, None]) * gain + dark)


def _electrons_per_joule(instrument: Instrument, detector: Detector) -> float:
    """Electrons per joule on the aperture: through filter and lens onto the photodiode."""
    transmittance = instrument.filter.transmittance * detector.lens_transmittance
    return transmittance * detector.electrons_per_joule
