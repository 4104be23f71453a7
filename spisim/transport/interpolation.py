"""Between the keys at which the light of a recording is solved."""

from __future__ import annotations

from typing import NamedTuple

import numpy as np
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats


class Interpolation(NamedTuple):
    """Light at times (frames, M): that of some keys each, (frames, M, keys), by their shares."""

    keys: NDArray[np.intp]
    fractions: Floats

    def until(self, frames: int) -> Interpolation:
        """That of the first frames."""
        return Interpolation(self.keys[:frames], self.fractions[:frames])

    def means(self, values: Floats) -> Floats:
        """Mean over each frame's times, (frames, ...), of what is `values` (K, ...) at the keys."""
        flat = values.reshape(len(values), -1)
        times = self.keys.shape[1]
        means = np.empty((len(self.keys), flat.shape[1]))
        for frame, (keys, fractions) in enumerate(zip(self.keys, self.fractions, strict=True)):
            result, positions = np.unique(keys, return_inverse=True)
            means[frame] = np.bincount(positions.ravel(), fractions.ravel()) / times @ flat[result]
        return means.reshape(-1, *values.shape[1:])
