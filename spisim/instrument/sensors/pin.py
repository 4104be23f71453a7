"""PIN photodiodes."""

from typing import Literal

from scipy.constants import elementary_charge

from spisim.base.config import NonNegative
from spisim.instrument.photodiode import Photodiode


class Pin(Photodiode):
    """Photodiode without gain."""

    type: Literal["pin"]
    """Type discriminator."""
    dark_current_na: NonNegative
    """Dark current."""

    @property
    def gain(self) -> float:
        return 1.0

    @property
    def excess_noise_factor(self) -> float:
        return 1.0

    @property
    def dark_rate_hz(self) -> float:
        return self.dark_current_na * 1e-9 / elementary_charge


SENSOR = Pin
