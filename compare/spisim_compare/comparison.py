"""What a comparison says: its verdict, and chi-squared by groups of readings."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from typing import Any

import numpy as np
from numpy.typing import NDArray
from scipy.stats import chi2

from reconstruction.base.arrays import Floats

from .causes import FACTOR
from .gaussian import Covariance
from .judging import Explained, Verdict
from .noise import NoiseTerm

UNEXPLAINED = 1e-3
"""Probability of the rest, below which it counts as not explained."""
WORST = 10
"""Number of readings in the table of the worst."""


@dataclass(frozen=True)
class Group:
    """Readings that belong together, such as those of a spot: their chi-squared."""

    name: str
    chi_squared: float
    freedom: int

    @property
    def probability(self) -> float:
        """Probability of a chi-squared at least as large by chance."""
        return float(chi2.sf(self.chi_squared, self.freedom)) if self.freedom else 1.0


def grouped(
    values: Floats, noise: Covariance, group: NDArray[np.intp], names: Sequence[str]
) -> list[Group]:
    """Chi-squared of differences (n,) in groups, with what readings of a group have in common."""
    groups = []
    for number, name in enumerate(names):
        some = group == number
        chi_squared = values[some] @ noise.only(some).solve(values[some]) if some.any() else 0.0
        groups.append(Group(name, float(chi_squared), int(np.count_nonzero(some))))
    return groups


@dataclass(frozen=True, eq=False)
class Comparison:
    """Two recordings side by side.

    Attributes
    ----------
    verdict
        Whether they differ, and why.
    z, remainder
        Difference of each reading (n,) over its standard deviation, real less simulated, before and
        after the causes; nan where a reading is not usable.
    names
        Name of each reading.
    groups
        Chi-squared of patterns and of each spot.
    group
        Number (n,) of the group of each reading.
    pictures
        Images (H, W) by name: real, simulated, and their difference.
    unit
        Unit of the pictures.
    facts
        Further figures about what was compared.
    noise
        Scatter between frames over that stated, by term.
    """

    verdict: Verdict
    z: Floats
    remainder: Floats
    names: Sequence[str]
    groups: Sequence[Group]
    group: NDArray[np.intp]
    pictures: Mapping[str, Floats] = field(default_factory=dict)
    unit: str = ""
    facts: Mapping[str, str] = field(default_factory=dict)
    noise: Sequence[NoiseTerm] = ()

    @property
    def worst(self) -> list[tuple[str, float, float]]:
        """Readings with the largest differences: name, z, and z after the causes."""
        order = np.argsort(-np.nan_to_num(np.abs(self.z)), kind="stable")[:WORST]
        return [(self.names[k], float(self.z[k]), float(self.remainder[k])) for k in order]

    def summary(self) -> dict[str, Any]:
        """Everything but the pictures, JSON-ready."""
        verdict = self.verdict
        return {
            "differ": verdict.alarm,
            "probability": verdict.probability,
            "chi_squared": verdict.chi_squared,
            "freedom": int(verdict.freedom),
            "cause": named(verdict),
            "causes": [_cause(each) for each in verdict.explained],
            "alternatives": list(verdict.alternatives),
            "rest_probability": verdict.rest,
            "tests": verdict.probabilities,
            "groups": [
                {"name": each.name, "chi_squared": each.chi_squared, "freedom": each.freedom}
                for each in self.groups
            ],
            "worst": [
                {"reading": name, "z": z, "z_explained": after} for name, z, after in self.worst
            ],
            "noise": [each._asdict() for each in self.noise],
        }


def named(verdict: Verdict) -> str:
    """The strongest cause; "equal" without an alarm, "unexplained" without a cause."""
    if not verdict.alarm:
        return "equal"
    return verdict.explained[0].cause.name if verdict.explained else "unexplained"


def parameters(explained: Explained) -> list[tuple[str, float, float]]:
    """Parameters of a cause with their standard errors, real less simulated, or a factor of both.

    A change x of a value m half way is one from m - x / 2 to m + x / 2: a power changes by the
    factor (2 + x) / (2 - x), visibility by that of the inverse extinctions.
    """
    rows = []
    for name, x, sigma in zip(
        explained.cause.parameters, explained.theta.tolist(), explained.sigma.tolist(), strict=True
    ):
        level = explained.cause.level
        if name == FACTOR:
            rows.append((name, *_factor(x, sigma)))
        else:
            rows.append((name, x, sigma))
        if abs(x) < level:
            rows.append(("visibility_factor", *_factor(-x / level, sigma / level)))
    return rows


def _factor(x: float, sigma: float) -> tuple[float, float]:
    """Factor of a relative change of the mean, and its standard error."""
    return (2 + x) / (2 - x), 4 * sigma / (2 - x) ** 2


def _cause(explained: Explained) -> dict[str, Any]:
    return {
        "name": explained.cause.name,
        "gain": explained.gain,
        "parameters": {
            name: {"value": value, "sigma": sigma} for name, value, sigma in parameters(explained)
        },
    }


def probability(value: float) -> str:
    """Format a probability; of a tiny one only a bound."""
    return "< 10⁻⁶" if value < 1e-6 else f"{value:.2g}"


def in_words(comparison: Comparison) -> list[str]:
    """The verdict, its causes and the largest differences as lines of text."""
    verdict = comparison.verdict
    chi_squared = f"chi-squared {verdict.chi_squared:.0f} of {verdict.freedom} readings"
    p = probability(verdict.probability)
    if not verdict.alarm:
        return [f"Equal within the noise: {chi_squared}, probability {p}."]
    lines = [
        f"They differ: {chi_squared}, probability of equality {probability(verdict.probability)}."
    ]
    for each in verdict.explained:
        values = ", ".join(
            f"{name.replace('_', ' ')} {value:.4g} ± {sigma:.2g}"
            for name, value, sigma in parameters(each)
        )
        lines.append(f"{each.cause.name}: {values}")
    if verdict.alternatives:
        lines.append(f"As good an explanation: {', '.join(verdict.alternatives)}.")
    if not verdict.explained:
        lines.append("No single cause explains it.")
    elif verdict.rest < UNEXPLAINED:
        lines.append(f"The rest is not explained, probability {probability(verdict.rest)}.")
    worst = ", ".join(f"{name} ({z:+.1f} sigma)" for name, z, _ in comparison.worst[:3])
    lines.append(f"Largest differences: {worst}.")
    return lines
