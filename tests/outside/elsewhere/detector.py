"""A detector: a photodiode so cold that it has no dark current."""

from typing import Literal

from spisim.instrument.photodiode import Photodiode


class Cooled(Photodiode):
    """Without gain."""

    type: Literal["cooled"]

    @property
    def gain(self):
        return 1.0

    @property
    def excess_noise_factor(self):
        return 1.0

    @property
    def dark_rate_hz(self):
        return 0.0
