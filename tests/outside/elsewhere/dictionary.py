"""A dictionary: Haar wavelets."""

import numpy as np


class Haar:
    def atoms(self, side):
        rows = np.ones((1, 1))
        while len(rows) < side:
            details = np.kron(np.eye(len(rows)), [1, -1])
            rows = np.concatenate([np.kron(rows, [1, 1]), details]) / np.sqrt(2)
        return rows.T

    def deviation(self, shape):
        vertical, horizontal = (2.0 ** np.floor(np.log2(np.arange(n) + 0.5)) / n for n in shape)
        scale = np.maximum.outer(vertical, horizontal)
        scale[0, 0] = np.inf
        return 1 / scale

    def synthesise(self, spectrum):
        height, width = spectrum.shape
        return self.atoms(height) @ spectrum @ self.atoms(width).T


DICTIONARY = Haar()
