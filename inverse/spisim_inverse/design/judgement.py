"""Base and chosen instrument on the same scenes, paired, with intervals over scenes."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np
from scipy.stats import t

from reconstruction.base.arrays import Floats, Mask
from spisim_inverse.design.objectives import LIMIT_M, OBJECTIVES
from spisim_inverse.design.sampling import RANGES, Sample

RESAMPLES = 1000
MIN_FINITE = 0.95
"""Fraction of resamples that need a figure: without the others it would look too sure."""
Pairs = Sequence[tuple[Sample, Sample]]
"""Samples of the same cases, by base and by chosen instrument."""


@dataclass(frozen=True)
class Compared:
    """A figure of base and chosen instrument in one weather.

    ``sigma`` is the standard error of the ratio's logarithm, or of the difference of percentages,
    over ``worlds`` independent scenes.
    """

    weather: str
    name: str
    unit: str
    base: float
    chosen: float
    sigma: float
    worlds: int

    @property
    def is_fraction(self) -> bool:
        """Whether the change is a difference."""
        return self.unit == "%"

    @property
    def change(self) -> float:
        """Chosen over base, or their difference."""
        if self.is_fraction:
            return self.chosen - self.base
        return self.chosen / self.base if self.base else np.nan

    def interval(self, confidence: float = 0.95) -> tuple[float, float]:
        """Student's interval of the change."""
        if self.worlds < 2:
            return -np.inf, np.inf
        half = float(t.isf((1 - confidence) / 2, self.worlds - 1)) * self.sigma
        if self.is_fraction:
            return self.change - half, self.change + half
        return self.change * float(np.exp(-half)), self.change * float(np.exp(half))

    @property
    def better(self) -> bool | None:
        """Whether the chosen instrument is better; None if the interval does not say."""
        low, high = self.interval()
        same = 0.0 if self.is_fraction else 1.0
        if not np.isfinite(low) or low <= same <= high:
            return None
        return (self.change > same) == (self.name == WITH_A_RANGE)

    def summary(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        low, high = self.interval()
        return {**vars(self), "change": self.change, "low": low, "high": high}


WITH_A_RANGE, WRONG = "spots with a range", f"ranges wrong by more than {LIMIT_M:g} m"
BY_BOTH = "rms error of spots ranged by both"
BOUND = "rms bound of the same spots"


def judge(
    base: Sequence[Sample], chosen: Sequence[Sample], objectives: Sequence[str]
) -> list[Compared]:
    """All figures in each weather.

    Parameters
    ----------
    base, chosen
        Samples of the same cases, in the same order.
    objectives
        Their names; errors of ranges are also compared spot by spot.
    """
    pairs = list(zip(base, chosen, strict=True))
    figures: dict[str, tuple[str, Callable[[Pairs], tuple[float, float]]]] = {
        OBJECTIVES[name].title: (OBJECTIVES[name].unit, _objective(name)) for name in objectives
    }
    sampled = {OBJECTIVES[name].samples for name in objectives}
    if RANGES in sampled:
        figures |= {
            BY_BOTH: ("m", _rmse_by_both),
            WITH_A_RANGE: ("%", _fraction(np.isfinite)),
            WRONG: ("%", _fraction(lambda error_m: np.abs(error_m) > LIMIT_M)),
        }
    if RANGES in sampled and all(each.bound_m.size for each, _ in pairs if each.counts.any()):
        figures[BOUND] = "m", _bound_by_both
    return [
        compared(weather, name, unit, of, [pair for pair in pairs if pair[0].weather == weather])
        for weather in dict.fromkeys(each.weather for each in base)
        for name, (unit, of) in figures.items()
    ]


def compared(
    weather: str, name: str, unit: str, of: Callable[[Pairs], tuple[float, float]], pairs: Pairs
) -> Compared:
    """A figure with the error of its change, by the bootstrap over worlds."""
    worlds = list(dict.fromkeys(each.world for each, _ in pairs))
    members = [[pair for pair in pairs if pair[0].world == world] for world in worlds]

    def change(some: Pairs) -> float:
        before, after = of(some)
        with np.errstate(divide="ignore", invalid="ignore"):
            return after - before if unit == "%" else float(np.log(np.divide(after, before)))

    sigma = np.inf
    if len(worlds) > 1:
        rng = np.random.default_rng(0)
        draws = rng.integers(len(worlds), size=(RESAMPLES, len(worlds)))
        changes = np.array([change([p for n in draw for p in members[n]]) for draw in draws])
        changes = changes[np.isfinite(changes)]
        if changes.size > MIN_FINITE * RESAMPLES:
            sigma = float(np.sqrt(len(worlds) / (len(worlds) - 1)) * changes.std())
    return Compared(weather, name, unit, *of(pairs), sigma, len(worlds))


def _objective(name: str) -> Callable[[Pairs], tuple[float, float]]:
    of = OBJECTIVES[name].of
    return lambda pairs: (of([each for each, _ in pairs]), of([each for _, each in pairs]))


def _rms(values: Floats) -> float:
    return float(np.sqrt(np.mean(values**2))) if values.size else np.nan


def _rmse_by_both(pairs: Pairs) -> tuple[float, float]:
    errors = [_joined(pairs, number) for number in (0, 1)]
    both = np.isfinite(errors[0]) & np.isfinite(errors[1])
    return _rms(errors[0][both]), _rms(errors[1][both])


def _bound_by_both(pairs: Pairs) -> tuple[float, float]:
    both = np.isfinite(_joined(pairs, 0)) & np.isfinite(_joined(pairs, 1))
    bounds = [
        np.concatenate(
            [np.tile(pair[n].bound_m, (len(pair[n].error_m), 1))[:, pair[n].counts].ravel()
             for pair in pairs if pair[n].counts.any()]
        )
        for n in (0, 1)
    ]  # fmt: skip
    return _rms(bounds[0][both]), _rms(bounds[1][both])


def _joined(pairs: Pairs, number: int) -> Floats:
    return np.concatenate([pair[number].error_m[:, pair[number].counts].ravel() for pair in pairs])


def _fraction(hits: Callable[[Floats], Mask]) -> Callable[[Pairs], tuple[float, float]]:
    """Per cent of the spots that count."""

    def of(pairs: Pairs) -> tuple[float, float]:
        one, other = (100 * float(np.mean(hits(_joined(pairs, number)))) for number in (0, 1))
        return one, other

    return of
