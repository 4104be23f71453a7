"""What every method of ranging gives, and when a spot counts as seen."""

from dataclasses import dataclass
from typing import Literal

import numpy as np
from numpy.typing import NDArray

Floats = NDArray[np.float64]
Mask = NDArray[np.bool_]
Status = Literal["ok", "saturated", "no signal", "too close", "ambiguous"]

LEAST_SIGNAL = 3.0
"""A spot counts as seen when its signal exceeds its own standard deviation this many times."""


@dataclass(frozen=True, eq=False)
class Paths:
    """What a method finds of the four spots, each (4,): path lengths, or why there is none.

    ``sigma_m`` is the standard deviation of ``path_m``; the last three are true or false.
    """

    path_m: Floats
    sigma_m: Floats
    signal_electrons: Floats
    background_electrons: Floats
    saturated: Mask
    no_signal: Mask
    ambiguous: Mask


@dataclass(frozen=True, eq=False)
class Ranges:
    """Ranges of the four spots of one frame, each (4,).

    ``range_m`` from the projector's pinhole along the spot's direction, ``sigma_m`` its standard
    deviation from shot and electronics noise, without the bias of light that came another way, such
    as the echo of fog; both nan where ``status`` is not "ok": "saturated", "no signal", "too close"
    (the path is no longer than the way from laser to detector) or "ambiguous" (frequencies that
    contradict each other, a pulse outside of windows or bins).

    ``signal_electrons`` and ``background_electrons`` are A and B of a tap of the first frequency
    (cw), the whole pulse and the background of one window (pulsed), or arrivals of the pulse and
    background arrivals per bin (dtof).
    """

    range_m: Floats
    sigma_m: Floats
    signal_electrons: Floats
    background_electrons: Floats
    status: tuple[Status, ...]

    @property
    def valid(self) -> NDArray[np.bool_]:
        """Where there is a range (4,)."""
        return np.array(self.status) == "ok"
