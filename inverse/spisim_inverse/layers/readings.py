"""Readings of patterns on a transport image, and their vector-Jacobian products.

A reading is linear in the displayed pattern p and in the transport image x,

    y_k = sum_u (d + (1 - d) p_k(u)) e(u) x(u) + b,

with the electrons e(u) of one exposure if all light of a virtual pixel arrived, the leakage d of
pixels that are off, and the background b. Where the electronics settle slowly, a reading holds a
fraction c of its predecessor, the first that of the last. Counting adds noise of the variance
F y + s^2, of electrons with the excess noise factor F and of the electronics. Readings are many
electrons, so it is drawn as sqrt(F y + s^2) times a normal number, through which the derivative of
the noise goes back, too (D. P. Kingma, M. Welling, ICLR 2014).

The functions are arithmetic that the arrays of NumPy, PyTorch and JAX share. Each comes with the
product of a gradient by its results and its Jacobian.
"""

import math
from dataclasses import dataclass
from typing import Any, Self

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.instrument import Instrument
from spisim.instrument.flicker import flicker_electrons
from spisim.simulation.measurement.light import (
    background_electrons,
    carried_fraction,
    pixel_electrons,
)

Array = Any
"""An array of NumPy, PyTorch or JAX."""


@dataclass(frozen=True, eq=False)
class ReadingModel:
    """What makes electrons of patterns and a transport image.

    Parameters
    ----------
    electrons
        Electrons (H, W) of one exposure for a pixel that is on, if all its light arrived.
    dark_level
        Leakage d of pixels that are off.
    background
        Electrons b of one exposure from daylight and dark current.
    carried
        Fraction c of a reading that belongs to the one before.
    noise_electrons
        Standard deviation s of the electronics, rounding included.
    excess_noise_factor
        Variance F that one detected electron adds.
    """

    electrons: Array
    dark_level: float = 0.0
    background: float = 0.0
    carried: float = 0.0
    noise_electrons: float = 0.0
    excess_noise_factor: float = 1.0

    @classmethod
    def of(cls, instrument: Instrument, daylight_w: float = 0.0) -> Self:
        """Model of an instrument, in so much daylight on its bucket detector.

        Parameters
        ----------
        instrument
            Of a photodiode with DC coupling, and a projector that is not modulated.
        daylight_w
            In-band power on the apertures, `Transport.daylight_w`.

        Raises
        ------
        InputError
            For an instrument whose readings are not differentiable here, naming the field; and
            unless `daylight_w` is finite and at least 0.
        """
        if not 0 <= daylight_w < np.inf:
            raise InputError(f"daylight_w = {daylight_w:g}: must be finite and at least 0")
        _require_linear(instrument)
        detector, time_s = instrument.imaging.detector, instrument.imaging.exposure_time_s
        dark_level = instrument.imaging.projector.dark_level
        return cls(
            electrons=pixel_electrons(instrument) / (1 - dark_level),
            dark_level=dark_level,
            background=float(background_electrons(instrument, daylight_w)),
            carried=carried_fraction(instrument),
            noise_electrons=math.hypot(
                detector.electronics_noise_electrons(time_s), flicker_electrons(instrument)
            ),
            excess_noise_factor=detector.sensor.excess_noise_factor,
        )


def _require_linear(instrument: Instrument) -> None:
    """Refuse what makes readings depend on light in another way than `expected`."""
    detector, modulation = instrument.imaging.detector, instrument.imaging.projector.modulation
    if modulation is not None:
        raise InputError(
            "projector.modulation: taps of a modulated projector are not differentiable here; "
            "leave it out"
        )
    if detector.sensor.counts:
        raise InputError(
            f"detector.sensor.type = {detector.sensor.type}: counts with a dead time are not "
            "differentiable here; allowed are photodiodes, pin or apd"
        )
    if detector.amplifier is not None and detector.amplifier.coupling != "dc":
        raise InputError(
            f"detector.amplifier.coupling = {detector.amplifier.coupling}: readings that depend on "
            "all before are not differentiable here; allowed is dc"
        )


def expected(model: ReadingModel, patterns: Array, image: Array) -> Array:
    """Mean electrons of readings.

    Parameters
    ----------
    model
        With arrays of the same library and device.
    patterns
        Transmittances (K, H, W) from 0 to 1, in their sequence.
    image
        Transport image (..., H, W): fractions of the power of a pixel that arrive.

    Returns
    -------
    array
        Electrons (..., K).
    """
    lit = _flat(image * model.electrons)
    by_pattern = lit @ _flat(patterns).T
    light = (1 - model.dark_level) * by_pattern + model.dark_level * lit.sum(-1)[..., None]
    light = light + model.background
    return (1 - model.carried) * light + model.carried * light[..., _turned(light, 1)]


def expected_vjp(
    model: ReadingModel, patterns: Array, image: Array, gradient: Array
) -> tuple[Array, Array]:
    """Gradients by patterns (K, H, W) and image (..., H, W), given that by readings (..., K)."""
    back = gradient[..., _turned(gradient, -1)]
    by_light = (1 - model.carried) * gradient + model.carried * back
    lit, displayed = _flat(image * model.electrons), _flat(patterns)
    each = by_light.reshape(-1, by_light.shape[-1])
    by_patterns = (1 - model.dark_level) * (each.T @ lit.reshape(-1, lit.shape[-1]))
    by_lit = (1 - model.dark_level) * (by_light @ displayed)
    by_lit = by_lit + model.dark_level * by_light.sum(-1)[..., None]
    by_image = by_lit.reshape(image.shape) * model.electrons
    return by_patterns.reshape(patterns.shape), by_image


def noisy(model: ReadingModel, mean: Array, normal: Array) -> Array:
    """Electrons (..., K) with noise, from their means and as many standard normal numbers."""
    return mean + _sigma(model, mean) * normal


def noisy_vjp(
    model: ReadingModel, mean: Array, normal: Array, gradient: Array
) -> tuple[Array, Array]:
    """Gradients by means and by normal numbers, given that by noisy readings (..., K)."""
    sigma = _sigma(model, mean)
    by_mean = gradient * (1 + model.excess_noise_factor * normal / (2 * sigma))
    return by_mean, gradient * sigma


def _sigma(model: ReadingModel, mean: Array) -> Array:
    return (model.excess_noise_factor * mean + model.noise_electrons**2) ** 0.5


def _flat(images: Array) -> Array:
    return images.reshape(*images.shape[:-2], images.shape[-2] * images.shape[-1])


def _turned(readings: Array, by: int) -> Floats:
    """Index of the reading before (1) or after (-1) each."""
    return np.roll(np.arange(readings.shape[-1]), by)
