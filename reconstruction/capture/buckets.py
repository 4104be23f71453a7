"""Single-pixel readings."""

from dataclasses import dataclass
from typing import Annotated, Any, Literal

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from .schema import Stored

Unit = Literal["electron", "count"]
Readings = Annotated[NDArray[Any], Stored("count", ("frames", "exposures"), "int32 or float64")]
MAX_LOAD = 1 - 1e-6
"""Maximum dead fraction of an exposure; beyond, a counting detector measures nothing."""


@dataclass(frozen=True, eq=False)
class Buckets:
    """Single-pixel readings, one per exposure.

    ``counts`` are raw ADC counts, int32 or float64; (counts - offset_counts) * electrons_per_count
    are primary photo-electrons, before any gain. ``saturated`` marks readings to ignore.
    ``noise_electrons`` is the rms electronics and ADC noise of one exposure,
    ``excess_noise_factor`` the charge variance per primary electron (see `Charge`), and
    ``dead_time_s`` the time for which a counting detector is blind after a detection, 0 for one
    that integrates charge. AC coupling removes ``baseline_electrons`` from each reading on average,
    but not their shot noise. Unknown times, scales and noise are nan.
    """

    counts: Readings
    saturated: Annotated[NDArray[np.bool_], Stored("1", ("frames", "exposures"), "bool")]
    exposure_time_s: Annotated[float, Stored("s", sign="positive", nan=True)]
    pattern_period_s: Annotated[float, Stored("s", sign="positive", nan=True)]
    electrons_per_count: Annotated[float, Stored("electron/count", sign="positive", nan=True)]
    offset_counts: Annotated[float, Stored("count")]
    noise_electrons: Annotated[float, Stored("electron", sign="not negative", nan=True)]
    excess_noise_factor: Annotated[float, Stored("1", sign="positive")]
    dead_time_s: Annotated[float, Stored("s", sign="not negative")]
    baseline_electrons: Annotated[float, Stored("electron", sign="not negative")] = 0.0

    @property
    def unit(self) -> Unit:
        """Unit of ``signal``."""
        return "electron" if np.isfinite(self.electrons_per_count) else "count"

    @property
    def signal(self) -> Floats:
        """Light of each exposure (frames, M) in electrons, or in counts if the scale is unknown.

        Corrected for dead time: of N arrivals in the time T a detector counts m = N / (1 + N tau /
        T), so N = m / (1 - m tau / T), for T much longer than the dead time tau (J. W. Mueller,
        Nucl. Instrum. Methods 112, 47 (1973), non-extended type).
        """
        return np.asarray(self._detected / (1 - np.minimum(self._load, MAX_LOAD)))

    @property
    def variance(self) -> Floats:
        """Variance of ``signal`` (frames, M) from light and electronics; nan where unknown.

        Renewal theory gives var(m) = N / (1 + N tau / T)^3, with the symbols of ``signal``, and dN
        / dm = (1 + N tau / T)^2. The light of a difference formed by the recorder is unknown, but
        at least its magnitude.
        """
        if self.unit == "count":
            return np.full(self.counts.shape, np.nan)
        light = np.abs(self.signal + self.baseline_electrons)
        if self.dead_time_s > 0:
            light = light * (1 + light * self.dead_time_s / self.exposure_time_s)
        return np.asarray(self.excess_noise_factor * light + self.noise_electrons**2)

    @property
    def usable(self) -> NDArray[np.bool_]:
        """Readings (frames, M) that are neither saturated nor from a permanently blind detector."""
        return np.asarray(~self.saturated & (self._load < MAX_LOAD))

    @property
    def _detected(self) -> Floats:
        scale = self.electrons_per_count if self.unit == "electron" else 1.0
        return np.asarray((self.counts - self.offset_counts) * scale)

    @property
    def _load(self) -> Floats:
        """Fraction of the exposure for which the detector was blind (frames, M)."""
        if self.dead_time_s == 0:
            return np.zeros(self.counts.shape)
        return np.asarray(self._detected * self.dead_time_s / self.exposure_time_s)
