"""Four spots with detectors beside the lasers, and what chance allows."""

import numpy as np
from scipy import stats

DIRECTIONS = np.array([[-0.2, -0.1, 1], [0.2, -0.1, 1], [-0.2, 0.1, 1], [0.2, 0.1, 1]])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
DETECTORS = np.array([[0.1, 0, 0], [-0.1, 0, 0.02], [0, 0.1, 0], [0, 0, 0]])
RANGES = np.array([1.5, 3.0, 5.0, 8.0])
PATHS = RANGES + np.linalg.norm(RANGES[:, None] * DIRECTIONS - DETECTORS, axis=1)
GEOMETRY = {"directions": DIRECTIONS, "detector_positions_m": DETECTORS}
CHARGE = {
    "electrons_per_count": 2.0,
    "offset_counts": 50.0,
    "noise_electrons": 0.0,
    "excess_noise_factor": 1.0,
}
#: Of a projector of 20° in height and width.
TAN_HALF_FIELD = np.tan(np.radians(10))


def spots_at(positions):
    """Unit vectors (4, 3) towards positions in the field, in half widths and half heights."""
    towards = np.concatenate([np.array(positions) * TAN_HALF_FIELD, np.ones((4, 1))], axis=1)
    return towards / np.linalg.norm(towards, axis=1, keepdims=True)


def counts(electrons):
    """What CHARGE makes of electrons."""
    return electrons / 2 + 50


def charge(rng, mean, excess, noise):
    """Electrons with variance excess * mean + noise^2."""
    return excess * rng.poisson(mean / excess) + rng.normal(0, noise, mean.shape)


def assert_scatter(values, mean, sigma, bound=0.0):
    """Values (trials, ...) scatter about ``mean`` by ``sigma``, but for a share ``bound`` of it.

    Neither may be off by more than happens once in 2000 times, over all that is tested together.
    """
    values = values.reshape(len(values), -1)
    trials, tested = values.shape
    z = stats.norm.isf(0.0005 / 2 / tested)
    bias = (values.mean(axis=0) - np.ravel(mean)) / (values.std(axis=0) / np.sqrt(trials))
    assert np.abs(bias).max() < z, bias
    ratio = values.std(axis=0, ddof=1) / np.ravel(sigma)
    assert np.abs(ratio - 1).max() < bound + z / np.sqrt(2 * trials), ratio
