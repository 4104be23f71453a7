"""Patterns dealt out over successive frames, so that several frames hold many more than one.

Every frame shows a common part, the first patterns of the order, and a share of the others: of C
frames the t-th has every C-th of them, beginning with the t-th, and so all frequencies. What is
common tells motion from frame to frame and keeps a single frame useful; the rest adds up as long as
the scene holds still.
"""

import numpy as np

from ..base.errors import InputError
from .plan import PatternPlan


def interleaved(whole: PatternPlan, frames: int, common: int) -> tuple[PatternPlan, ...]:
    """Plans of successive frames that together show what ``whole`` does.

    Each shows the first ``common`` rows of ``whole``, the level of all light among them, and its
    share of the others. Raises InputError where these cannot be shared out evenly.
    """
    level = whole.patterns.level
    rows = whole.distinct[np.argsort(whole.distinct != level, kind="stable")]
    if not 0 <= common <= rows.size or (rows.size - common) % frames:
        raise InputError(
            f"{rows.size} patterns, {common} of them common, cannot be dealt out evenly to "
            f"{frames} frames"
        )
    return tuple(
        whole.only(np.isin(whole.index, np.append(rows[:common], rows[common + t :: frames])))
        for t in range(frames)
    )
