"""Frames of captures and data sets, one after the other, for the viewer."""

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
from spisim.base.config.files import EnclosedFolder
from spisim.dataset.poses import placed
from spisim.dataset.reader import DataSet
from spisim.scene import Scene, make_scene, scenes_folder
from spisim.scene.load_context import SceneCache

SECOND_NS = 10**9


@dataclass(frozen=True, eq=False)
class View:
    """One frame: its readings, its reconstruction, and the truth if known.

    `scene` is that at the start of the capture, `since_s` before this frame. `title` names its
    source.
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
    """Yield all frames of captures, those of a flight in its time, others one after the other.

    Parameters
    ----------
    paths
        Captures.
    choice
        Methods and weather, as arguments of `Reconstructor`.

    Yields
    ------
    View

    Raises
    ------
    InputError
        For a capture that cannot be read or reconstructed, naming it.
    """
    viewer = _Viewer(choice or {})
    next_ns = 0
    for path in paths:
        capture = read_capture(path)
        with naming(path):
            for view in viewer.of(capture, path.stem, path.parent, next_ns):
                yield view
                period_ns = round(1e9 * _period_s(view.setup))
                next_ns = view.shot.stamp_ns + period_ns - period_ns // 2


def views_of_samples(samples: DataSet, choice: Mapping[str, Any] | None = None) -> Iterator[View]:
    """Yield all frames of the samples of a data set, one sample per second.

    Raises InputError as `views_of_captures` does.
    """
    if not samples:
        raise InputError(f"{samples.folder}: no finished samples to view")
    viewer = _Viewer(choice or {})
    for number, sample in enumerate(samples):
        title = f"sample {sample.index}, {sample.scene_name}"
        with naming(sample.path):
            yield from viewer.of(sample.capture, title, sample.path.parent, number * SECOND_NS)


class _Viewer:
    """Reconstructs captures, and caches their common scenes."""

    def __init__(self, choice: Mapping[str, Any]) -> None:
        self._choice = dict(choice)
        self._cache = SceneCache()

    def of(self, capture: Capture, title: str, folder: Path, begun_ns: int) -> Iterator[View]:
        """Yield frames of a capture, the first at `begun_ns` unless it is of a flight."""
        scene = self._scene(capture, title, folder)
        reconstruct = Reconstructor(capture.setup, **self._choice)
        period_s = _period_s(capture.setup)
        for number in range(capture.frames):
            since_s = (number + 0.5) * period_s
            placement = placed(capture, number)
            stamp_ns = begun_ns + round(1e9 * since_s)
            if placement is not None and placement.time_s is not None:
                stamp_ns = round(1e9 * placement.time_s)
            frame = capture.frame(number)
            result = reconstruct(frame)
            valid = capture.truth is not None and capture.truth.knows(number)
            yield View(
                title,
                Shot.of(
                    result, capture.setup, stamp_ns, None if placement is None else placement.pose
                ),
                result,
                capture.setup,
                frame,
                capture.truth.at(number) if valid and capture.truth is not None else None,
                scene,
                since_s,
            )

    def _scene(self, capture: Capture, title: str, folder: Path) -> Scene | None:
        """Return the scene of a simulated capture; None, with a warning, if its meshes are missing.

        They are searched among the shipped ones and beside the capture.
        """
        text = capture.provenance.scene
        if not text:
            return None
        problem: InputError | None = None
        with warnings.catch_warnings():
            warnings.simplefilter("ignore")  # reported when it was simulated
            for where in (scenes_folder(), folder):
                try:
                    enclosed = EnclosedFolder(where)
                    return make_scene(text, enclosed, "its scene", cache=self._cache)
                except InputError as error:
                    problem = error
        warnings.warn(f"{title}: displayed without its surroundings: {problem}", stacklevel=2)
        return None


def _period_s(setup: Setup) -> float:
    """Return the frame period; a second if unknown."""
    period_s = setup.buckets.pattern_period_s * setup.plan.exposures
    return period_s if 0 < period_s < float("inf") else 1.0
