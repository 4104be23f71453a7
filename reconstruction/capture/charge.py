"""Integrated charge, and taps of continuous wave, as counts of a converter."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ..arrays import Floats
from ..errors import InputError
from .schema import Stored


@dataclass(frozen=True, eq=False)
class Charge:
    """Integrated charge as counts of a converter: what they stand for, and their noise.

    Electrons are primary photo-electrons, before any gain: (counts - offset_counts) *
    electrons_per_count. ``noise_electrons`` is the rms electronics and ADC noise of one reading,
    nan where unknown; ``excess_noise_factor`` the variance of the charge per primary electron: 1
    for a PIN photodiode, F of R. J. McIntyre, IEEE Trans. Electron Devices 13, 164 (1966) for an
    avalanche diode.
    """

    electrons_per_count: Annotated[float, Stored("electron/count", sign="positive")]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float | Floats, Stored("electron", sign="not negative", nan=True)]
    excess_noise_factor: Annotated[float, Stored("1", sign="positive")]

    def electrons(self, counts: NDArray[Any]) -> Floats:
        """Primary photo-electrons that counts stand for."""
        return np.asarray((counts - self.offset_counts) * self.electrons_per_count)

    def variance(self, electrons: Floats) -> Floats:
        """Variance of readings of so many electrons, without the electronics' where unknown."""
        electronics = np.nan_to_num(self.noise_electrons) ** 2
        # A dead tap is no perfect tap.
        return np.asarray(self.excess_noise_factor * np.maximum(electrons, 1) + electronics)


def taps_summary(frequencies_hz: Floats) -> str:
    """Taps of these frequencies in a few words."""
    different = ", ".join(f"{frequency_hz / 1e6:g}" for frequency_hz in np.unique(frequencies_hz))
    return f"continuous wave, {frequencies_hz.size} taps, {different} MHz"


def check_taps(group: str, frequencies_hz: Floats, phases_rad: Floats) -> None:
    """Raise InputError unless each frequency has taps of three phases or more."""
    for frequency_hz in np.unique(frequencies_hz):
        phases = phases_rad[frequencies_hz == frequency_hz]
        where = f"{group}/tap_frequencies_hz: {frequency_hz:g} Hz"
        if phases.size < 3:
            raise InputError(f"{where} has {phases.size} tap(s); a phase needs at least 3")
        model = np.stack([np.ones_like(phases), np.cos(phases), np.sin(phases)])
        if np.linalg.matrix_rank(model, tol=1e-6) < 3:
            raise InputError(
                f"{where} has taps of fewer than 3 different phases in {group}/tap_phases_rad: "
                f"{np.round(phases, 6).tolist()}"
            )
