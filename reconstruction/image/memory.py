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
camera, each speed counts again, as what is left after this change of the mean. A change c of error
e c makes the mean k (m + c) and rho k rho, with k = rho S / (rho S + e^2 c^2). The weights follow a
Markov chain; the mixture is approximated by one Gaussian per coefficient (generalised pseudo-Bayes
of first order: G. A. Ackerson, K. S. Fu, IEEE Trans. Autom. Control 15, 10 (1970)), with mean
sum(p a m) and sum(p a^2 rho) in place of rho.

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
WRONG = 0.5
"""Error of a change by poses and depths, relative to it: a single wrong depth map must not stay."""
TINY = np.finfo(float).tiny
FORGOTTEN = 1e-6
"""Fraction of a coefficient's variance below which earlier frames are ignored."""


class Memory:
    """Coefficients of an operator (K, N), of all frames so far."""

    def __init__(self, operator: MeasurementOperator, speeds: Sequence[float] = SPEEDS) -> None:
        self.operator = operator
        self._expected, self._left = _expected_and_left(operator, speeds)
        near = FASTER ** np.arange(len(speeds))
        self._predicted = np.append((1 - CUT) * near / near.sum(), CUT)
        self._joint = self._predicted[None]
        self._values: NDArray[np.inexact] = np.zeros(operator.shape[0])
        self._precision = np.zeros(operator.shape[0])
        self._age = np.zeros(operator.shape[0])
        self._scale = 0.0

    @property
    def weights(self) -> Floats:
        """Probabilities of the speeds and a cut."""
        return np.asarray(self._joint.sum(axis=0))

    def take(
        self,
        rows: NDArray[np.intp],
        coefficients: Coefficients,
        changes: NDArray[np.inexact] | None = None,
    ) -> Coefficients:
        """All coefficients (K,) after a frame that measures the ``rows`` (n,).

        ``changes`` (M, K) of all coefficients since the last frame are possible, besides none.
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

    def _scaled(
        self, rows: NDArray[np.intp], values: NDArray[np.inexact], noise: Floats
    ) -> tuple[Floats | None, Floats]:
        """Prior variance (K,) at this image's scale, None if it is flat; positive noise (n,)."""
        varying = rows != self._dc_row
        expected = self._expected[rows[varying]]
        measured = values[varying]
        if not measured.any():
            return None, noise
        noise = np.maximum(noise, MIN_NOISE**2 * np.mean(np.abs(measured) ** 2))
        self._scale = max(fit_scale(measured, expected, noise[varying]), self._scale / 2)
        return self._expected * self._scale, noise

    @property
    def _dc_row(self) -> int:
        return -1 if self.operator.dc_row is None else self.operator.dc_row

    def _predict(
        self,
        prior: Floats,
        rows: NDArray[np.intp],
        values: NDArray[np.inexact],
        noise: Floats,
        changes: NDArray[np.inexact] | None = None,
    ) -> None:
        """Weight the speeds by the new readings, and let the estimate change accordingly."""
        snr = self._precision * prior
        rho = snr / (1 + snr)
        means, rhos = (rho * self._values)[None], rho[None]
        if changes is not None:
            changes = np.where(rho > 0, changes / self.operator.row_length, 0)
            kept = 1 / (1 + (WRONG * np.abs(changes)) ** 2 / np.maximum(rho * prior, TINY))
            means = np.concatenate([means, kept * (means + changes)])
            rhos = np.concatenate([rhos, kept * rho])
        fading = self._left ** (2 * self._age + 1)
        left = fading[:, rows]
        variance = (1 - left**2 * rhos[:, None, rows]) * prior[rows] + noise
        error = np.abs(values - left * means[:, None, rows]) ** 2
        evidence = -(error / variance + np.log(variance)).sum(axis=-1) / 2
        shared = self._joint if len(self._joint) == len(means) else self.weights / len(means)
        expected = (1 - CHANGE) * shared + CHANGE / len(means) * self._predicted
        weights = expected * np.exp(evidence - evidence.max())
        self._joint = weights / weights.sum()
        mean = ((self._joint @ fading) * means).sum(axis=0)
        rho = ((self._joint @ fading**2) * rhos).sum(axis=0)
        self._age += 1
        rho[rho < FORGOTTEN] = 0
        self._values = np.divide(mean, rho, out=np.zeros_like(mean), where=rho > 0)
        self._precision = rho / (prior * (1 - rho))

    def _update(self, rows: NDArray[np.intp], values: NDArray[np.inexact], noise: Floats) -> None:
        """Precision-weighted mean of estimate and readings."""
        before = self._precision[rows]
        self._precision[rows] = before + 1 / noise
        self._age[rows] *= before / self._precision[rows]
        valid = before * self._values[rows] + values / noise
        self._values = self._values.astype(valid.dtype)
        self._values[rows] = valid / self._precision[rows]


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
