"""1/f noise of the bucket detector's amplifier: its spectrum, and what it adds to coefficients.

A coefficient is the difference of a pattern and its complement, or of a pattern and the mean of all
that have none, since what these share is estimated and removed. Noise that is slower hardly enters.
"""

import numpy as np
from scipy.constants import elementary_charge
from scipy.linalg import matmul_toeplitz
from scipy.sparse import csr_array

from reconstruction.base.arrays import Floats
from reconstruction.operators import PatternPlan
from spisim.instrument.electronics import Amplifier
from spisim.instrument.model import Instrument

#: Steps per exposure period of simulated 1/f noise, and recordings that its longest period spans.
STEPS, SPAN = 8, 4
PA = 1e-12


def flicker_spectrum(amplifier: Amplifier, periods: int, period_s: float) -> tuple[Floats, Floats]:
    """Frequencies in Hz, and variance in A² at each, of the 1/f noise of a recording.

    The one-sided density is i_n² f_c / f, high-passed if AC-coupled; what is slower than four times
    the recording is left out.
    """
    frequency = np.fft.rfftfreq(SPAN * STEPS * periods, period_s / STEPS)[1:]
    density = (amplifier.noise_pa_per_sqrt_hz * PA) ** 2 * amplifier.corner_hz / frequency
    if amplifier.low_cut_hz is not None:
        density /= 1 + (amplifier.low_cut_hz / frequency) ** 2
    return np.asarray(frequency, np.float64), density * frequency[0]


def flicker_electrons(instrument: Instrument) -> float:
    """Rms of white noise of an exposure that would add as much to coefficients, on average.

    With covariances C(l) of exposures l periods apart, its square is Σ_k w_k C w_k / Σ_k w_k w_k
    for the weights w_k of each coefficient: C(0) - C(1) for adjacent pairs, and the variance about
    the mean for patterns without complements.
    """
    detector, time_s = instrument.imaging.detector, instrument.imaging.exposure_time_s
    amplifier, plan = detector.amplifier, instrument.pattern_plan
    if amplifier is None or amplifier.corner_hz == 0:
        return 0.0
    frequency, variance = flicker_spectrum(amplifier, plan.exposures, instrument.pattern_period_s)
    passed = np.append(0, variance * np.sinc(frequency * time_s) ** 2)
    covariance = len(frequency) * np.fft.irfft(passed)[::STEPS][: plan.exposures]
    weights = _weights(plan)
    products = (weights.T @ weights).tocoo()
    lags = np.abs(np.subtract(*products.coords))
    added = products.data @ covariance[lags]
    alone = weights[np.abs(weights.sum(axis=1)) > 0.5]
    if alone.shape[0]:
        shared = alone.sum(axis=0)
        added -= shared @ matmul_toeplitz(covariance, shared) / alone.shape[0]
    charge = time_s / (elementary_charge * detector.sensor.gain)
    return charge * float(np.sqrt(max(added, 0.0) / np.sum(weights.data**2)))


def _weights(plan: PatternPlan) -> csr_array:
    """Weights (K, M) of the exposures of each pattern, whose complement counts as negative."""
    sign = np.where(plan.polarity < 0, -1, 1)
    row = np.unique(plan.index, return_inverse=True)[1]
    _, same, times = np.unique(row * sign + sign, return_inverse=True, return_counts=True)
    return csr_array((sign / times[same], (row, np.arange(plan.exposures))))
