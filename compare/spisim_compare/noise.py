"""Noise as the scatter between frames shows it, held against what a capture states."""

from typing import NamedTuple

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture

from .midpoint import SpotModel
from .patterns import Mean

MIN_READINGS = 30
"""Minimum degrees of freedom of a scatter worth stating."""

MAX_SIGMA = 1.0
"""Maximum standard error of a ratio worth stating: readings of equal light do not tell terms."""


class NoiseTerm(NamedTuple):
    """Variance of a term of the noise over that stated, and its standard error."""

    capture: str
    term: str
    ratio: float
    sigma: float


def noise_terms(name: str, capture: Capture, patterns: Mean, spots: Mean | None) -> list[NoiseTerm]:
    """Terms of the noise of a capture; none from a single frame."""
    terms = _total(name, "readings of patterns", patterns) if capture.plan.shows_image else []
    if terms:
        terms += _by_light(name, capture, patterns)
    if spots is not None:
        terms += _total(name, "readings of spots", spots)
    return terms


def noise_of(
    captures: dict[str, Capture], means: tuple[Mean, Mean], spots: SpotModel | None
) -> list[NoiseTerm]:
    """Terms of both captures, by their names."""
    of_spots = (None, None) if spots is None else spots.means
    return [
        term
        for (name, capture), mean, own in zip(captures.items(), means, of_spots, strict=True)
        for term in noise_terms(name, capture, mean, own)
    ]


def _total(name: str, term: str, mean: Mean) -> list[NoiseTerm]:
    known = np.isfinite(mean.scatter)
    freedom = (mean.frames[known] - 1).astype(np.float64)
    if freedom.sum() < MIN_READINGS:
        return []
    ratio = float(freedom @ mean.scatter[known] / freedom.sum())
    return [NoiseTerm(name, term, ratio, ratio * float(np.sqrt(2 / freedom.sum())))]


def _by_light(name: str, capture: Capture, mean: Mean) -> list[NoiseTerm]:
    """Variance that grows with the light, and that which does not, by weighted least squares."""
    buckets = capture.buckets
    if buckets.unit != "electron" or np.isnan(buckets.noise_electrons):
        return []
    known = np.isfinite(mean.scatter)
    stated = (mean.variance * np.maximum(mean.frames, 1))[known]
    electronics = np.full(stated.size, buckets.noise_electrons**2)
    shot = stated - electronics
    error: Floats = stated * np.sqrt(2 / (mean.frames[known] - 1))
    model = np.column_stack([shot, electronics]) / error[:, None]
    if np.linalg.matrix_rank(model) < 2:
        return []
    covariance = np.linalg.inv(model.T @ model)
    ratio = covariance @ (model.T @ (mean.scatter[known] * stated / error))
    sigma = np.sqrt(np.diag(covariance))
    terms = ("shot noise of patterns", "electronics noise of patterns")
    return [
        NoiseTerm(name, term, value, own)
        for term, value, own in zip(terms, ratio.tolist(), sigma.tolist(), strict=True)
        if own < MAX_SIGMA
    ]
