"""Whether two recordings differ by more than their noise, and which causes explain it.

Under the hypothesis that they are equal, the difference d of n readings is normal with a known
covariance C, and d^T C^-1 d follows chi-squared of n. A cause with directions G (n, k) predicts
d = G theta; its score statistic follows chi-squared of k and detects small changes of one kind that
drown in the noise of many readings. Readings of patterns, and of spots, are tested alone, too. An
alarm is raised where the smallest of these probabilities, times their number (Bonferroni), is below
`ALARM`.

Causes are not exact: a cause adds to C what it leaves open, in proportion to its size. What
is left may then exceed the noise by a factor, as no model is exact at any precision. Sets of
causes are compared by -2 ln of the likelihood at its maximum plus k ln n (G. Schwarz, Ann. Stat. 6,
461 (1978)), with `PER_CAUSE` for each cause more, less 2 ln of its odds a priori.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace
from itertools import combinations, pairwise, product

import numpy as np
from scipy.stats import chi2

from reconstruction.base.arrays import Floats

from .causes import Cause
from .gaussian import Covariance, Fit, least_squares

ALARM = 0.01
"""Probability of an alarm where nothing differs."""
PER_CAUSE = 8.0
"""By how much a further cause must lower the criterion."""
MAX_CAUSES = 3
ITERATIONS = 6
EVERYTHING, PATTERNS, SPOTS = "all readings", "readings of patterns", "readings of spots"
"""Names of the tests that no cause makes."""
ALL_OF_IT = "power"
"""The cause that contains the others of its family."""


@dataclass(frozen=True, eq=False)
class Difference:
    """Difference of readings (n,), the first ``patterns`` of patterns, and its covariance."""

    values: Floats
    noise: Covariance
    patterns: int


@dataclass(frozen=True, eq=False)
class Explained:
    """A cause with its parameters and their standard errors, (k,), and the change (n,) it makes.

    ``gain`` is by how much the criterion grows without it.
    """

    cause: Cause
    theta: Floats
    sigma: Floats
    change: Floats
    gain: float


@dataclass(frozen=True, eq=False)
class Verdict:
    """Result of a comparison.

    ``probabilities`` are those of the tests of equality by name, ``probability`` that of all
    together. ``explained`` are the causes, the strongest first; none without an alarm.
    ``remainder`` (n,) is the difference less their changes, over its standard deviation, and
    ``rest`` its probability. ``alternatives`` are causes that alone explain it about as well.
    """

    chi_squared: float
    freedom: int
    probabilities: dict[str, float]
    probability: float
    explained: tuple[Explained, ...]
    remainder: Floats
    rest: float
    alternatives: tuple[str, ...] = ()

    @property
    def alarm(self) -> bool:
        """Whether the recordings differ."""
        return self.probability < ALARM


def judge(difference: Difference, causes: Sequence[Cause]) -> Verdict:
    """Test for equality, and name causes if it fails."""
    equal, freedom = _plain(difference, ()), difference.values.size
    tests = _tests_of_readings(difference, equal)
    without_cause = len(tests)
    for cause in causes:
        fit = _plain(difference, [cause])
        gained = max(equal.chi_squared - fit.chi_squared, 0.0)
        rank = _rank([cause])
        if rank:
            tests[cause.name] = float(chi2.sf(gained, rank))
    probability = min(1.0, min(tests.values()) * len(tests))
    chosen: tuple[Explained, ...] = ()
    alternatives: tuple[str, ...] = ()
    sigma = np.sqrt(difference.noise.total)
    remainder, rest = equal.remainder / sigma, tests[EVERYTHING]
    if probability < ALARM:
        of_causes = min([*tests.values()][without_cause:], default=1.0)
        best, alternatives = _best(difference, causes, by_cause=of_causes * len(tests) < ALARM)
        chosen = _explained(difference, best)
        remainder = best.fit.remainder / sigma
        rest = float(chi2.sf(best.fit.chi_squared, max(freedom - best.fit.theta.size, 1)))
    return Verdict(
        equal.chi_squared, freedom, tests, probability, chosen, remainder, rest, alternatives
    )


def _tests_of_readings(difference: Difference, equal: Fit) -> dict[str, float]:
    """Probabilities of chi-squared: of everything, and of patterns and spots where there are both.

    The few readings of spots would drown in the many of patterns.
    """
    n = difference.values.size
    tests = {EVERYTHING: float(chi2.sf(equal.chi_squared, n))}
    of_patterns = np.arange(n) < difference.patterns
    for name, some in ((PATTERNS, of_patterns), (SPOTS, ~of_patterns)):
        count = int(np.count_nonzero(some))
        if 0 < count < n:
            values = difference.values[some]
            chi_squared = values @ difference.noise.only(some).solve(values)
            tests[name] = float(chi2.sf(chi_squared, count))
    return tests


@dataclass(frozen=True, eq=False)
class _Hypothesis:
    """A set of causes, its fit and the criterion."""

    causes: tuple[Cause, ...]
    fit: Fit
    criterion: float


def _best(
    difference: Difference, causes: Sequence[Cause], *, by_cause: bool
) -> tuple[_Hypothesis, tuple[str, ...]]:
    """The best set of causes, and those that alone are nearly as good but of another family.

    It is not empty if the test of a cause raised the alarm.
    """
    fits = [_hypothesis(difference, each) for each in _sets(causes)]
    possible = [
        each
        for each in fits
        if (each.causes or not by_cause)
        and all(map(Cause.allows, each.causes, _parts(each.causes, each.fit.theta)))
    ]
    nothing = next(each for each in fits if not each.causes)
    best = min(possible or [nothing], key=lambda each: each.criterion)
    families = {each.family for each in best.causes}
    near = [
        each.causes[0].name
        for each in sorted(possible, key=lambda each: each.criterion)
        if len(each.causes) == 1
        and each.criterion < best.criterion + PER_CAUSE
        and each.causes[0].family not in families
    ]
    return best, tuple(near)


def _sets(causes: Sequence[Cause]) -> Iterator[tuple[Cause, ...]]:
    """Sets of at least one cause that can be distinguished."""
    yield ()
    for size in range(1, MAX_CAUSES + 1):
        for some in combinations(causes, size):
            names = {each.name for each in some}
            family = [each for each in some if each.family == ALL_OF_IT]
            if ALL_OF_IT in names and len(family) > 1:
                continue
            if _rank(some) == sum(len(each.parameters) for each in some):
                yield some


def _rank(causes: Sequence[Cause]) -> int:
    """Number of parameters that the readings determine."""
    columns = np.hstack([each.directions for each in causes])
    lengths = np.linalg.norm(columns, axis=0)
    columns = columns / np.where(lengths > 0, lengths, 1)
    return int(np.linalg.matrix_rank(columns, 1e-6))


def _plain(difference: Difference, causes: Sequence[Cause]) -> Fit:
    return least_squares(difference.values, _directions(difference, causes), difference.noise)


def _directions(difference: Difference, causes: Sequence[Cause]) -> Floats:
    """Directions (n, k) of all causes, side by side."""
    none = np.zeros((difference.values.size, 0))
    return np.hstack([none, *(each.directions for each in causes)])


def _hypothesis(difference: Difference, causes: tuple[Cause, ...]) -> _Hypothesis:
    """Fit with the errors of the causes, in the likeliest of their scales."""
    fits = [_scaled(difference, each) for each in product(*map(_at_scales, causes))]
    best = min(fits, key=lambda each: each.criterion)
    return replace(best, causes=causes)


def _at_scales(cause: Cause) -> list[Cause]:
    return [replace(cause, unsure=scale * cause.unsure) for scale in cause.scales]


def _scaled(difference: Difference, causes: tuple[Cause, ...]) -> _Hypothesis:
    """Fit with the errors of the causes, which grow with their size."""
    fit, noise = _plain(difference, causes), difference.noise
    columns = _directions(difference, causes)
    for _ in range(ITERATIONS):
        noise = difference.noise
        errors = _parts(causes, np.sqrt(np.diag(fit.covariance)))
        for cause, theta, error in zip(causes, _parts(causes, fit.theta), errors, strict=True):
            noise = _with_errors(noise, cause, theta, error, difference.patterns)
        fit = least_squares(difference.values, columns, noise)
    n = difference.values.size
    criterion = _misfit(fit.chi_squared, n)
    criterion += noise.log_determinant - difference.noise.log_determinant
    criterion += fit.theta.size * np.log(n)
    criterion += sum(PER_CAUSE - 2 * np.log(cause.odds) for cause in causes)
    return _Hypothesis(causes, fit, float(criterion))


def _misfit(chi_squared: float, n: int) -> float:
    """-2 ln of the likelihood of ``n`` readings, whose noise may be larger than stated."""
    scale = max(chi_squared / n, 1.0)
    return float(n * np.log(scale) + chi_squared / scale)


def _parts(causes: Sequence[Cause], theta: Floats) -> list[Floats]:
    """Parameters of each cause."""
    ends = np.cumsum([0, *(len(each.parameters) for each in causes)])
    return [theta[start:stop] for start, stop in pairwise(ends)]


def _with_errors(
    noise: Covariance, cause: Cause, theta: Floats, error: Floats, patterns: int
) -> Covariance:
    change = cause.directions @ theta
    size = float(np.linalg.norm([theta, error]))  # rms, as theta is known within its error alone
    loose = np.zeros_like(change)
    of_patterns, of_spots = change[:patterns], change[patterns:]
    if of_patterns.size:  # what all share is in `unsure`
        loose[:patterns] = cause.loose**2 * float(np.var(of_patterns))
    if of_spots.size:
        loose[patterns:] = cause.loose**2 * float(np.mean(of_spots**2))
    return replace(noise, variance=noise.variance + loose).plus([size * cause.unsure])


def _explained(difference: Difference, best: _Hypothesis) -> tuple[Explained, ...]:
    sigmas = _parts(best.causes, np.sqrt(np.diag(best.fit.covariance)))
    explained = []
    for number, theta in enumerate(_parts(best.causes, best.fit.theta)):
        cause = best.causes[number]
        without = tuple(each for each in best.causes if each is not cause)
        gain = _hypothesis(difference, without).criterion - best.criterion
        explained.append(Explained(cause, theta, sigmas[number], cause.directions @ theta, gain))
    return tuple(sorted(explained, key=lambda each: -each.gain))
