"""A page on which a data set is seen at a glance: images, depth maps, what was drawn, errors."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from html import escape
from importlib.resources import files
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction import InputError, Result, evaluate, reconstruct
from reconstruction.capture import Truth
from reconstruction.files import require_file, write_atomically
from spisim.dataset.reader import DataSet, StoredSample
from spisim.report.markup import length, number, page
from spisim.report.pictures import Scale, colour_bar, depth_scale, figure, intensity_scale


@dataclass(frozen=True)
class _Shown:
    """A sample, its reconstruction, or why there is none."""

    sample: StoredSample
    result: Result | None
    truth: Truth | None
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
    cards = "".join(_card(each, scale) for each in shown)
    title = samples.meta.get("name", "Data set")
    body = (
        f"<header><h1>{escape(title)}</h1><p>{_summary(samples, len(shown))}</p></header>"
        f'<div class="bar">{colour_bar(scale, "depth")}</div>'
        f'<div class="sheet">{cards}</div>'
        f"<footer>{escape(samples.meta.get('software', ''))}</footer>"
    )
    style = files(__package__).joinpath("sheet.css").read_text(encoding="utf-8")
    write_atomically(path, page(title, body, style).encode())
    return len(shown)


def evenly(count: int, limit: int) -> list[int]:
    """At most `limit` of `count` places, evenly from the first to the last."""
    return sorted({round(place) for place in np.linspace(0, count - 1, min(count, limit))})


def _show(sample: StoredSample) -> _Shown:
    try:
        capture = sample.capture
        return _Shown(sample, reconstruct(capture), capture.truth)
    except InputError as error:
        return _Shown(sample, None, None, str(error))


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


def _card(shown: _Shown, depth: Scale) -> str:
    sample = shown.sample
    head = f"<h3>{escape(sample.scene_name)}<small>{sample.index}</small></h3>"
    rows = "".join(
        f"<dt>{escape(_short(name))}</dt><dd>{escape(_plain(value))}</dd>"
        for name, value in sample.parameters.items()
    )
    shows = _pictures(shown, depth) if shown.result else ""
    return f'<section class="sample">{head}{shows}{_error(shown)}<dl>{rows}</dl></section>'


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


def _error(shown: _Shown) -> str:
    if shown.result is None:
        return f'<p class="error">{escape(shown.problem)}</p>'
    if shown.truth is None:
        return ""
    metrics = evaluate(shown.result, shown.truth)
    told = [f"image correlation {number(metrics['image']['correlation'], 2)}"]
    if metrics["depth"] and "anchored" in metrics["depth"]:
        anchored: Mapping[str, float | None] = metrics["depth"]["anchored"]
        told.insert(0, f"<b>{length(anchored['mae_m'])}</b> mean depth error")
    return f'<p class="error">{", ".join(told)}</p>'


def _short(name: str) -> str:
    """A parameter's name without the file that it stands in."""
    return name.removeprefix("scene.").removeprefix("parameters.").replace("_", " ")


def _plain(value: Any) -> str:
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list):
        return ", ".join(map(_plain, value))
    return str(value)
