"""What is looked at, one frame after the other."""

from __future__ import annotations

import warnings
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from reconstruction import Capture, Reconstructor, Result, read_capture
from reconstruction.base.errors import InputError, naming
from reconstruction.capture import Frames, FrameTruth, Setup
from reconstruction.exports import Shot
from spisim.dataset.reader import DataSet
from spisim.dataset.shots import placed
from spisim.scene import Scene, make_scene, scenes_folder
from spisim.scene.load_context import SceneCache

SECOND_NS = 10**9


@dataclass(frozen=True, eq=False)
class View:
    """One frame: its readings, what was made of them, and what is known of the truth.

    `scene` is that of the capture's beginning, `since_s` before this frame. `title` says whence.
    """

    title: str
    shot: Shot
    result: Result
    setup: Setup
    frame: Frames | None
    truth: FrameTruth | None = None
    scene: Scene | None = None
    since_s: float = 0.0


def views_of_captures(
    paths: Iterable[Path], choice: Mapping[str, Any] | None = None
) -> Iterator[View]:
    """All frames of captures, those of a flight in its time, others one after the other.

    ``choice`` is of methods and weather, as a `Reconstructor` takes them. Raises InputError,
    naming the capture, for what cannot be read or reconstructed.
    """
    eyes = _Eyes(choice or {})
    next_ns = 0
    for path in paths:
        capture = read_capture(path)
        with naming(path):
            for view in eyes.of(capture, path.stem, path.parent, next_ns):
                yield view
                period_ns = round(1e9 * _period_s(view.setup))
                next_ns = view.shot.stamp_ns + period_ns - period_ns // 2


def views_of_samples(samples: DataSet, choice: Mapping[str, Any] | None = None) -> Iterator[View]:
    """All frames of the samples of a data set, one sample a second; InputError as of captures."""
    if not samples:
        raise InputError(f"{samples.folder}: there is no finished sample to look at")
    eyes = _Eyes(choice or {})
    for position, sample in enumerate(samples):
        title = f"sample {sample.index}, {sample.scene_name}"
        with naming(sample.path):
            yield from eyes.of(sample.capture, title, sample.path.parent, position * SECOND_NS)


class _Eyes:
    """Sees captures, and remembers what their scenes have in common."""

    def __init__(self, choice: Mapping[str, Any]) -> None:
        self._choice = dict(choice)
        self._cache = SceneCache()

    def of(self, capture: Capture, title: str, folder: Path, begun_ns: int) -> Iterator[View]:
        """Frames of a capture, the first at `begun_ns` unless it is of a flight."""
        scene = self._scene(capture, title, folder)
        reconstruct = Reconstructor(capture.setup, **self._choice)
        period_s = _period_s(capture.setup)
        for number in range(capture.frames):
            since_s = (number + 0.5) * period_s
            position = placed(capture, number)
            stamp_ns = begun_ns + round(1e9 * since_s)
            if position is not None and position.time_s is not None:
                stamp_ns = round(1e9 * position.time_s)
            frame = capture.frame(number)
            result = reconstruct(frame)
            valid = capture.truth is not None and capture.truth.knows(number)
            yield View(
                title,
                Shot.of(
                    result, capture.setup, stamp_ns, None if position is None else position.pose
                ),
                result,
                capture.setup,
                frame,
                capture.truth.at(number) if valid and capture.truth is not None else None,
                scene,
                since_s,
            )

    def _scene(self, capture: Capture, title: str, folder: Path) -> Scene | None:
        """The scene of a simulated capture; None, with a warning, where its meshes are not there.

        They are looked for among the shipped ones and beside the capture.
        """
        text = capture.provenance.scene
        if not text:
            return None
        problem: InputError | None = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # told when it was simulated
            for where in (scenes_folder(), folder):
                try:
                    return make_scene(text, where, "its scene", cache=self._cache)
                except InputError as error:
                    problem = error
        warnings.warn(f"{title}: shown without its surroundings: {problem}", stacklevel=2)
        return None


def _period_s(setup: Setup) -> float:
    """Of frames; a second where nobody knows."""
    period_s = setup.buckets.pattern_period_s * setup.plan.exposures
    return period_s if 0 < period_s < float("inf") else 1.0
