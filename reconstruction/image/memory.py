"""Kalman filter over frames, coefficient by coefficient, for several speeds of scene motion.

From one frame to the next, a coefficient x of variance S becomes a x + w with var w = (1 - a^2) S:
the image as a whole stays equally likely, and a is the fraction retained. If the image shifts by v
pixels per frame, N(0, delta^2) along either axis, a cosine of f cycles per pixel retains exp(-(2 pi
f delta n)^2 / 2) of its phase after n frames. With the prior spectrum S(f) and the weights A of a
row's cosines, one frame retains a = sum(A^2 S exp(...)) / sum(A^2 S). Motion persists: after n
frames a^(n^2) is retained, and a factor a^(2n + 1) of it until the next frame. The speed is
unknown: each of several speeds, from none to a cut (a = 0), is weighted by the likelihood of the
new readings,

    y ~ N(a m, (1 - a^2 rho) S + r),

where m is the mean and (1 - rho) S the variance given earlier frames, and r the noise variance of
y. Where poses and depths tell how the last image moves, or all of it but a veil that stays with the
camera, each speed is also tried on the mean after that change. A change c with error e c makes the
mean k (m + c) and rho k rho, with k = rho S / (rho S + e^2 c^2). The weights follow a Markov chain,
in which speeds change sooner than whether changes are right; the mixture is approximated by one
Gaussian per coefficient (after generalised pseudo-Bayes of first order: G. A. Ackerson, K. S. Fu,
IEEE Trans. Autom. Control 15, 10 (1970), without the spread of the means), with mean sum(p a m) and
sum(p a^2 rho) in place of rho.

The output are not posterior means, which the prior shrinks towards zero, but values with noise that
yield these means under the prior: measurements, as any image method expects.
"""

from collections.abc import Sequence

import numpy as np
from numpy.typing import NDArray

from ..base.arrays import Floats
from ..operators import MeasurementOperator
from .coefficients import Coefficients
from .dictionaries.dct import DICTIONARY
from .prior import fit_scale

Rows = NDArray[np.intp]
Values = NDArray[np.inexact]
SPEEDS = (0.0, 0.02, 0.05, 0.1, 0.2, 0.4, 0.8, 1.6, 3.2, 6.4)
"""Image shifts from frame to frame, in pixels rms along either axis."""
FASTER = 0.6
"""Prior probability of each speed, relative to the next slower one."""
CUT = 0.05
"""Prior probability of a cut."""
CHANGE = 0.2
"""Probability that the speed is drawn anew from its prior."""
DC_VARIANCE = 100.0
"""Variance of the DC coefficient, relative to the largest variance of the others."""
MIN_NOISE = 1e-4
"""Minimum rms noise of a coefficient, relative to its spread, as no scene is perfectly still."""
NONE, OTHER = 0.5, 0.02
"""Prior probability that changes by poses and depths are wrong, and that this is drawn anew."""
CHANGE_ERROR = 0.5
"""Standard deviation of such a change, relative to it; keeps a wrong depth map from lasting."""
FORGOTTEN = 1e-6
"""Fraction of a coefficient's variance below which earlier frames are ignored."""


