"""What a fit found: estimates, covariance, goodness of fit."""

from __future__ import annotations

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from functools import cached_property
from typing import Any, NamedTuple

import numpy as np
from scipy.stats import chi2

from reconstruction.base.arrays import Floats
from spisim_compare.comparison import Group, grouped, probability
from spisim_compare.gaussian import Covariance
from spisim_inverse.fit.information import Information
from spisim_inverse.fit.model import Model
from spisim_inverse.fit.parameters import THROUGHPUT
from spisim_inverse.fit.priors import Prior
from spisim_inverse.fit.twin import Twin

UNLIKELY = 1e-3
"""Probability of chi-squared below which the scene does not fit."""
WORST = 10


class Estimate(NamedTuple):
    """A parameter's estimate.

    ``sigma`` is that of the value; of positive ones the logarithm is normal, with
    ``log_sigma``; else that is nan.
    """

    name: str
    unit: str
    value: float
    sigma: float
    log_sigma: float
    start: float


@dataclass(frozen=True, eq=False)
class Fitted:
    """Outcome of a fit.

    Attributes
    ----------
    model
        The twin and its free parameters.
    coordinates
        Where the likelihood is greatest (k,).
    information
        Fisher information there, with that of the priors.
    bound
        Cramér–Rao bound (k, k) of the coordinates' covariance by the noise of the recording alone,
        as if the light were traced without error.
    difference, noise
        Recorded less expected counts (n,) of the usable readings, and their covariance.
    scores
        Slope (clusters, k) of the log likelihood there by the readings of each `Model.cluster`;
        that of all is 0.
    uninformed
        Parameters on which the recording does not depend; they keep their starts.
    at_bounds
        Estimates at a bound, whose sigma means nothing.
    """

    model: Model
    coordinates: Floats
    information: Information
    bound: Floats
    difference: Floats
    noise: Covariance
    scores: Floats
    uninformed: Sequence[str]
    at_bounds: Sequence[str]
    priors: Mapping[str, Prior]
    spp: int

    @property
    def twin(self) -> Twin:
        """The twin with the estimates."""
        return self.model.at(self.coordinates)

    @property
    def estimates(self) -> list[Estimate]:
        """Estimates in the order in which parameters were named."""
        sigmas = np.sqrt(np.diag(self.covariance))
        return [
            Estimate(
                each.name,
                each.unit,
                each.value(x),
                abs(each.slope(each.value(x))) * sigma,
                sigma if each.positive else np.nan,
                each.start,
            )
            for each, x, sigma in zip(
                self.model.parameters, self.coordinates.tolist(), sigmas.tolist(), strict=True
            )
        ]

    @cached_property
    def scale(self) -> Floats:
        """Factor (k,) on the errors of a model that does not fit, 1 of one that does.

        What the model leaves out is as large as the residuals: the root of chi-squared per degree
        of freedom, if each reading has its own (R. T. Birge, Phys. Rev. 40, 207 (1932)). Patterns,
        a spot, or a frame of a flight may have it in common: then the scores of these clusters say
        how far their estimates differ (K.-Y. Liang & S. L. Zeger, Biometrika 73, 13 (1986),
        eq. 8). The larger of both counts. Errors that all have in common remain unknown.
        """
        if self.fits:
            return np.ones(len(self.coordinates))
        own = self.information.covariance
        scores = self.scores[self.scores.any(axis=1)]
        count = len(scores)
        spread = (scores @ own).std(axis=0) * count / np.sqrt(max(count - 1, 1))
        by_cluster = spread / np.sqrt(np.diag(own))
        return np.maximum(by_cluster, np.sqrt(self.chi_squared / self.freedom))

    @cached_property
    def covariance(self) -> Floats:
        """Covariance (k, k) of the coordinates: logarithms of positive parameters."""
        return np.outer(self.scale, self.scale) * self.information.covariance

    @property
    def correlation(self) -> Floats:
        """Correlations (k, k) of the estimates."""
        sigma = np.sqrt(np.diag(self.covariance))
        return np.asarray(self.covariance / np.outer(sigma, sigma))

    @property
    def chi_squared(self) -> float:
        """Of the usable readings, with what they have in common."""
        return float(self.difference @ self.noise.solve(self.difference))

    @property
    def freedom(self) -> int:
        """Readings less fitted parameters."""
        return max(self.difference.size - len(self.coordinates), 1)

    @property
    def probability(self) -> float:
        """Probability of so large a chi-squared if the model were right."""
        return float(chi2.sf(self.chi_squared, self.freedom))

    @property
    def fits(self) -> bool:
        """Whether the model explains the recording."""
        return self.probability >= UNLIKELY

    @property
    def z(self) -> Floats:
        """Difference of each usable reading over its standard deviation."""
        return self.difference / np.sqrt(self.noise.total)

    @property
    def worst(self) -> list[tuple[str, float]]:
        """Readings with the largest differences, and their z."""
        used = np.flatnonzero(self.model.usable)
        order = np.argsort(-np.abs(self.z), kind="stable")[:WORST]
        return [(self.model.names[used[k]], float(self.z[k])) for k in order]

    @property
    def groups(self) -> list[Group]:
        """Chi-squared of patterns and of each spot."""
        model = self.model
        return grouped(self.difference, self.noise, model.group[model.usable], model.groups)

    @property
    def warnings(self) -> list[str]:
        """What limits the meaning of the estimates."""
        lines = [f"{name} is at its bound: its sigma means nothing" for name in self.at_bounds]
        lines += [
            f"the recording does not depend on {name}: it kept its start"
            for name in self.uninformed
        ]
        if not self.fits:
            lines.append(
                f"the model does not fit: sigmas are {_span(self.scale)} times those of the noise"
            )
        return lines

    def summary(self) -> dict[str, Any]:
        """Everything in plain numbers."""
        return {
            "fits": self.fits,
            "chi_squared": self.chi_squared,
            "freedom": self.freedom,
            "probability": self.probability,
            "scale": self.scale.tolist(),
            "estimates": [each._asdict() for each in self.estimates],
            "covariance_of_coordinates": self.covariance.tolist(),
            "condition": self.information.condition,
            "weakest": self.information.weakest,
            "not_determined": list(self.uninformed),
            "at_bounds": list(self.at_bounds),
            "groups": [
                {"name": each.name, "chi_squared": each.chi_squared, "freedom": each.freedom}
                for each in self.groups
            ],
            "worst": [{"reading": name, "z": z} for name, z in self.worst],
        }


