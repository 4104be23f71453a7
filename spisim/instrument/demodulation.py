"""Modulated light and the taps that demodulate it.

Light of power 1 + Σ a_n cos(n ω t) is delayed by its path and integrated in windows of sensitivity
x [1 + Σ b_n cos(n (ω t - θ))]. On average over many periods a tap collects

    x [1 + ½ Σ a_n b_n |H_n| cos(n (φ - θ) - arg…)],   φ = ω L / c,

where H_n is the amplifier's response to the n-th harmonic (Lange & Seitz, IEEE J. Quantum Electron.
37, 390 (2001), for n = 1). Four taps a quarter period apart alias odd harmonics onto the first:
with square light and square windows the phase error is up to 4.1°.
"""

from __future__ import annotations

from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray
from pydantic import AfterValidator, Field, model_validator

from reconstruction.base.arrays import Complex, Floats
from reconstruction.base.errors import InputError
from reconstruction.capture.charge import MIN_MODULATION_HZ
from spisim.base.config import Number, Section
from spisim.instrument.sensor import PositiveFraction

#: Harmonics of a square wave taken into account; those left out are below 1/n² of the first.
HARMONICS = 399
#: The same where each harmonic costs an image.
PICTURE_HARMONICS = 9
TAPS = 4


class Taps(Section):
    """Four demodulation windows a quarter period apart.

    A rectangular window is open for `width` periods; a sine window takes each electron with
    probability ½ [1 + cos]. Taps work in parallel, or in turn on one amplifier, which takes four
    times as long. Overlapping parallel windows share one current, yet their noise is drawn
    independently. For rectangular windows of up to half a period, whose opposite taps do not
    overlap, the variance of the phase is right; for sine windows it is up to twice too large.
    """

    shape: Literal["rectangular", "sine"] = "rectangular"
    """Sensitivity of a tap over the period."""
    width: PositiveFraction = 0.25
    """Fraction of the period for which a rectangular window is open."""
    arrangement: Literal["parallel", "in-turn"] = "parallel"
    """All taps at once, or in turn on one amplifier."""

    @property
    def fraction(self) -> float:
        """Fraction x of all electrons that a tap collects while it works."""
        return self.width if self.shape == "rectangular" else 0.5

    @property
    def noise_share(self) -> float:
        """Fraction of a period over which constant noise of the same variance is integrated."""
        return self.width if self.shape == "rectangular" else 3 / 8

    @property
    def phases_rad(self) -> Floats:
        """Phases (4,) of the taps: 0, 90, 180, 270 degrees."""
        return np.asarray(np.arange(TAPS) * (2 * np.pi / TAPS), dtype=np.float64)

    def harmonics(self, orders: NDArray[np.int64]) -> Floats:
        """Harmonics b_n of the window's sensitivity."""
        if self.shape == "sine":
            return np.where(orders == 1, 1.0, 0.0)
        return np.asarray(2 * np.sinc(orders * self.width))


def _not_in_mhz(frequency_hz: float) -> float:
    if frequency_hz < MIN_MODULATION_HZ:
        raise InputError(
            f"should be at least {MIN_MODULATION_HZ:g} Hz; if it is in MHz, write "
            f"{frequency_hz:g}e+6"
        )
    return frequency_hz


Frequency = Annotated[Number, Field(gt=0, le=1e10), AfterValidator(_not_in_mhz)]


class Modulation(Section):
    """Periodic light; `contrast` is amplitude over mean of its first harmonic's wave form.

    The `frequencies_hz` are used in turn.
    """

    frequencies_hz: Annotated[tuple[Frequency, ...], Field(min_length=1, max_length=8)]
    """Modulation frequencies, used in turn."""
    light: Literal["sine", "square"] = "sine"
    """Waveform of the light."""
    contrast: PositiveFraction = 1.0
    """Half the peak-to-peak power over its mean."""
    taps: Taps = Taps()
    """Demodulation windows."""

    @model_validator(mode="after")
    def _frequencies_differ(self) -> Modulation:
        if len(set(self.frequencies_hz)) < len(self.frequencies_hz):
            raise InputError(f"frequencies_hz should differ; found {list(self.frequencies_hz)}")
        return self

    def light_harmonics(self, orders: NDArray[np.int64]) -> Floats:
        """Harmonics a_n of the light's power."""
        if self.light == "sine":
            return np.where(orders == 1, self.contrast, 0.0)
        square = 4 / (np.pi * orders) * np.sin(np.pi * orders / 2)
        return np.asarray(self.contrast * square)

    def orders(self, maximum: int = HARMONICS) -> NDArray[np.int64]:
        """Harmonics (n,) that contribute to the taps, the first included."""
        orders = np.arange(1, maximum + 1)
        strength = np.abs(self.light_harmonics(orders) * self.taps.harmonics(orders))
        return orders[strength > 1e-6 * self.contrast]

    def amplitudes(
        self, frequency_hz: float, response: Any, maximum: int = HARMONICS
    ) -> tuple[NDArray[np.int64], Complex]:
        """Orders n and complex ½ a_n b_n H_n; `response` maps a frequency to the amplifier's H."""
        orders = self.orders(maximum)
        product = 0.5 * self.light_harmonics(orders) * self.taps.harmonics(orders)
        return orders, product * np.conj(response(orders * frequency_hz))

    def correlation(self, phase_rad: Floats, frequency_hz: float, response: Any) -> Floats:
        """Fraction of the light's electrons in each tap (4, ...) at the path's phase φ (...)."""
        orders, amplitudes = self.amplitudes(frequency_hz, response)
        waves = sum(
            np.multiply.outer(
                amplitude * np.exp(-1j * order * self.taps.phases_rad),
                np.exp(1j * order * phase_rad),
            ).real
            for order, amplitude in zip(orders, amplitudes, strict=True)
        )
        return np.asarray(self.taps.fraction * (1 + waves))

    def phase_offset_rad(self, frequency_hz: float, response: Any) -> float:
        """Phase of the first harmonic at zero path length, as a calibration measures it."""
        _, amplitudes = self.amplitudes(frequency_hz, response)
        return float(np.angle(amplitudes[0]))

    def demodulation_contrast(self, frequency_hz: float, response: Any) -> float:
        """First-harmonic amplitude over mean of a tap's signal against phase."""
        _, amplitudes = self.amplitudes(frequency_hz, response)
        return float(np.abs(amplitudes[0]))