class Memory:
    """Coefficients of an operator (K, N); ``weights``: probabilities of the speeds and a cut."""

    def __init__(self, operator: MeasurementOperator, speeds: Sequence[float] = SPEEDS) -> None:
        self.operator = operator
        self._expected, self._left = _expected_and_left(operator, speeds)
        near = FASTER ** np.arange(len(speeds))
        self._predicted = np.append((1 - CUT) * near / near.sum(), CUT)
        self.weights, self._joint = self._predicted, self._predicted[None]
        self._values: Values = np.zeros(operator.shape[0])
        self._precision = np.zeros(operator.shape[0])
        self._age = np.zeros(operator.shape[0])
        self._scale = 0.0

    def take(
        self, rows: Rows, coefficients: Coefficients, changes: Values | None = None
    ) -> Coefficients:
        """All coefficients (K,) after a frame that measures the ``rows`` (n,).

        Besides none, ``changes`` (M, K) of them since the last frame are possible.
        """
        length = self.operator.row_length
        seen = coefficients.measured
        rows, values = rows[seen], coefficients.values[seen] / length
        prior, noise = self._scaled(rows, values, (coefficients.noise[seen] / length) ** 2)
        if prior is not None:
            self._predict(prior, rows, values, noise, changes)
            self._update(rows, values, noise)
        with np.errstate(divide="ignore"):
            return Coefficients(self._values * length, length / np.sqrt(self._precision))

    def _scaled(self, rows: Rows, values: Values, noise: Floats) -> tuple[Floats | None, Floats]:
        """Prior variance (K,) at this image's scale, None if it is flat; positive noise (n,)."""
        varying = self.operator.varying[rows]
        expected = self._expected[rows[varying]]
        measured = values[varying]
        if not measured.any():
            return None, noise
        noise = np.maximum(noise, MIN_NOISE**2 * np.mean(np.abs(measured) ** 2))
        self._scale = max(fit_scale(measured, expected, noise[varying]), self._scale / 2)
        return self._expected * self._scale, noise

    def _predict(
        self, prior: Floats, rows: Rows, values: Values, noise: Floats, changes: Values | None
    ) -> None:
        """Weight the speeds by the new readings, and let the estimate change accordingly."""
        snr = self._precision * prior
        rho = snr / (1 + snr)
        if changes is None:  # then they are as right as they were
            changes = np.zeros((len(self._joint) - 1, len(rho)))
        elif len(changes) != len(self._joint) - 1:
            self._joint = _prior_of(len(changes)) * self.weights
        changes = np.where(rho > 0, changes / self.operator.row_length, 0)
        size = np.maximum(rho * prior, np.finfo(float).tiny)
        kept = 1 / (1 + (CHANGE_ERROR * np.abs(changes)) ** 2 / size)
        means = rho * self._values
        means, rhos = np.array([means, *(kept * (means + changes))]), np.array([rho, *(kept * rho)])
        fading = self._left ** (2 * self._age + 1)
        left = fading[:, rows]
        variance = (1 - left**2 * rhos[:, None, rows]) * prior[rows] + noise
        error = np.abs(values - left * means[:, None, rows]) ** 2
        evidence = -(error / variance + np.log(variance)).sum(axis=-1) / 2
        expected = (1 - OTHER) * self._joint + OTHER * _prior_of(len(changes)) * self.weights
        drawn = expected.sum(axis=1, keepdims=True) * self._predicted
        weights = ((1 - CHANGE) * expected + CHANGE * drawn) * np.exp(evidence - evidence.max())
        self._joint = weights / weights.sum()
        self.weights = self._joint.sum(axis=0)
        mean = ((self._joint @ fading) * means).sum(axis=0)
        rho = ((self._joint @ fading**2) * rhos).sum(axis=0)
        self._age += 1
        rho[rho < FORGOTTEN] = 0
        self._values = np.divide(mean, rho, out=np.zeros_like(mean), where=rho > 0)
        self._precision = rho / (prior * (1 - rho))

    def _update(self, rows: Rows, values: Values, noise: Floats) -> None:
        """Precision-weighted mean of estimate and readings."""
        before = self._precision[rows]
        self._precision[rows] = before + 1 / noise
        self._age[rows] *= before / self._precision[rows]
        valid = before * self._values[rows] + values / noise
        self._values = self._values.astype(valid.dtype)
        self._values[rows] = valid / self._precision[rows]


def _prior_of(changes: int) -> Floats:
    """Probabilities (1 + changes, 1) that none is right, and that each is."""
    each = np.full((changes, 1), (1 - NONE) / max(changes, 1))
    return np.concatenate([[[1 - each.sum()]], each])


def _expected_and_left(
    operator: MeasurementOperator, speeds: Sequence[float]
) -> tuple[Floats, Floats]:
    """Prior variance (K,) up to a factor, and the fraction retained for each speed and a cut."""
    height, width = operator.image_shape
    sigma = DICTIONARY.sigma(operator.image_shape)
    atoms = operator.in_atoms(DICTIONARY.atoms(height), DICTIONARY.atoms(width))
    varying = operator.varying
    expected = np.empty(operator.shape[0])
    expected[varying] = atoms.by_row(sigma**2)
    left = np.zeros((len(speeds) + 1, operator.shape[0]))
    # 2 pi f, as sigma is 1 / 2f; the constant, with sigma 0, does not decay.
    turn = np.divide(np.pi, sigma, out=np.zeros_like(sigma), where=sigma > 0)
    for retained, speed in zip(left, speeds, strict=False):
        decayed = sigma**2 * np.exp(-((turn * speed) ** 2) / 2)
        retained[varying] = atoms.by_row(decayed) / expected[varying]
    if operator.dc_row is not None:
        # DC changes by as much as the coefficient that varies most; a cut replaces it.
        maximum = np.argmax(np.where(varying, expected, 0.0))
        expected[operator.dc_row] = DC_VARIANCE * expected[maximum]
        changed = (1 - left[:-1, maximum] ** 2) / DC_VARIANCE
        left[:-1, operator.dc_row] = np.sqrt(1 - changed)
    return expected, left