def _span(values: Floats) -> str:
    """Smallest and largest, or one number where they are the same."""
    low, high = f"{values.min():.2g}", f"{values.max():.2g}"
    return low if low == high else f"{low} to {high}"


def factors_of_patterns(fitted: Fitted) -> list[Estimate]:
    """Throughput of each pattern: too many numbers for a table."""
    return [each for each in fitted.estimates if each.name.startswith(f"{THROUGHPUT}[")]


def in_words(fitted: Fitted) -> list[str]:
    """Estimates and goodness of fit as lines of text."""
    factors = factors_of_patterns(fitted)
    lines = [
        f"{each.name} {each.value:.4g} ± {each.sigma:.2g} {each.unit}".removesuffix(" 1")
        for each in fitted.estimates
        if each not in factors
    ]
    if factors:
        scatter = np.std([each.value for each in factors])
        sigma = np.median([each.sigma for each in factors])
        lines.append(
            f"{THROUGHPUT} of {len(factors)} patterns: scatter {scatter:.2g}, each ± {sigma:.2g}"
        )
    verdict = "the model fits" if fitted.fits else "the model does not fit"
    lines.append(
        f"chi-squared {fitted.chi_squared:.0f} of {fitted.freedom}, probability "
        f"{probability(fitted.probability)}: {verdict}"
    )
    if not fitted.fits:
        worst = ", ".join(f"{name} ({z:+.1f} sigma)" for name, z in fitted.worst[:3])
        lines.append(f"Largest differences: {worst}.")
    return lines
