"""Facts of a capture and figures of its reconstruction, in words."""

from collections.abc import Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from reconstruction import Capture, Result
from reconstruction.base.errors import InputError
from reconstruction.capture import Setup
from reconstruction.evaluation import method_title
from spisim.base.config import load_yaml

from .page import duration, length, number
from .units import engineering

Metrics = Mapping[str, Any]
Cards = list[tuple[str, str, str]]


def media_of(capture: Capture) -> list[Mapping[str, Any]]:
    """What hung in the air of a simulation: `media` of its settings; none of other recordings."""
    try:
        settings = load_yaml(capture.provenance.settings, "settings")
    except InputError:  # of another program
        return []
    media = settings.get("media") if isinstance(settings, dict) else None
    return [one for one in media if isinstance(one, dict)] if isinstance(media, list) else []


def in_all(warnings: Iterable[Sequence[str]]) -> list[str]:
    """Warnings that every one of several captures has."""
    first, *others = [*warnings] or [()]
    return [each for each in first if all(each in other for other in others)]


def cards_of(capture: Capture, result: Result, metrics: Metrics | None) -> Cards:
    """The figures that tell how good the reconstruction is."""
    plan = capture.plan
    patterns = f"{plan.sampled} of {plan.pixels} patterns, {plan.exposures} exposures"
    cards = []
    if plan.shows_image:
        cards.append((f"{100 * plan.sampling_ratio:.3g} %", "sampling ratio", patterns))
    frame_s = plan.exposures * capture.buckets.pattern_period_s
    reconstructed = duration(float(f"{sum(result.timings_s.values()):.3g}"))
    if np.isfinite(frame_s):
        cards.append(
            (engineering(1 / frame_s, "Hz"), "frame rate", f"reconstructed in {reconstructed}")
        )
    else:
        cards.append((reconstructed, "to reconstruct", "frame rate not known"))
    return cards if metrics is None else cards + _quality_cards(metrics)


def _quality_cards(metrics: Metrics) -> Cards:
    """Of each station the first method's figure, and those of the others."""
    cards = []
    for station, key, label, written in (
        ("images", "correlation", "image correlation", lambda value: number(value, 3)),
        ("depths", "mae_m", "mean depth error", length),
    ):
        reported = {name: written(figures[key]) for name, figures in metrics[station].items()}
        others = [f"{method_title(station, name)} {value}" for name, value in reported.items()][1:]
        cards += [(value, label, ", ".join(others)) for value in list(reported.values())[:1]]
    for spots in list(metrics["spots"].values())[:1]:
        errors = [abs(spot["error_m"]) for spot in spots if spot["error_m"] is not None]
        largest = length(max(errors, default=None))
        cards.insert(1, (largest, "largest range error", f"of {len(errors)} measured spots"))
    return cards


def quality_of(metrics: Metrics | None, method: str) -> str:
    """How good the image of a method is; nothing where that is not known."""
    if metrics is None:
        return ""
    figures = metrics["images"][method]
    gain = figures["gain_db"]
    return (
        f"correlation {number(figures['correlation'], 3)}, "
        f"gain {'–' if gain is None else f'{gain:+.1f} dB'}"
    )


def facts_of(capture: Capture) -> dict[str, str]:
    """How the capture was recorded."""
    provenance, plan, buckets = capture.provenance, capture.plan, capture.buckets
    height, width = plan.shape
    noise = buckets.noise_electrons
    facts = {
        "source": provenance.source,
        "software": provenance.software,
        "seed": "–" if provenance.seed is None else str(provenance.seed),
        "frames": str(capture.frames),
    }
    if plan.shows_image:
        facts |= {
            "virtual pixels": f"{width} × {height}",
            "patterns": f"{plan.sampled} of {plan.pixels}, {plan.basis}, {plan.order}",
            "exposures": str(plan.exposures),
            **_of_several_frames(capture.setup),
            "exposure time": duration(buckets.exposure_time_s),
            "duration": duration(plan.exposures * buckets.pattern_period_s),
            "electronics noise": (
                f"{noise:,.0f} electrons rms per exposure" if np.isfinite(noise) else "not known"
            ),
            "saturated readings": str(int(np.count_nonzero(~buckets.usable))),
        }
    if capture.spots is not None:
        facts["time of flight"] = capture.spots.summary
    if capture.pattern_taps is not None:
        facts["of every pattern"] = capture.pattern_taps.summary
    return facts


def _of_several_frames(setup: Setup) -> dict[str, str]:
    """What frames that show different patterns show together."""
    if not setup.following_plans:
        return {}
    displayed = np.unique(np.concatenate([plan.index for plan in setup.plans])).size
    return {"of several frames": f"{displayed} patterns, which {len(setup.plans)} frames deal out"}
