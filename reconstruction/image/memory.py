"""What earlier frames tell of the coefficients of the next: a Kalman filter, coefficient by
coefficient, over several speeds at which a scene may move.

A coefficient x of variance S from image to image has in a later frame the value a x + w with
var w = (1 - a^2) S: the image as a whole stays as likely as it was, and a tells how much of it is
left. Where the image shifts by v pixels a frame, N(0, delta^2) along either axis, a cosine of f
cycles per pixel keeps exp(-(2 pi f delta n)^2 / 2) of its phase for n frames, so with the prior
spectrum S(f) and the weights A of a row's cosines one frame leaves
a = sum(A^2 S exp(...)) / sum(A^2 S). Things that move go on moving: what is n frames old has lost
a^(n^2), and loses a^(2n + 1) until the next frame. How fast the scene moves is not known: each of
some speeds, from none to a cut (a = 0), is as likely as the new readings are when it is assumed,

    y ~ N(a m, (1 - a^2 rho) S + r),

where m is the mean and (1 - rho) S the variance that earlier frames leave, and r the noise of y.
Weights of the speeds follow a Markov chain; the mixture is replaced by one Gaussian for each
coefficient (generalised pseudo-Bayes of first order: G. A. Ackerson, K. S. Fu, IEEE Trans. Autom.
Control 15, 10 (1970)), with a mean of m sum(p a) and rho sum(p a^2) in place of rho.

What is handed on are not the posterior means, which the prior has drawn towards zero, but values
with noise that would give these with the prior: measurements as any image method takes them.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients
from .dictionaries.dct import DICTIONARY
from .prior import fit_scale

SPEEDS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)
"""Pixels that the image may shift by from one frame to the next, rms along either axis."""
FASTER = 0.6
"""Probability of each speed beforehand, over that of the one before it."""
CUT = 0.05
"""Probability beforehand that a frame shows something else than the one before it."""
CHANGE = 0.2
"""Probability that the scene moves otherwise than before, as it may beforehand."""
LEVEL = 100.0
"""Variance of the level over that of the coefficient that varies most."""
MIN_NOISE = 1e-4
"""Least rms noise of a coefficient over what they vary by: no scene holds still more exactly."""
FORGOTTEN = 1e-6
"""Share of a coefficient's variance below which what earlier frames explain of it is dropped."""


class Memory:
    """Coefficients of an operator (K, N) as far as the frames until now tell them.

    ``weights``: how likely each of the ``speeds`` is, in pixels a frame, rms along either axis, and
    as the last a cut.
    """

    def __init__(self, operator: MeasurementOperator, speeds: Sequence[float] = SPEEDS) -> None:
        self.operator = operator
        self._expected, self._left = _expected_and_left(operator, speeds)
        near = FASTER ** np.arange(len(speeds))
        self._predicted = np.append((1 - CUT) * near / near.sum(), CUT)
        self.weights = self._predicted
        self._values: NDArray[np.inexact] = np.zeros(operator.shape[0])
        self._precision = np.zeros(operator.shape[0])
        self._age = np.zeros(operator.shape[0])
        self._scale = 0.0

    def take(self, rows: NDArray[np.intp], coefficients: Coefficients) -> Coefficients:
        """All coefficients (K,) after a frame that tells those of these ``rows`` (n,)."""
        length = self.operator.row_length
        seen = coefficients.measured
        rows, values = rows[seen], coefficients.values[seen] / length
        prior, noise = self._scaled(rows, values, (coefficients.noise[seen] / length) ** 2)
        if prior is not None:
            self._predict(prior, rows, values, noise)
            self._update(rows, values, noise)
        with np.errstate(divide="ignore"):
            return Coefficients(self._values * length, length / np.sqrt(self._precision))

    def _scaled(
        self, rows: NDArray[np.intp], values: NDArray[np.inexact], noise: Floats
    ) -> tuple[Floats | None, Floats]:
        """Prior variance (K,) at the scale of this image, and noise (n,) that is not zero.

        No variance where the image is flat and without noise. As faint images may seem to be flat
        by chance, the scale at most halves from frame to frame.
        """
        varying = rows != self._level
        expected = self._expected[rows[varying]]
        measured = values[varying]
        if not measured.any():
            return None, noise
        noise = np.maximum(noise, MIN_NOISE**2 * np.mean(np.abs(measured) ** 2))
        self._scale = max(fit_scale(measured, expected, noise[varying]), self._scale / 2)
        return self._expected * self._scale, noise

    @property
    def _level(self) -> int:
        return -1 if self.operator.level is None else self.operator.level

    def _predict(
        self,
        prior: Floats,
        rows: NDArray[np.intp],
        values: NDArray[np.inexact],
        noise: Floats,
    ) -> None:
        """Weigh the speeds by the new readings, and let what is known fade accordingly."""
        reported = self._precision * prior
        rho = reported / (1 + reported)
        fading = self._left ** (2 * self._age + 1)
        left = fading[:, rows]
        variance = (1 - left**2 * rho[rows]) * prior[rows] + noise
        error = np.abs(values - left * (rho * self._values)[rows]) ** 2
        evidence = -(error / variance + np.log(variance)).sum(axis=1) / 2
        expected = (1 - CHANGE) * self.weights + CHANGE * self._predicted
        weights = expected * np.exp(evidence - evidence.max())
        self.weights = weights / weights.sum()
        mean = (self.weights @ fading) * rho * self._values
        rho = (self.weights @ fading**2) * rho
        self._age += 1
        rho[rho < FORGOTTEN] = 0
        self._values = np.divide(mean, rho, out=np.zeros_like(mean), where=rho > 0)
        self._precision = rho / (prior * (1 - rho))

    def _update(self, rows: NDArray[np.intp], values: NDArray[np.inexact], noise: Floats) -> None:
        """Mean of what is known and what is read, each by its precision."""
        before = self._precision[rows]
        self._precision[rows] = before + 1 / noise
        self._age[rows] *= before / self._precision[rows]
        valid = before * self._values[rows] + values / noise
        self._values = self._values.astype(valid.dtype)
        self._values[rows] = valid / self._precision[rows]


def _expected_and_left(
    operator: MeasurementOperator, speeds: Sequence[float]
) -> tuple[Floats, Floats]:
    """Prior variance (K,) up to a common factor, and what a frame of each speed and a cut leave."""
    height, width = operator.image_shape
    sigma = DICTIONARY.sigma(operator.image_shape)
    atoms = operator.in_atoms(DICTIONARY.atoms(height), DICTIONARY.atoms(width))
    varying = operator.varying
    expected = np.empty(operator.shape[0])
    expected[varying] = atoms.by_row(sigma**2)
    left = np.zeros((len(speeds) + 1, operator.shape[0]))
    # 2 pi f, as the deviation is 1 / 2f; the constant, which has none, stays.
    turn = np.divide(np.pi, sigma, out=np.zeros_like(sigma), where=sigma > 0)
    for retained, speed in zip(left, speeds, strict=False):
        decayed = sigma**2 * np.exp(-((turn * speed) ** 2) / 2)
        retained[varying] = atoms.by_row(decayed) / expected[varying]
    if operator.level is not None:
        # The level changes by as much as the coefficient that varies most, and a cut changes all.
        maximum = np.argmax(np.where(varying, expected, 0.0))
        expected[operator.level] = LEVEL * expected[maximum]
        changed = (1 - left[:-1, maximum] ** 2) / LEVEL
        left[:-1, operator.level] = np.sqrt(1 - changed)
    return expected, left
