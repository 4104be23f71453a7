"""A pattern basis: grey cosines."""

import numpy as np

from reconstruction.operators import Basis


class Cosines(Basis):
    name = "cosines"
    dc_row = 0

    def row(self, k):
        height, width = self.shape
        waves = [
            np.cos(np.pi * number * (np.arange(side) + 0.5) / side)
            for number, side in zip(divmod(k, width), (height, width), strict=True)
        ]
        return np.outer(*waves)


BASIS = Cosines
