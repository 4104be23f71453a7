"""Bayesian filter over the state of the fog: prior, update by a frame, prediction of the next."""

from collections.abc import Callable
from dataclasses import dataclass
from typing import NamedTuple, Self

import numpy as np

from ...base.arrays import Floats
from ...capture import Spots
from ..brightness import Brightness
from ..ranges import FogOptics, Ranges
from ..weather import KOSCHMIEDER, Weather
from .modes import LOG_SIGMA, expected_backscatter

CLEAR = 0.5
"""Prior probability of clear air if nothing is stated; all fogs are equally likely."""
VISIBILITY_LOG_SIGMA = 0.3
"""Log sigma of the extinction that follows from a visibility, as kinds of fog differ at 1550 nm,
and so do definitions and estimates of visibility."""
IMPOSSIBLE = 1e-9
"""Probability left to weather that contradicts the stated one."""
DRIFT = 0.05
"""Rms change of the logarithm of backscattering from frame to frame,"""
CHANGE = 0.02
"""and the probability that the next frame has another fog altogether."""


@dataclass(frozen=True, eq=False)
class FogState:
    """Distribution of the fog: ``probability`` (K,) of extinctions, each with log-normal
    backscattering.

    ``log_median`` and ``log_sigma`` (K,) are of backscattering in 1 / (m sr).
    """

    probability: Floats
    log_median: Floats
    log_sigma: Floats

    @classmethod
    def prior(cls, extinction_per_m: Floats, weather: Weather, unstated: float = CLEAR) -> Self:
        """Prior before any reading; the first extinction is that of clear air.

        Clear air has the probability ``unstated`` unless the weather states it.
        """
        stated = weather.clear_probability
        clear = unstated if np.isnan(stated) else np.clip(stated, IMPOSSIBLE, 1 - IMPOSSIBLE)
        probability = np.full(extinction_per_m.size, (1 - clear) / (extinction_per_m.size - 1))
        probability[0] = clear
        if not np.isnan(weather.visibility_m):
            # Relative to the maximum: visibilities beyond the extinctions map to their ends.
            away = np.log(extinction_per_m * weather.visibility_m / KOSCHMIEDER)
            log = -((away / VISIBILITY_LOG_SIGMA) ** 2) / 2
            probability = np.exp(log - log.max()) + IMPOSSIBLE
            probability /= probability.sum()
        median = np.log(expected_backscatter(extinction_per_m))
        return cls(probability, median, np.full(probability.size, LOG_SIGMA))

    @property
    def log_backscatter_sigma(self) -> float:
        """Standard deviation of the logarithm of backscattering."""
        mean = self.probability @ self.log_median
        return float(
            np.sqrt(self.probability @ (self.log_sigma**2 + (self.log_median - mean) ** 2))
        )

    def log_ratio(self, unstated: float) -> Floats:
        """Logarithm (K,) of the probabilities over those with nothing stated."""
        unstated_probability = np.full(
            self.probability.size, (1 - unstated) / (self.probability.size - 1)
        )
        unstated_probability[0] = unstated
        return np.log(np.maximum(self.probability, 1e-300) / unstated_probability)

    def optics(self, extinction_per_m: Floats) -> FogOptics:
        """Mean fog, for the extinctions (K,) of these probabilities."""
        return FogOptics(
            extinction_per_m=float(self.probability @ extinction_per_m),
            backscatter_per_m_sr=float(np.exp(self.probability @ self.log_median)),
            log_sigma=self.log_backscatter_sigma,
        )

    def log_density(self, backscatter: Floats) -> Floats:
        """Logarithm of the probability (K, B) of each cell of a backscattering grid (B,)."""
        log = np.log(backscatter)
        away = (log - self.log_median[:, None]) / self.log_sigma[:, None]
        cells = np.log(np.gradient(log)) - np.log(np.sqrt(2 * np.pi) * self.log_sigma)[:, None]
        return np.asarray(np.log(self.probability)[:, None] + cells - away**2 / 2)

    def update(self, weight: Floats, backscatter: Floats) -> Self:
        """Posterior with weights (K, B) of backscattering (B,) or (K, B)."""
        probability = weight.sum(axis=1)
        log = np.log(backscatter)
        within = weight / np.maximum(probability, 1e-300)[:, None]
        mean = (within * log).sum(axis=1)
        sigma = np.sqrt(np.maximum((within * log**2).sum(axis=1) - mean**2, 1e-12))
        valid = probability > 1e-12
        return type(self)(
            probability=probability,
            log_median=np.where(valid, mean, self.log_median),
            log_sigma=np.where(valid, sigma, self.log_sigma),
        )

    def predict(self, prior: Self) -> Self:
        """Prior of the next frame, for fog that drifts and rarely changes altogether."""
        predicted_sigma = np.hypot(self.log_sigma, DRIFT)
        probability = (1 - CHANGE) * self.probability + CHANGE * prior.probability
        # Neighbouring extinctions are reached by drift, not only by rare changes.
        spread = np.convolve(
            np.pad(probability, 1, mode="edge"), [CHANGE, 1 - 2 * CHANGE, CHANGE], "valid"
        )
        mixed = CHANGE * prior.probability / np.maximum(probability, 1e-300)
        median = (1 - mixed) * self.log_median + mixed * prior.log_median
        variance = (1 - mixed) * predicted_sigma**2 + mixed * prior.log_sigma**2
        variance += mixed * (1 - mixed) * (self.log_median - prior.log_median) ** 2
        return type(self)(spread / spread.sum(), median, np.sqrt(variance))


class FogSolver(NamedTuple):
    """Prior of a recording, and the solver from readings and prior to ranges and posterior."""

    prior: FogState
    solve: Callable[[Spots, FogState, Brightness | None], tuple[Ranges, FogState]]
