"""What is held of the fog: beforehand, and carried from one frame of a flight to the next."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import Self

import numpy as np

from ...arrays import Floats
from ...capture import Spots
from ..ranges import FogOptics, Ranges
from .modes import LOG_DEVIATION, expected_backscatter

CLEAR = 0.5
"""Probability beforehand that the air is clear; all fogs are equally likely."""
DRIFT = 0.05
"""By how much the logarithm of backscattering may change from frame to frame, rms,"""
CHANGE = 0.02
"""and the share of frames before which the fog is another altogether."""


@dataclass(frozen=True, eq=False)
class FogBelief:
    """Probabilities ``share`` (K,) of extinctions, and backscattering that is log-normal for each.

    ``log_median`` and ``log_deviation`` (K,) of backscattering in 1 / (m sr).
    """

    share: Floats
    log_median: Floats
    log_deviation: Floats

    @classmethod
    def beforehand(cls, extinction_per_m: Floats) -> Self:
        """What holds for any fog; the first extinction is that of clear air."""
        share = np.full(extinction_per_m.size, (1 - CLEAR) / (extinction_per_m.size - 1))
        share[0] = CLEAR
        median = np.log(expected_backscatter(extinction_per_m))
        return cls(share, median, np.full(share.size, LOG_DEVIATION))

    @property
    def log_backscatter_sigma(self) -> float:
        """Standard deviation of the logarithm of backscattering."""
        mean = self.share @ self.log_median
        return float(np.sqrt(self.share @ (self.log_deviation**2 + (self.log_median - mean) ** 2)))

    def optics(self, extinction_per_m: Floats) -> FogOptics:
        """The fog itself, of the extinctions (K,) that have these probabilities."""
        return FogOptics(
            extinction_per_m=float(self.share @ extinction_per_m),
            backscatter_per_m_sr=float(np.exp(self.share @ self.log_median)),
            log_sigma=self.log_backscatter_sigma,
        )

    def log_density(self, backscatter: Floats) -> Floats:
        """Logarithm of the probability (K, B) of each cell of a grid (B,) of backscattering."""
        log = np.log(backscatter)
        away = (log - self.log_median[:, None]) / self.log_deviation[:, None]
        cells = np.log(np.gradient(log)) - np.log(self.log_deviation)[:, None]
        return np.asarray(np.log(self.share)[:, None] + cells - away**2 / 2)

    def updated(self, weight: Floats, backscatter: Floats) -> Self:
        """What is held after readings that gave a grid (B,) of backscattering weights (K, B)."""
        share = weight.sum(axis=1)
        log = np.log(backscatter)
        within = weight / np.maximum(share, 1e-300)[:, None]
        mean = within @ log
        deviation = np.sqrt(np.maximum(within @ log**2 - mean**2, 1e-12))
        known = share > 1e-12
        return type(self)(
            share=share,
            log_median=np.where(known, mean, self.log_median),
            log_deviation=np.where(known, deviation, self.log_deviation),
        )

    def later(self, beforehand: Self) -> Self:
        """What is held a frame later, of fog that drifts and, rarely, is another one."""
        drifted = np.hypot(self.log_deviation, DRIFT)
        share = (1 - CHANGE) * self.share + CHANGE * beforehand.share
        # Neighbouring extinctions come of what is held, not only of rare changes.
        spread = np.convolve(
            np.pad(share, 1, mode="edge"), [CHANGE, 1 - 2 * CHANGE, CHANGE], "valid"
        )
        mixed = CHANGE * beforehand.share / np.maximum(share, 1e-300)
        median = (1 - mixed) * self.log_median + mixed * beforehand.log_median
        variance = (1 - mixed) * drifted**2 + mixed * beforehand.log_deviation**2
        variance += mixed * (1 - mixed) * (self.log_median - beforehand.log_median) ** 2
        return type(self)(spread / spread.sum(), median, np.sqrt(variance))


FogSolver = Callable[[Spots, FogBelief], tuple[Ranges, FogBelief]]
"""Ranges from the readings of a frame and what was held of the fog, and what is held then."""
