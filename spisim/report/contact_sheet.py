"""A page on which a data set is seen at a glance: images, depth maps, what was drawn, errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction import Capture, InputError, Result, evaluate, reconstruct
from reconstruction.capture import FrameTruth
from reconstruction.files import require_file, write_atomically
from spisim.dataset.reader import DataSet, StoredSample
from spisim.report.markup import length, number, page
from spisim.report.pictures import Scale, colour_bar, depth_scale, figure, intensity_scale
from spisim.report.sections import media_of


@dataclass(frozen=True)
class _Shown:
    """A sample, and its reconstruction or why there is none."""

    sample: StoredSample
    result: Result | None = None
    truth: FrameTruth | None = None
    weather: str = ""
    problem: str = ""


def write_contact_sheet(
    path: str | Path,
    samples: DataSet,
    limit: int = 100,
    progress: Callable[[float], None] | None = None,
) -> int:
    """Write a self-contained HTML page of at most `limit` samples, and return how many they are.

    They are chosen evenly from the first to the last, and reconstructed. `progress` is called with
    the fraction that is done. Raises InputError for a set without samples or a page that cannot be
    written; a capture that cannot be used is told on the page.
    """
    if not samples:
        raise InputError(f"{samples.folder}: there is no finished sample to show")
    require_file(path)
    shown = []
    places = evenly(len(samples), limit)
    for number_done, place in enumerate(places, start=1):
        shown.append(_show(samples[place]))
        if progress:
            progress(number_done / len(places))
    maps = [depth for each in shown for depth in _depths(each) if depth is not None]
    scale = depth_scale(*maps) if maps else Scale(0, 1, "viridis_r", "m")
    common = _common(samples)
    cards = "".join(_card(each, scale, common) for each in shown)
    title = samples.meta.get("name", "Data set")
    body = (
        f"<header><h1>{escape(title)}</h1><p>{_summary(samples, len(shown))}</p></header>"
        f"{_parameters(common)}"
        f'<div class="bar">{colour_bar(scale, "depth")}</div>'
        f'<div class="sheet">{cards}</div>'
        f"<footer>{escape(samples.meta.get('software', ''))}</footer>"
    )
    style = files(__package__).joinpath("contact_sheet.css").read_text(encoding="utf-8")
    write_atomically(path, page(title, body, style).encode())
    return len(shown)


def evenly(count: int, limit: int) -> list[int]:
    """At most `limit` of `count` places, evenly from the first to the last."""
    return sorted({round(place) for place in np.linspace(0, count - 1, min(count, limit))})


def _show(sample: StoredSample) -> _Shown:
    try:
        capture = sample.capture
        truth = None if capture.truth is None else capture.truth.at(0)
        return _Shown(sample, reconstruct(capture), truth, _weather(capture))
    except InputError as error:
        return _Shown(sample, problem=str(error))


def _weather(capture: Capture) -> str:
    told = []
    for medium in media_of(capture):
        visibility = medium.get("visibility_m")
        seen = "" if visibility is None else f", {visibility:.4g} m"
        told.append(f"{medium.get('kind') or medium.get('where')}{seen}")
    return "; ".join(told) or "clear air"


def _common(samples: DataSet) -> dict[str, Any]:
    """Parameters that are the same in every sample."""
    first = samples.records[0].parameters
    return {
        name: value
        for name, value in first.items()
        if all(record.parameters.get(name) == value for record in samples.records)
    }


def _depths(shown: _Shown) -> Sequence[Any]:
    estimated = None if shown.result is None else shown.result.depth_m
    return estimated, None if shown.truth is None else shown.truth.depth_m


def _summary(samples: DataSet, count: int) -> str:
    scenes = len({record.scene for record in samples.records})
    chosen = "all of them" if count == len(samples) else f"{count} of them"
    failed = f", {len(samples.failed)} failed" if samples.failed else ""
    return (
        f"{len(samples):,} samples of {scenes:,} scenes{failed}; {chosen} here: the image that is "
        "reconstructed, the depth map that four spots and it give, and the true one."
    )


def _card(shown: _Shown, depth: Scale, common: Mapping[str, Any]) -> str:
    sample = shown.sample
    head = f"<h3>{escape(sample.scene_name)}<small>{sample.index}</small></h3>"
    own = {name: value for name, value in sample.parameters.items() if name not in common}
    pictures = _pictures(shown, depth) if shown.result else ""
    return f'<section class="sample">{head}{pictures}{_told(shown)}{_parameters(own)}</section>'


def _parameters(values: Mapping[str, Any]) -> str:
    rows = "".join(
        f"<dt>{escape(name.removeprefix('scene.').removeprefix('parameters.'))}</dt>"
        f"<dd>{escape(_plain(value))}</dd>"
        for name, value in values.items()
    )
    return f"<dl>{rows}</dl>" if rows else ""


def _pictures(shown: _Shown, depth: Scale) -> str:
    assert shown.result is not None
    image = shown.result.image
    pictures = [figure(image, intensity_scale(image, unit=""), "image")]
    titles = ("estimated depth", "true depth")
    for title, values in zip(titles, _depths(shown), strict=True):
        pictures.append(
            figure(
                np.full(image.shape, np.nan) if values is None else values,
                depth,
                title if values is not None else f"no {title}",
            )
        )
    return f'<div class="row">{"".join(pictures)}</div>'


def _told(shown: _Shown) -> str:
    """Error and weather in a line; what went wrong where there is no reconstruction."""
    if shown.result is None:
        return f'<p class="told">{escape(shown.problem)}</p>'
    told = [escape(shown.weather)]
    if shown.truth is not None:
        metrics = evaluate(shown.result, shown.sample.capture)
        correlation = next(iter(metrics["images"].values()))["correlation"]
        told.insert(0, f"correlation {number(correlation, 2)}")
        if metrics["depths"]:
            error = next(iter(metrics["depths"].values()))["mae_m"]
            told.insert(0, f"<b>{length(error)}</b> mean depth error")
    return f'<p class="told">{" · ".join(told)}</p>'


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(map(_plain, value))
    return str(value)
