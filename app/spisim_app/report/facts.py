"""Facts about a capture and figures of merit of its reconstruction, as text."""

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
    """Return the participating media of a simulation; empty for other recordings."""
    try:
        settings = load_yaml(capture.provenance.settings, "settings")
    except InputError:  # written by another program
        return []
    media = settings.get("media") if isinstance(settings, dict) else None
    return [one for one in media if isinstance(one, dict)] if isinstance(media, list) else []


def in_all(warnings: Iterable[Sequence[str]]) -> list[str]:
    """Return the warnings common to all captures."""
    first, *others = [*warnings] or [()]
    return [each for each in first if all(each in other for other in others)]


def cards_of(capture: Capture, result: Result, metrics: Metrics | None) -> Cards:
    """Return the headline figures of the reconstruction."""
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
        cards.append((reconstructed, "to reconstruct", "frame rate unknown"))
    return cards if metrics is None else cards + _quality_cards(metrics)


def _quality_cards(metrics: Metrics) -> Cards:
    """Return each station's figure by its first method, with those of the others."""
    cards = []
    for station, key, label, written in (
        ("images", "correlation", "image correlation", lambda value: number(value, 3)),
        ("depths", "mae_m", "mean depth error", length),
    ):
        values = {name: written(figures[key]) for name, figures in metrics[station].items()}
        others = [f"{method_title(station, name)} {value}" for name, value in values.items()][1:]
        cards += [(value, label, ", ".join(others)) for value in list(values.values())[:1]]
    for spots in list(metrics["spots"].values())[:1]:
        errors = [abs(spot["error_m"]) for spot in spots if spot["error_m"] is not None]
        largest = length(max(errors, default=None))
        cards.insert(1, (largest, "largest range error", f"of {len(errors)} measured spots"))
    return cards


def quality_of(metrics: Metrics | None, method: str) -> str:
    """Return the image quality of a method; empty if unknown."""
    if metrics is None:
        return ""
    figures = metrics["images"][method]
    gain = figures["gain_db"]
    return (
        f"correlation {number(figures['correlation'], 3)}, "
        f"gain {'–' if gain is None else f'{gain:+.1f} dB'}"
    )


def facts_of(capture: Capture) -> dict[str, str]:
    """Return how the capture was recorded."""
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
                f"{noise:,.0f} electrons rms per exposure" if np.isfinite(noise) else "unknown"
            ),
            "saturated readings": str(int(np.count_nonzero(~buckets.usable))),
        }
    if capture.spots is not None:
        facts["time of flight"] = capture.spots.summary
    if capture.pattern_taps is not None:
        facts["of every pattern"] = capture.pattern_taps.summary
    return facts


def _of_several_frames(setup: Setup) -> dict[str, str]:
    """Return the combined number of patterns of frames with different patterns."""
    if not setup.following_plans:
        return {}
    exposed = np.unique(np.concatenate([plan.index for plan in setup.plans])).size
    return {"of several frames": f"{exposed} patterns, distributed over {len(setup.plans)} frames"}
