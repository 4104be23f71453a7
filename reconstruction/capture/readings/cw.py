"""Continuous-wave taps of modulated light."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ...base.arrays import Floats, Mask
from ...base.constants import c
from ..charge import Taps, check_taps
from ..schema import Stored
from ..spots import SPOTS_AXIS, Spots


@dataclass(frozen=True, eq=False)
class CwSpots(Taps, Spots):
    """Continuous wave: tap k reads S_k = B + A cos(phi + phase_offset_k - tap_phase_k).

    phi = 2 pi f_k L / c with f_k the frequency of the tap. Each frequency has at least three taps,
    in any order. ``phase_offsets_rad`` is the calibrated phase at zero path length, ``periods`` the
    number of modulation periods per tap. ``noise_electrons`` is per tap, as low frequencies
    integrate longer. If a detector collected all light of its laser, a tap at mean phase would hold
    ``electrons_per_joule * laser_energies_j``, with A / B of ``contrasts``; nan if unknown.
    """

    method = "cw"

    taps: Annotated[
        NDArray[Any], Stored("count", ("frames", SPOTS_AXIS, "taps"), "int32 or float64")
    ]
    saturated: Annotated[Mask, Stored("1", ("frames", SPOTS_AXIS, "taps"), "bool")]
    noise_electrons: Annotated[
        float | Floats,
        Stored("electron", ("taps",), sign="not negative", nan=True, one_for_all=True),
    ]
    tap_frequencies_hz: Annotated[Floats, Stored("Hz", ("taps",), sign="positive")]
    tap_phases_rad: Annotated[Floats, Stored("rad", ("taps",))]
    phase_offsets_rad: Annotated[Floats, Stored("rad", ("taps",))]
    periods: Annotated[
        int | NDArray[np.int64], Stored("1", ("taps",), "int64", sign="positive", one_for_all=True)
    ]
    laser_energies_j: Annotated[
        float | Floats, Stored("J", ("taps",), sign="positive", nan=True, one_for_all=True)
    ] = np.nan
    contrasts: Annotated[
        float | Floats, Stored("1", ("taps",), sign="positive", nan=True, one_for_all=True)
    ] = np.nan

    @property
    def readings(self) -> NDArray[Any]:
        """The taps."""
        return self.taps

    def response(self, path_m: Floats) -> Floats:
        """Joules per tap (taps, ...) if a detector collects all light, by path length (...)."""
        columns = (-1,) + (1,) * np.ndim(path_m)
        frequency, phase, energy, contrast = (
            np.broadcast_to(each, self.tap_frequencies_hz.shape).reshape(columns)
            for each in (
                self.tap_frequencies_hz,
                self.phase_offsets_rad - self.tap_phases_rad,
                self.laser_energies_j,
                self.contrasts,
            )
        )
        return energy * (1 + contrast * np.cos(2 * np.pi * frequency / c * path_m + phase))

    @property
    def steady(self) -> Floats:
        """Tap readings of constant light, (taps, frequencies), up to scale."""
        each = np.unique(self.tap_frequencies_hz)
        return (self.tap_frequencies_hz[:, None] == each).astype(np.float64)

    def check(self) -> None:
        """Raise InputError unless directions are unit vectors and every phase can be solved for."""
        super().check()
        check_taps("spots", self.tap_frequencies_hz, self.phases_rad)


READINGS = CwSpots
