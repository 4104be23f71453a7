"""Pulsed light integrated in time windows."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Mask
from ...base.constants import c
from ...base.errors import InputError
from ..charge import Charge
from ..schema import Stored
from ..spots import SPOTS_AXIS, Spots, check_duration


@dataclass(frozen=True, eq=False)
class PulsedSpots(Charge, Spots):
    """Pulsed light in windows as long as the pulse: one of background, then two or more for the
    echo.

    Windows start ``window_starts_s`` after the pulse begins to leave, and from the second on follow
    each other without gaps; the background window sees no echo. Light arrives L / c +
    delay_offset_s after it left. ``pulses`` is the number of pulses that each window accumulates,
    ``laser_energy_j`` the energy of all of them; nan if unknown.
    """

    method = "pulsed"

    taps: Annotated[
        NDArray[Any], Stored("count", ("frames", SPOTS_AXIS, "windows"), "int32 or float64")
    ]
    saturated: Annotated[Mask, Stored("1", ("frames", SPOTS_AXIS, "windows"), "bool")]
    window_starts_s: Annotated[Floats, Stored("s", ("windows",))]
    pulse_width_s: Annotated[float, Stored("s", sign="positive")]
    pulses: Annotated[int, Stored("1", dtype="int64", sign="positive")]
    delay_offset_s: Annotated[float, Stored("s")]
    laser_energy_j: Annotated[float, Stored("J", sign="positive", nan=True)] = np.nan

    @property
    def readings(self) -> NDArray[Any]:
        """The windows."""
        return self.taps

    @property
    def summary(self) -> str:
        """Description of the measurement in a few words."""
        windows = self.window_starts_s.size
        return f"pulsed, {windows} windows of {1e9 * self.pulse_width_s:.4g} ns"

    def response(self, path_m: Floats) -> Floats:
        """Joules per window (windows, ...) if all of a rectangular pulse is collected, by path
        (...)."""
        columns = (-1,) + (1,) * np.ndim(path_m)
        arrival_s = np.asarray(path_m) / c + self.delay_offset_s
        apart = np.abs(self.window_starts_s.reshape(columns) - arrival_s) / self.pulse_width_s
        return self.laser_energy_j * np.maximum(1 - apart, 0)

    @property
    def steady(self) -> Floats:
        """Window readings of constant light, (windows, 1), up to scale."""
        return np.ones((self.window_starts_s.size, 1))

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and the windows do not overlap."""
        super().check()
        check_duration("spots/pulse_width_s", self.pulse_width_s)
        if self.window_starts_s.size < 3:
            raise InputError(
                f"spots/window_starts_s has {self.window_starts_s.size} windows; one of background "
                "and at least two for the echo are needed"
            )
        background, first, *others = (self.window_starts_s / self.pulse_width_s).tolist()
        for number, start in enumerate(others, start=1):
            gap = start - first - number
            if abs(gap) > 1e-6:
                raise InputError(
                    f"spots/window_starts_s: window {number + 1} must start where the one before "
                    f"ends, {number} pulse_width_s = {number * self.pulse_width_s:g} s after the "
                    f"first, not {(start - first) * self.pulse_width_s:g} s: they "
                    f"{'overlap' if gap < 0 else 'leave a gap'}"
                )
        if first - 1 + 1e-6 < background < others[-1] + 1 - 1e-6:
            raise InputError(
                "spots/window_starts_s: the background window overlaps the windows for the echo; "
                f"it must start {self.pulse_width_s:g} s before the first one or earlier, or after "
                "the last one has ended"
            )


READINGS = PulsedSpots
