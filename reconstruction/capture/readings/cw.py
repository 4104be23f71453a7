"""Continuous wave: taps of modulated light."""

from dataclasses import dataclass
from typing import Annotated, Any

from numpy.typing import NDArray

from ...arrays import Floats, Mask
from ..charge import Charge, check_taps, taps_summary
from ..schema import Stored
from ..spots import Spots


@dataclass(frozen=True, eq=False)
class CwSpots(Charge, Spots):
    """Continuous wave: tap k reads S_k = B + A cos(phi + phase_offset_k - tap_phase_k).

    phi = 2 pi f_k L / c with f_k the frequency of the tap. Several frequencies have at least three
    taps each, in any order. ``phase_offsets_rad`` is the calibrated phase at zero path length;
    ``periods`` the number of modulation periods that each tap accumulates; ``noise_electrons`` is
    each tap's own, as low frequencies integrate longer.
    """

    method = "cw"

    taps: Annotated[NDArray[Any], Stored("count", ("frames", 4, "taps"), "int32 or float64")]
    saturated: Annotated[Mask, Stored("1", ("frames", 4, "taps"), "bool")]
    noise_electrons: Annotated[
        float | Floats, Stored("electron", ("taps",), sign="not negative", nan=True)
    ]
    tap_frequencies_hz: Annotated[Floats, Stored("Hz", ("taps",), sign="positive")]
    tap_phases_rad: Annotated[Floats, Stored("rad", ("taps",))]
    phase_offsets_rad: Annotated[Floats, Stored("rad", ("taps",))]
    periods: Annotated[int, Stored("1", dtype="int64", sign="positive")]

    @property
    def readings(self) -> NDArray[Any]:
        """The taps."""
        return self.taps

    @property
    def summary(self) -> str:
        """How they were measured, in a few words."""
        return taps_summary(self.tap_frequencies_hz)

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and every phase can be solved for."""
        super().check()
        check_taps("spots", self.tap_frequencies_hz, self.tap_phases_rad - self.phase_offsets_rad)


READINGS = CwSpots
