"""Integrated charge, and taps of continuous wave, as counts of a converter."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..base.errors import InputError
from .schema import Stored

FEWEST_SPARE = 3
"""Readings to spare from which noise can be estimated."""
MIN_MODULATION_HZ = 1e4
"""Of light whose phase tells a range: below, no path is long enough to turn it."""


@dataclass(frozen=True, eq=False)
class Charge:
    """Integrated charge as counts of a converter: what they stand for, and their noise.

    Electrons are primary photo-electrons, before any gain: (counts - offset_counts) *
    electrons_per_count. ``noise_electrons`` is the rms electronics and ADC noise of one reading,
    nan where unknown (then it is estimated from readings to spare); ``excess_noise_factor`` the
    variance of the charge per primary electron: 1 for a PIN photodiode, F of R. J. McIntyre, IEEE
    Trans. Electron Devices 13, 164 (1966) for an avalanche diode.
    """

    electrons_per_count: Annotated[float, Stored("electron/count", sign="positive")]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float | Floats, Stored("electron", sign="not negative", nan=True)]
    excess_noise_factor: Annotated[float, Stored("1", sign="positive")]

    def electrons(self, counts: NDArray[Any]) -> Floats:
        """Primary photo-electrons that counts stand for."""
        return np.asarray((counts - self.offset_counts) * self.electrons_per_count)

    def variance(self, electrons: Floats) -> Floats:
        """Variance of the readings (n, K) of a frame; InputError where nothing tells it."""
        # A dead tap is no perfect tap, and a difference holds at least as much light.
        shot = self.excess_noise_factor * np.maximum(np.abs(electrons), 1)
        electronics = np.square(self.noise_electrons)
        if np.isnan(electronics).any():
            estimated = self._estimated_variance(electrons, shot)
            electronics = np.where(np.isnan(electronics), estimated, electronics)
        return np.asarray(shot + electronics)

    @property
    def spare(self) -> Floats:
        """Orthonormal combinations (k, K) of a spot's readings in which all light cancels."""
        return np.zeros((0, 1))

    def check_noise(self, spots: int) -> None:
        """InputError where noise is unknown, and the readings of a frame cannot tell it."""
        freedom = spots * len(self.spare)
        if np.isnan(self.noise_electrons).any() and freedom < FEWEST_SPARE:
            raise InputError(
                "noise_electrons is not known (nan), and of the readings of a frame "
                f"{freedom} are to spare to estimate it from, not {FEWEST_SPARE} or more: state "
                "the rms noise of one (0 for shot noise alone), or record four phases or more"
            )

    def _estimated_variance(self, electrons: Floats, shot: Floats) -> float:
        """Of the electronics, by what cancels of a frame's readings (n, K) but for noise.

        With few degrees of freedom it is the variance of Student's t, which is larger: a range is
        off by more than its sigma as seldom as if the noise were known.
        """
        spare = self.spare
        freedom = len(electrons) * len(spare)
        self.check_noise(len(electrons))
        left, expected = electrons @ spare.T, shot @ np.square(spare).T
        return max(float((left**2).mean() * freedom / (freedom - 2) - expected.mean()), 0.0)


def spare_combinations(frequencies_hz: Floats, phases_rad: Floats) -> Floats:
    """Orthonormal combinations (k, K) of taps in which steady and modulated light cancel."""
    each = np.unique(frequencies_hz)
    own = (frequencies_hz[:, None] == each).astype(np.float64)
    model = [own, own * np.cos(phases_rad)[:, None], own * np.sin(phases_rad)[:, None]]
    left, strength, _ = np.linalg.svd(np.concatenate(model, axis=1))
    return np.asarray(left[:, np.count_nonzero(strength > 1e-9 * strength[0]) :].T)


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
        if frequency_hz < MIN_MODULATION_HZ:
            raise InputError(
                f"{where} is below {MIN_MODULATION_HZ:g} Hz, the least that light is modulated "
                f"with; if it is in MHz, write {frequency_hz:g}e6"
            )
        model = np.stack([np.ones_like(phases), np.cos(phases), np.sin(phases)])
        if np.linalg.matrix_rank(model, tol=1e-6) < 3:
            raise InputError(
                f"{where} has taps of fewer than 3 different phases in {group}/tap_phases_rad: "
                f"{np.round(phases, 6).tolist()}"
            )
