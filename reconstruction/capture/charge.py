"""Integrated charge and continuous-wave taps as converter counts."""

from dataclasses import dataclass
from typing import Annotated, Any

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats, Mask
from ..base.errors import InputError
from .schema import Stored

MIN_SPARE_READINGS = 3
"""Redundant readings needed to estimate the noise."""
MIN_MODULATION_HZ = 1e4
"""Below this modulation frequency no path is long enough to turn the phase."""


@dataclass(frozen=True, eq=False)
class Charge:
    """Converter counts of integrated charge, their scale and noise.

    Electrons are primary photo-electrons, before any gain: (counts - offset_counts) *
    electrons_per_count. ``noise_electrons`` is the rms electronics and ADC noise of one reading;
    nan if unknown, and then estimated from redundant readings. ``excess_noise_factor`` is the
    charge variance per primary electron: 1 for a PIN photodiode, F of R. J. McIntyre, IEEE Trans.
    Electron Devices 13, 164 (1966) for an avalanche diode.
    """

    electrons_per_count: Annotated[float, Stored("electron/count", sign="positive")]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float | Floats, Stored("electron", sign="not negative", nan=True)]
    excess_noise_factor: Annotated[float, Stored("1", sign="positive")]

    def electrons(self, counts: NDArray[Any]) -> Floats:
        """Convert counts to primary photo-electrons."""
        return np.asarray((counts - self.offset_counts) * self.electrons_per_count)

    def variance(self, electrons: Floats) -> Floats:
        """Variance (n, K) of the readings of n spots in K taps or windows, in electrons squared.

        Raises InputError if the noise is unknown and cannot be estimated from the readings.
        """
        # At least one electron: a dead tap is not noiseless. A difference has at least this light.
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
        """Raise InputError if the noise is unknown and a frame of ``spots`` cannot show it."""
        freedom = spots * len(self.spare)
        if np.isnan(self.noise_electrons).any() and freedom < MIN_SPARE_READINGS:
            raise InputError(
                "noise_electrons is unknown (nan), and estimating it needs at least "
                f"{MIN_SPARE_READINGS} redundant readings per frame, not {freedom}: state the rms "
                "noise of a reading (0 for shot noise alone), or record four phases or more"
            )

    def _estimated_variance(self, electrons: Floats, shot: Floats) -> float:
        """Electronics variance, estimated from combinations of the readings in which light cancels.

        With few degrees of freedom this is the larger variance of Student's t, so that ranges
        exceed their sigma as rarely as with known noise.
        """
        spare = self.spare
        freedom = len(electrons) * len(spare)
        self.check_noise(len(electrons))
        residual, expected = electrons @ spare.T, shot @ np.square(spare).T
        return max(float((residual**2).mean() * freedom / (freedom - 2) - expected.mean()), 0.0)


class Taps(Charge):
    """Continuous-wave taps: frequency, phase and calibrated phase offset of each."""

    tap_frequencies_hz: Floats
    tap_phases_rad: Floats
    phase_offsets_rad: Floats

    @property
    def phases_rad(self) -> Floats:
        """Phases (K,) of the taps relative to light of zero path length."""
        return self.tap_phases_rad - self.phase_offsets_rad

    @property
    def spare(self) -> Floats:
        """Orthonormal combinations (k, K) that cancel steady and modulated light."""
        frequencies, phases = np.unique(self.tap_frequencies_hz), self.phases_rad[:, None]
        is_tap = (self.tap_frequencies_hz[:, None] == frequencies).astype(np.float64)
        model = [is_tap, is_tap * np.cos(phases), is_tap * np.sin(phases)]
        vectors, strength, _ = np.linalg.svd(np.concatenate(model, axis=1))
        return np.asarray(vectors[:, np.count_nonzero(strength > 1e-9 * strength[0]) :].T)

    @property
    def summary(self) -> str:
        """Description such as "continuous wave, 8 taps, 5, 20 MHz"."""
        mhz = ", ".join(f"{hz / 1e6:g}" for hz in np.unique(self.tap_frequencies_hz))
        return f"continuous wave, {self.tap_frequencies_hz.size} taps, {mhz} MHz"


@dataclass(frozen=True, eq=False)
class PatternTaps(Taps):
    """Continuous-wave taps of every exposure on the bucket detector, for ranges of all pixels.

    The taps are as in `CwSpots`, of the light of one exposed pattern at ``detector_position_m``.
    """

    taps: Annotated[
        NDArray[Any], Stored("count", ("frames", "exposures", "pattern taps"), "int32 or float64")
    ]
    saturated: Annotated[Mask, Stored("1", ("frames", "exposures", "pattern taps"), "bool")]
    tap_frequencies_hz: Annotated[Floats, Stored("Hz", ("pattern taps",), sign="positive")]
    tap_phases_rad: Annotated[Floats, Stored("rad", ("pattern taps",))]
    phase_offsets_rad: Annotated[Floats, Stored("rad", ("pattern taps",))]
    detector_position_m: Annotated[Floats, Stored("m", (3,))]

    def check(self) -> None:
        """Raise InputError unless every phase can be solved for."""
        check_taps("pattern_taps", self.tap_frequencies_hz, self.phases_rad)


def check_taps(group: str, frequencies_hz: Floats, phases_rad: Floats) -> None:
    """Check that the taps (K,), in a dataset ``group``, can be solved for phases.

    Raises InputError if a frequency is below `MIN_MODULATION_HZ` or has fewer than three different
    phases.
    """
    for frequency_hz in np.unique(frequencies_hz):
        phases = phases_rad[frequencies_hz == frequency_hz]
        where = f"{group}/tap_frequencies_hz: {frequency_hz:g} Hz"
        if phases.size < 3:
            raise InputError(f"{where} has {phases.size} tap(s); a phase needs at least 3")
        if frequency_hz < MIN_MODULATION_HZ:
            raise InputError(
                f"{where} is below the minimum of {MIN_MODULATION_HZ:g} Hz; if it is in MHz, write "
                f"{frequency_hz:g}e6"
            )
        model = np.stack([np.ones_like(phases), np.cos(phases), np.sin(phases)])
        if np.linalg.matrix_rank(model, tol=1e-6) < 3:
            raise InputError(
                f"{where} has taps of fewer than 3 different phases in {group}/tap_phases_rad: "
                f"{np.round(phases, 6).tolist()}"
            )
