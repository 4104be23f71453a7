"""Continuous-wave time of flight of every displayed pattern."""

from dataclasses import dataclass
from typing import Annotated, Any

from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from .charge import Charge, check_taps, spare_combinations, taps_summary
from .schema import Stored


@dataclass(frozen=True, eq=False)
class PatternTaps(Charge):
    """CW time of flight of every exposure on the bucket detector, for ranges of all pixels.

    Taps as those of `CwSpots`, of the light of one displayed pattern at ``detector_position_m``.
    """

    taps: Annotated[
        NDArray[Any], Stored("count", ("frames", "exposures", "pattern taps"), "int32 or float64")
    ]
    saturated: Annotated[Mask, Stored("1", ("frames", "exposures", "pattern taps"), "bool")]
    tap_frequencies_hz: Annotated[Floats, Stored("Hz", ("pattern taps",), sign="positive")]
    tap_phases_rad: Annotated[Floats, Stored("rad", ("pattern taps",))]
    phase_offsets_rad: Annotated[Floats, Stored("rad", ("pattern taps",))]
    detector_position_m: Annotated[Floats, Stored("m", (3,))]

    @property
    def spare(self) -> Floats:
        """Combinations (k, taps) in which all light cancels."""
        phases = self.tap_phases_rad - self.phase_offsets_rad
        return spare_combinations(self.tap_frequencies_hz, phases)

    @property
    def summary(self) -> str:
        """How they were measured, in a few words."""
        return taps_summary(self.tap_frequencies_hz)

    def check(self) -> None:
        """Raise InputError unless every phase can be solved for."""
        check_taps(
            "pattern_taps", self.tap_frequencies_hz, self.tap_phases_rad - self.phase_offsets_rad
        )
