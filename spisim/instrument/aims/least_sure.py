"""The directions where the last depth map is least sure, mirror by mirror.

Uncertainty sampling: D. D. Lewis and W. A. Gale, "A sequential algorithm for training text
classifiers", SIGIR 3 (1994). It is greedy, and each map forgets the spots of earlier frames.
"""

from collections.abc import Callable

import numpy as np

from reconstruction.base.arrays import Floats

#: Candidates along each axis of the mirrors' range.
CANDIDATES = 33


def least_sure(
    doubt: Callable[[Floats], Floats],
    home_deg: Floats,
    half_range_deg: tuple[float, float],
    apart_deg: float,
) -> Floats:
    """Offsets of the largest mean doubt of a mirror's spots, apart from those chosen before."""
    steps = np.linspace(-1, 1, CANDIDATES)
    offsets = np.stack(np.meshgrid(*(steps * half for half in half_range_deg)), -1).reshape(-1, 2)
    chosen = np.empty((len(home_deg), 2))
    taken = np.empty((0, 2))
    for mirror, spots in enumerate(home_deg):
        reached = spots + offsets[:, None]  # (candidates, spots, 2)
        value = doubt(reached).mean(axis=1)
        away = np.linalg.norm(reached[:, :, None] - taken, axis=-1).reshape(len(offsets), -1)
        value[away.min(axis=1, initial=np.inf) < apart_deg] = -1.0
        chosen[mirror] = offsets[np.argmax(value)]
        taken = np.concatenate([taken, spots + chosen[mirror]])
    return chosen


AIM = least_sure
