"""A dictionary: Walsh functions."""

import numpy as np
from scipy.linalg import hadamard

from reconstruction.image import Band


class Walsh:
    def bands(self, shape):
        atoms = [hadamard(side) / np.sqrt(side) for side in shape]
        changes = [np.count_nonzero(np.diff(each, axis=0), axis=0) / len(each) for each in atoms]
        frequency = np.hypot.outer(*changes)
        frequency[0, 0] = np.inf
        return [Band(*atoms, 1 / frequency)]


DICTIONARY = Walsh()
