"""Compare two captures of what should be the same."""

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats, Mask
from reconstruction.base.errors import InputError
from reconstruction.capture import Capture

from .causes import Causes
from .comparison import Comparison, grouped
from .gaussian import Covariance
from .judging import Difference, judge
from .light_error import with_light_error
from .midpoint import Midpoint
from .noise import noise_of
from .patterns import common_noise, names_of_patterns
from .same import check_comparable


def compare(real: Capture, simulated: Capture) -> Comparison:
    """Compare two captures.

    Parameters
    ----------
    real, simulated
        Captures of the same patterns and spots; the means over their frames are compared. If one is
        a simulation, the error of its light counts as noise.

    Returns
    -------
    Comparison
        The test of equality, causes that explain a difference, and the readings behind it.

    Raises
    ------
    InputError
        If the captures are not comparable, or the noise of both is unknown.
    """
    check_comparable(real, simulated)
    midpoint = Midpoint.of(real, simulated)
    values, noise, usable = _difference(midpoint)
    patterns = int(usable[: midpoint.patterns.size].sum())
    difference = Difference(values[usable], noise.only(usable), patterns)
    causes = [each.only(usable) for each in Causes(midpoint)()]
    verdict = judge(difference, causes)
    z, remainder = np.full((2, usable.size), np.nan)
    z[usable] = difference.values / np.sqrt(difference.noise.total)
    remainder[usable] = verdict.remainder
    group, names = _groups(midpoint)
    return Comparison(
        verdict,
        z,
        remainder,
        _names(midpoint),
        grouped(difference.values, difference.noise, group[usable], names),
        group,
        _pictures(midpoint),
        f"{simulated.buckets.unit}s",
        _facts(midpoint),
        noise_of({"real": real, "simulated": simulated}, midpoint.means, midpoint.spots),
    )


def _groups(midpoint: Midpoint) -> tuple[NDArray[np.intp], list[str]]:
    """Patterns are a group, and so is each spot."""
    patterns = np.zeros(midpoint.patterns.size, np.intp)
    if midpoint.spots is None:
        return patterns, ["patterns"]
    of_spots = midpoint.spots.spot + 1
    names = [f"spot {spot}" for spot in range(int(of_spots.max()))]
    return np.concatenate([patterns, of_spots]), ["patterns", *names]


def _pictures(midpoint: Midpoint) -> dict[str, Floats]:
    """Image of each capture and their difference; none without an image."""
    if not midpoint.simulated.plan.shows_image:
        return {}
    real, simulated = midpoint.images
    return {"real": real, "simulated": simulated, "real less simulated": real - simulated}


def _facts(midpoint: Midpoint) -> dict[str, str]:
    facts = {
        "frames": f"{midpoint.real.frames} real, {midpoint.simulated.frames} simulated",
        **midpoint.simulated.setup.facts,
    }
    if midpoint.fog is not None:
        facts["extinction, estimated"] = f"{midpoint.fog.extinction_per_m:.3g} /m"
    return facts


def _difference(midpoint: Midpoint) -> tuple[Floats, Covariance, Mask]:
    """Difference of all readings (n,), its covariance, and which are usable.

    Raises InputError if none is.
    """
    one, other = midpoint.means
    values, usable = [one.value - other.value], [one.usable & other.usable]
    if not midpoint.simulated.plan.shows_image:
        usable[0] = np.zeros_like(usable[0])
    variances = [common_noise(one, other)]
    spots = midpoint.spots
    if spots is not None:
        values.append(spots.means[0].value - spots.means[1].value)
        variances.append(spots.variance)
        usable.append(spots.usable)
    if not any(each.any() for each in usable):
        raise InputError("no reading is usable in both captures: all are saturated")
    noise = Covariance(np.concatenate(variances), np.zeros((sum(map(len, values)), 0)))
    for capture in (midpoint.real, midpoint.simulated):
        noise = with_light_error(noise, capture, midpoint)
    return np.concatenate(values), noise, np.concatenate(usable)


def _names(midpoint: Midpoint) -> list[str]:
    names = names_of_patterns(midpoint.simulated.setup.plans)
    return names + ([] if midpoint.spots is None else midpoint.spots.names)
