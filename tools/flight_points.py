"""What the memory held in frames of recorded flights, to learn completing their maps from.

    PYTHONPATH=benchmarks python tools/flight_points.py FLIGHTS FOLDER

For each flight of families to learn from in the folder FLIGHTS, a file with the frames that have a
truth: image, map and points before they meet, with three draws of pose errors.
"""

import argparse
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
from flight_judging import load, ranges_of, single_frames
from flight_sets import POSE_ERRORS, Flight, flights, with_error

from depth_frames import FAMILY_ASIDE
from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture, Optics
from reconstruction.capture.motion import pose_at
from reconstruction.depth import MAX_RANGE_M
from reconstruction.depth.completion import MapCompletion, Seen
from reconstruction.depth.completion.network import brightness_of
from reconstruction.depth.memory import FlightMemory
from reconstruction.depth.method import DepthEstimate
from reconstruction.depth.pixels import pixel_rays

SEEDS = 0, 1
DRAWS = ("correlated", 0), ("correlated", 100), ("white", 200)
"""Errors of the poses, and what is added to the flight's seed."""
POINTS = ("index", "pixel", "log_depth", "log_variance", "pixel_variance")
COLUMNS = ("slopes", "image", "depth_m", "sigma", "no_return", *POINTS, "true log_depth")


class Flown(NamedTuple):
    """A frame of a flight: its map by all but the points, the points, and true ln depth."""

    image: Floats
    rays: Floats
    estimate: DepthEstimate
    points: Seen
    log_depth: Floats


class Watched(MapCompletion):
    """Keeps what it is given."""

    given: tuple[Floats, DepthEstimate, Seen] | None = None

    def __call__(self, image: Floats, estimate: DepthEstimate, seen: Seen) -> DepthEstimate:
        """As `MapCompletion`."""
        self.given = image, estimate, seen
        return super().__call__(image, estimate, seen)


def main() -> None:
    """Write a file for each flight that has frames with a learned map."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("flights", type=Path)
    parser.add_argument("folder", type=Path)
    asked = parser.parse_args()
    asked.folder.mkdir(parents=True, exist_ok=True)
    for flight in flights(asked.flights, "learned", seeds=SEEDS, record=False):
        file = asked.folder / f"{flight.path.stem}.npz"
        frames = [] if file.exists() else list(_frames(flight))
        if frames:
            columns = {
                f"{number} {name}": value
                for number, frame in enumerate(frames)
                for name, value in zip(COLUMNS, frame, strict=True)
            }
            np.savez(file, **columns)
            print(f"{file.stem}: {len(frames)} frames", flush=True)


def _frames(flight: Flight) -> Iterator[Sequence[Any]]:
    """`COLUMNS` of the frames of a flight, for all draws of its pose errors."""
    capture = load(flight)
    made = single_frames(capture)
    for kind, more in DRAWS:
        yield from _with_poses(with_error(capture, POSE_ERRORS[kind], flight.seed + more), made)


def _with_poses(capture: Capture, made: Sequence[Any]) -> Iterator[Sequence[Any]]:
    truth, optics = capture.truth, capture.optics
    assert truth is not None
    assert optics is not None
    memory = FlightMemory(optics, capture.plan.shape)
    memory.complete = watched = Watched(optics, capture.plan.shape)
    for number, (view, whole) in enumerate(made):
        pose, watched.given = pose_at(capture.poses, number), None
        if whole is None or pose is None:
            continue
        memory.take(pose, view.image, whole.estimate, ranges_of(view, whole))
        if watched.given is None or number not in truth.frame:
            continue
        image, estimate, seen = watched.given
        if estimate.no_return is None or brightness_of(image) is None:
            continue
        true_m = truth.at(number).depth_m.astype(np.float64)
        yield (
            (optics.tan_half_width, optics.tan_half_height),
            *(image, estimate.depth_m, estimate.sigma, estimate.no_return),
            *(getattr(seen, name) for name in POINTS),
            np.log(np.where(true_m <= MAX_RANGE_M, true_m, np.nan)),
        )


def kept_aside(family: str, seed: int) -> bool:
    """Whether flights through a world are not learned from: other seeds, and one family."""
    return seed != 0 or family == FAMILY_ASIDE


def flown_frames(file: Path) -> Iterator[Flown]:
    """Those of a file."""
    with np.load(file) as archive:
        columns = dict(archive)
    for number in range(len(columns) // len(COLUMNS)):
        slopes, image, depth_m, sigma, no_return, *points, log_depth = (
            columns[f"{number} {name}"] for name in COLUMNS
        )
        estimate = DepthEstimate(depth_m, sigma, no_return)
        rays = pixel_rays(Optics(*slopes.tolist()), image.shape)
        yield Flown(image, rays, estimate, Seen(*points), log_depth)


if __name__ == "__main__":
    main()
