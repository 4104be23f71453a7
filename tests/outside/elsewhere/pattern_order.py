"""A pattern order: the level first, then the others as they come out of a hat."""

import numpy as np


def shuffled(basis):
    return np.concatenate([[0], 1 + np.random.default_rng(0).permutation(basis.rows - 1)])


ORDER = shuffled
