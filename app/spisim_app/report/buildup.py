"""How an image improves pattern by pattern."""

from collections.abc import Iterator
from dataclasses import dataclass

import numpy as np
from numpy.typing import NDArray

from reconstruction import Capture, Result
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.evaluation import method_title
from reconstruction.image import CarryingMethod, Imaging, image_method
from reconstruction.result import BASELINE

from .page import capital
from .pictures import Scale

STEPS = 12
MIN_PATTERNS = 4
"""Patterns of the first step, if that many were exposed."""


@dataclass(frozen=True, eq=False)
class Step:
    """Reconstructions from the first `patterns`: images (H, W) by method, and the last pattern.

    `last` (H, W) runs from 0 to 1. `likeness` is the correlation with the true image, nan if either
    is flat or the truth is unknown.
    """

    patterns: int
    time_s: float
    images: dict[str, Floats]
    last: NDArray[np.float32]
    likeness: float


@dataclass(frozen=True)
class BuildUp:
    """The steps: images side by side (`strips`, by title) and the numbers of each (`figures`)."""

    steps: int
    strips: dict[str, str]
    figures: list[dict[str, float | None]]


def build_up(
    capture: Capture, result: Result, truth: NDArray[np.floating] | None, scale: Scale
) -> BuildUp | None:
    """Reconstruct the default and the zero-filled image from more and more of the patterns.

    Returns None with too few patterns, or if an image needs all of them.
    """
    try:
        steps = list(_steps(capture, result, truth))
    except InputError:
        return None
    if len(steps) < 2:
        return None
    patterns = Scale(0.0, 1.0, "gray", "")
    strips = {
        capital(method_title("images", name)): scale.address(
            np.hstack([step.images[name] for step in steps])
        )
        for name in steps[0].images
    }
    last = patterns.address(np.hstack([step.last for step in steps]))
    figures = [
        {
            "patterns": step.patterns,
            "share": step.patterns / capture.plan.pixels,
            "time_s": step.time_s if np.isfinite(step.time_s) else None,
            "likeness": round(step.likeness, 4) if np.isfinite(step.likeness) else None,
        }
        for step in steps
    ]
    return BuildUp(len(steps), {**strips, "The last pattern": last}, figures)


def _steps(capture: Capture, result: Result, truth: NDArray[np.floating] | None) -> Iterator[Step]:
    """Reconstruct from the first exposed patterns only."""
    name = next(iter(result.images))
    if isinstance(image_method(name), CarryingMethod):
        name = BASELINE
    plan = capture.setup.plan_of(result.frame)
    counts = np.unique(np.geomspace(min(MIN_PATTERNS, plan.sampled), plan.sampled, STEPS).round())
    for count in counts.astype(int):
        exposed = np.isin(plan.index, plan.distinct[:count])
        images = _images(capture, result, exposed, name)
        if not images:
            continue
        row = plan.patterns.row(int(plan.distinct[count - 1]))
        yield Step(
            int(count),
            np.count_nonzero(exposed) * capture.buckets.pattern_period_s,
            images,
            ((row - row.min()) / (np.ptp(row) or 1.0)).astype(np.float32),
            np.nan if truth is None else _likeness(images[name], truth),
        )


def _images(
    capture: Capture, result: Result, exposed: NDArray[np.bool_], name: str
) -> dict[str, Floats]:
    """Return images by a method and zero-filled from some exposures (M,); empty if all saturate."""
    names = dict.fromkeys((name, BASELINE))
    if exposed.all():
        return {each: np.asarray(result.images[each], np.float64) for each in names}
    frame, buckets = result.frame, capture.buckets
    plan = capture.setup.plan_of(frame).only(exposed)
    readings = Imaging(plan).of(buckets.usable[frame, exposed])
    if not readings.patterns:
        return {}
    coefficients = readings.decode(buckets.signal[frame, exposed], buckets.variance[frame, exposed])
    images = {
        each: np.asarray(readings.solver(each)(coefficients).image, np.float64) for each in names
    }
    if readings.has_dc:
        return images
    return {each: image - image.min() for each, image in images.items()}  # the darkest is dark


def _likeness(image: Floats, truth: NDArray[np.floating]) -> float:
    if np.ptp(image) == 0 or np.ptp(truth) == 0:
        return np.nan
    return float(np.corrcoef(image.ravel(), truth.ravel())[0, 1])
