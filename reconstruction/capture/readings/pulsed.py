"""Pulses of light in windows of time."""

from dataclasses import dataclass
from typing import Annotated, Any

from numpy.typing import NDArray

from ...arrays import Floats, Mask
from ...errors import InputError
from ..charge import Charge
from ..schema import Stored
from ..spots import Spots


@dataclass(frozen=True, eq=False)
class PulsedSpots(Charge, Spots):
    """Pulses of light in three windows as long as they: background, first and second.

    Windows start ``window_starts_s`` after the pulse begins to leave, the second where the first
    ends; the background window sees no echo. Light arrives L / c + delay_offset after that moment.
    ``pulses`` is the number of pulses that each window accumulates.
    """

    method = "pulsed"

    taps: Annotated[NDArray[Any], Stored("count", ("frames", 4, 3), "int32 or float64")]
    saturated: Annotated[Mask, Stored("1", ("frames", 4, 3), "bool")]
    window_starts_s: Annotated[Floats, Stored("s", (3,))]
    pulse_width_s: Annotated[float, Stored("s", sign="positive")]
    pulses: Annotated[int, Stored("1", dtype="int64", sign="positive")]
    delay_offset_s: Annotated[float, Stored("s")]

    @property
    def readings(self) -> NDArray[Any]:
        """The three windows."""
        return self.taps

    @property
    def summary(self) -> str:
        """How they were measured, in a few words."""
        return f"pulsed, three windows of {1e9 * self.pulse_width_s:.4g} ns"

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and the windows do not overlap."""
        super().check()
        background, first, second = (self.window_starts_s / self.pulse_width_s).tolist()
        if abs(second - first - 1) > 1e-6:
            raise InputError(
                "spots/window_starts_s: the second window must start where the first ends, "
                f"pulse_width_s = {self.pulse_width_s:g} s later, not "
                f"{(second - first) * self.pulse_width_s:g} s"
            )
        if first - 1 + 1e-6 < background < second + 1 - 1e-6:
            raise InputError(
                "spots/window_starts_s: the background window overlaps the windows for the echo; "
                f"it must start {self.pulse_width_s:g} s before the first one or earlier, or after "
                "the second one has ended"
            )


READINGS = PulsedSpots
