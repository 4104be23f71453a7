"""An overview page of a data set: images, depth maps, parameters and errors."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction import InputError, Result, evaluate, reconstruct
from reconstruction.capture import FrameTruth
from reconstruction.diagnostics import result_warnings
from spisim.dataset.cost import cost_of, slowest
from spisim.dataset.parameters import common_parameters
from spisim.dataset.reader import DataSet
from spisim.dataset.stored_sample import StoredSample

from .facts import in_all, media_of
from .page import write_page
from .pictures import Scale, depth_scale, intensity_scale


@dataclass(frozen=True)
class _DisplayedSample:
    """A sample and its reconstruction, or the reason why there is none."""

    sample: StoredSample
    result: Result | None = None
    truth: FrameTruth | None = None
    metrics: Mapping[str, Any] | None = None
    media: Sequence[Mapping[str, Any]] = ()
    warnings: Sequence[str] = ()
    problem: str = ""

    @property
    def depths(self) -> list[tuple[str, Any]]:
        """Titles and maps of estimated and true depth; nan if missing."""
        if self.result is None:
            return []
        missing = np.full(self.result.image.shape, np.nan)
        depths = {
            "estimated depth": self.result.depth_m,
            "true depth": None if self.truth is None else self.truth.depth_m,
        }
        return [
            (f"no {title}", missing) if depth_m is None else (title, depth_m)
            for title, depth_m in depths.items()
        ]

    @property
    def depth_scale(self) -> Scale:
        """The sample's own scale, because the scale of a street would flatten a room."""
        return depth_scale(*(depth_m for _, depth_m in self.depths))


def write_contact_sheet(
    path: str | Path,
    samples: DataSet,
    limit: int = 100,
    progress: Callable[[float], None] = lambda fraction: None,
) -> int:
    """Write a self-contained HTML page of at most `limit` samples, and return their number.

    The samples are evenly chosen and reconstructed. `progress` is called with the completed
    fraction. Raises InputError for a set without samples, and OSError if the page cannot be
    written. The page names captures that cannot be used.
    """
    if not samples:
        raise InputError(f"{samples.folder}: no finished samples to show")
    displayed = []
    positions = evenly(len(samples), limit)
    for done, position in enumerate(positions, start=1):
        displayed.append(_show(samples[position]))
        progress(done / len(positions))
    write_page(
        path,
        "contact sheet",
        "contact_sheet",
        title=samples.meta.get("name", "Data set"),
        samples=len(samples),
        scenes=len({record.scene for record in samples.records}),
        failed=len(samples.failed),
        displayed=displayed,
        warnings=in_all(each.warnings for each in displayed if each.result),
        common=common_parameters(samples.records),
        cost=cost_of(samples.records),
        slowest=slowest(samples.records),
        intensity_scale=intensity_scale,
        software=samples.meta.get("software", ""),
    )
    return len(displayed)


def evenly(count: int, limit: int) -> list[int]:
    """Return at most `limit` of `count` positions, evenly from the first to the last."""
    return sorted({round(position) for position in np.linspace(0, count - 1, min(count, limit))})


def _show(sample: StoredSample) -> _DisplayedSample:
    try:
        capture = sample.capture
        result, media = reconstruct(capture), media_of(capture)
        warnings = result_warnings(result, capture)
        if capture.truth is None:
            return _DisplayedSample(sample, result, media=media, warnings=warnings)
        truth, metrics = capture.truth.at(result.frame), evaluate(result, capture)
    except InputError as error:
        return _DisplayedSample(sample, problem=str(error))
    return _DisplayedSample(sample, result, truth, metrics, media, warnings)
