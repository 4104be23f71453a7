"""A range of every virtual pixel, from CW time of flight of every displayed pattern.

Light of one modulation frequency adds up as phasors A exp(i phi): the quadratures of a pattern's
taps are those of the sum over its lit pixels, and background, which is not modulated, is in
neither. So an image of phasors is decoded and reconstructed as one of light is, in complex numbers:
each atom that the pursuit takes is one for both quadratures, chosen by their joint energy (J. A.
Tropp, A. C. Gilbert, M. J. Strauss, Signal Processing 86, 572 (2006)).
"""

import numpy as np
from numpy.typing import NDArray

from ..capture import Optics
from ..decoding import decode
from ..depth import pixel_rays
from ..image import pursuit_for
from ..patterns import PatternPlan
from ..spots import PatternTaps
from .cw import quadrature_weights
from .geometry import range_from_path
from .ranges import LEAST_SIGNAL
from .unwrap import path_from_phases

Floats = NDArray[np.float64]


def dense_range(
    readings: PatternTaps, plan: PatternPlan, optics: Optics, frame: int = 0
) -> Floats | None:
    """Range (H, W) along each pixel's ray in metres; None if pattern 0, the level, is not usable.

    nan where the amplitude of a frequency is below LEAST_SIGNAL times its error, where the path is
    ambiguous (see `path_from_phases`) or no longer than the way from projector to detector.
    """
    frequencies = np.unique(readings.tap_frequencies_hz)
    usable = ~readings.saturated[frame].any(axis=-1)
    images, errors = [], []
    for frequency in frequencies:
        signal, variance = phasors(readings, frame, frequency)
        index, coefficients, noise = decode(plan, signal, variance, usable)
        if 0 not in index:
            return None
        pursuit = pursuit_for(plan.shape, index)
        images.append(pursuit.reconstruct(coefficients, noise))
        errors.append(pursuit.error(coefficients, noise) / np.sqrt(2))  # of each quadrature
    image = np.stack(images)
    error = np.maximum(errors, 1e-9 * np.abs(image).max())[:, None, None]  # no less than rounding
    sigmas = error / np.maximum(np.abs(image), error)
    path, _, ambiguous = path_from_phases(np.angle(image), sigmas, frequencies)

    rays = pixel_rays(optics, plan.shape)
    rays /= np.linalg.norm(rays, axis=-1, keepdims=True)
    position = readings.detector_position_m
    range_m, _ = range_from_path(path, rays, position)
    dark = (sigmas > 1 / LEAST_SIGNAL).any(axis=0)
    return np.where(dark | ambiguous | (path <= np.linalg.norm(position)), np.nan, range_m)


def phasors(
    readings: PatternTaps, frame: int, frequency_hz: float
) -> tuple[NDArray[np.complex128], Floats]:
    """A exp(i phi) of each exposure (M,) in electrons, and the variance of both parts together."""
    of = readings.tap_frequencies_hz == frequency_hz
    electrons = readings.electrons(readings.taps[frame][:, of])
    variance = readings.variance(np.abs(electrons))  # a difference holds at least as much light
    phases = readings.tap_phases_rad[of] - readings.phase_offsets_rad[of]
    _, cosine, sine = quadrature_weights(phases)
    return electrons @ (cosine + 1j * sine), variance @ (cosine**2 + sine**2)
