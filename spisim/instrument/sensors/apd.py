"""Avalanche photodiodes."""

from typing import Annotated, Literal

from pydantic import Field
from scipy.constants import elementary_charge

from spisim.base.config import NonNegative, Number
from spisim.instrument.photodiode import Photodiode


class Apd(Photodiode):
    """Avalanche photodiode in linear mode.

    The excess noise is McIntyre's (IEEE Trans. Electron Devices 13, 164 (1966)) for the carriers
    that multiply best: F = k M + (1 - k)(2 - 1/M). It is drawn as normal, which holds for many
    electrons per reading; for a few the true distribution is skewed.
    """

    type: Literal["apd"]
    """Type discriminator."""
    dark_current_na: NonNegative
    """Dark current at the operating gain, all of it multiplied."""
    gain: Annotated[Number, Field(ge=1)]
    """Electrons per primary electron."""
    ionisation_ratio: Annotated[Number, Field(ge=0, le=1)]
    """Ionisation ratio k of holes to electrons, or its inverse, whichever is below 1."""

    @property
    def excess_noise_factor(self) -> float:
        k, gain = self.ionisation_ratio, self.gain
        return k * gain + (1 - k) * (2 - 1 / gain)

    @property
    def dark_rate_hz(self) -> float:
        return self.dark_current_na * 1e-9 / (elementary_charge * self.gain)


SENSOR = Apd
