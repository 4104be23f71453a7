"""Quality of a flight's frames against their truth: depth with memory beside that of each frame."""

import re
from collections.abc import Callable, Iterable, Mapping, Sequence
from typing import Any

import numpy as np

from ..base.errors import InputError
from ..capture import Capture
from ..chosen_methods import Methods, depth_methods
from ..depth import MIN_FREE
from ..diagnostics import NOT_TRACED
from ..reconstructor import Reconstructor
from ..result import Result
from .depths import Figures, number
from .metrics import evaluate

CONFIDENCE = 0.95
FIGURES = ("abs_rel", "coverage", "within_2_sigma", "obstacle_missed", "obstacle_false")
NUMBER = re.compile(r"-?\d+(\.\d+)?(e[-+]?\d+)?")

Metrics = dict[str, Any]


def is_flight(recording: Capture) -> bool:
    """Whether a recording has poses, and the truth of several of its frames."""
    truth = recording.truth
    return recording.poses is not None and truth is not None and len(truth.frame) > 1


def evaluate_flight(
    recording: Capture,
    *,
    image: Methods = None,
    ranging: Methods = None,
    depth: Methods = None,
    weather: str | float | None = None,
    min_free: float = MIN_FREE,
    judged: Callable[[Result, Metrics], None] = lambda result, metrics: None,
    progress: Callable[[float], None] = lambda fraction: None,
) -> Metrics:
    """Reconstruct all frames of a flight in order, and compare those that have a truth with it.

    Parameters
    ----------
    recording
        Simulated flight; see `is_flight`.
    image, ranging, depth, weather, min_free
        As for `Reconstructor`. By default two depth methods, the usual one, which remembers earlier
        frames, and the next, which does not.
    judged
        Called with result and metrics, as of `evaluate`, of each frame that has a truth.
    progress
        Called with the fraction that is done.

    Returns
    -------
    dict
        Plain numbers, ready for JSON; what does not exist is None. ``frames``: their number;
        ``depth_methods``: names, the default one first. ``over_time``, for each frame with a truth:
        ``frame``, ``time_s``, ``image_nrmse``, ``corridor_m`` (true distance of the first
        surface ahead, however thin), and by depth method ``obstacle_m`` and of `depth_metrics`
        ``abs_rel``, ``coverage``, ``within_2_sigma``, ``obstacle_missed`` and ``obstacle_false``.
        ``mean``: of the latter over the frames; without a map all is missed. ``ratio``: for
        each other method, the geometric mean over the frames of the default one's ``abs_rel`` over
        its own, with the 95 % interval from ``low`` to ``high`` of independent ``frames``.
        ``notes``: what results say of the default method's depth, as sentences that name frames,
        and whether the light is a surrogate.

    Raises
    ------
    InputError
        If the recording is not such a flight or none of the frames with a truth can be
        reconstructed, and as `Reconstructor`.
    """
    if not is_flight(recording):
        raise InputError("not a flight: it lacks poses, or the truth of at least two of its frames")
    assert recording.truth is not None
    setup = recording.setup
    if depth is None:
        usual = depth_methods("usual", setup, ranged=setup.spots is not None)
        depth = list(usual)[:2]
    reconstructor = Reconstructor(
        setup, image=image, ranging=ranging, depth=depth, weather=weather, min_free=min_free
    )
    rows: list[Metrics] = []
    notes = _Notes()
    for frame in range(recording.frames):
        try:
            result = reconstructor(recording.frame(frame))
        except InputError as error:  # saturated throughout
            notes.add(frame, str(error).partition(": ")[2])
            continue
        first = next(iter(result.depths), "")
        if note := result.notes.get(f"depth {first}"):
            notes.add(frame, f"depth {first!r} is {note}")
        if recording.truth.knows(frame):
            metrics = evaluate(result, recording)
            rows.append(_row(recording, result, metrics))
            judged(result, metrics)
        progress((frame + 1) / recording.frames)
    if not rows:
        raise InputError(f"no frame with a truth could be reconstructed: {notes.lines[0]}")
    names = list(rows[0]["depths"])
    return {
        "frames": recording.frames,
        "depth_methods": names,
        "over_time": rows,
        "mean": {name: _mean(rows, name) for name in names},
        "ratio": {name: _ratio(rows, names[0], name) for name in names[1:]},
        "notes": [*([NOT_TRACED] if recording.provenance.is_surrogate else []), *notes.lines],
    }


class _Notes:
    """Notes on frames; those that differ in numbers alone are one, with the first one's numbers."""

    def __init__(self) -> None:
        self._frames: dict[str, tuple[str, list[int]]] = {}

    def add(self, frame: int, note: str) -> None:
        """Add the note on a frame."""
        self._frames.setdefault(NUMBER.sub("", note), (note, []))[1].append(frame)

    @property
    def lines(self) -> list[str]:
        """Notes as sentences that name their frames."""
        return [f"{_written(frames)}: {note}" for note, frames in self._frames.values()]


def _written(frames: Sequence[int]) -> str:
    first, last, count = frames[0], frames[-1], len(frames)
    if count == 1:
        return f"frame {first}"
    in_a_row = last - first + 1 == count
    return f"frames {first} to {last}" if in_a_row else f"{count} frames from {first} to {last}"


def _row(recording: Capture, result: Result, metrics: Metrics) -> Metrics:
    """Figures of a frame."""
    assert recording.truth is not None
    assert recording.poses is not None
    image: Figures = next(iter(metrics["images"].values()), {})
    return {
        "frame": result.frame,
        "time_s": number(recording.poses.time_s[result.frame]),
        "image_nrmse": image.get("nrmse"),
        "corridor_m": number(recording.truth.at(result.frame).corridor_m),
        "depths": {
            name: {key: figures[key] for key in FIGURES}
            | {"obstacle_m": number(result.obstacles_m.get(name, np.nan))}
            for name, figures in metrics["depths"].items()
        },
    }


def _mean(rows: Sequence[Metrics], name: str) -> Figures:
    """Means of a depth method over the frames."""
    return {key: _mean_of(_given(row, name).get(key) for row in rows) for key in FIGURES}


def _given(row: Metrics, name: str) -> Figures:
    """A depth method's figures of a frame, those of no map if it gave none."""
    ahead = row["corridor_m"] is not None
    nothing: Figures = {"obstacle_missed": 1.0 if ahead else None, "obstacle_false": 0.0}
    return row["depths"].get(name, nothing)


def _mean_of(values: Iterable[float | None]) -> float | None:
    present = [each for each in values if each is not None]
    return float(np.mean(present)) if present else None


def _ratio(rows: Sequence[Metrics], first: str, other: str) -> Mapping[str, float | int | None]:
    """Geometric mean of the ratio of two methods' ``abs_rel``, paired by frame."""
    pairs = [
        [row["depths"].get(name, {}).get("abs_rel") for name in (first, other)] for row in rows
    ]
    logs = np.array([np.log(one / two) for one, two in pairs if one and two])
    count = len(logs)
    if not count:
        return {"abs_rel": None, "low": None, "high": None, "frames": 0}
    mean, half = float(logs.mean()), np.nan
    if count > 1:
        from scipy.special import stdtrit  # slow to load

        wide = float(stdtrit(count - 1, (1 + CONFIDENCE) / 2))  # of Student's t
        half = wide * float(logs.std(ddof=1)) / np.sqrt(count)
    low, high = number(np.exp(mean - half)), number(np.exp(mean + half))
    return {"abs_rel": float(np.exp(mean)), "low": low, "high": high, "frames": count}
