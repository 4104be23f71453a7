"""Train the network of depth completion, on the frames of `tools/depth_frames.py`.

    pip install 'spisim[torch]'
    PYTHONPATH=benchmarks python tools/completion_network.py FOLDER WEIGHTS.npz [--flights FOLDER]

The map of each frame, by `learned`, is corrected by points drawn as a flight might remember them
(`tools/drawn_points.py`), and the network learns what is left. One sample of five is a frame of a
flight with the points that its memory held (`tools/flight_points.py`), if there are flights. The
loss is that of a Laplace distribution of ln depth with its sigma, and the mean relative error. One
family and every 20th scene are held out. Beside the weights, a JSON file of their name has what
they were trained on, and their figures on the held-out frames; `tools/flight_memory.py` calibrates
sigma on other flights.
"""

import argparse
import hashlib
import json
from collections import Counter
from collections.abc import Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np
import torch
from threadpoolctl import threadpool_limits
from torch import Tensor
from torch.utils.data import IterableDataset

from depth_frames import FAMILY_ASIDE, PLAN, from_arrays
from depth_network import (
    ASIDE,
    BATCH,
    FARTHEST,
    OF_RELATIVE,
    SEED,
    Net,
    digest,
    evaluated,
    loaded,
    scenes_of,
    started,
    trained,
)
from drawn_points import Known, drawn_points
from flight_points import Flown, flown_frames, kept_aside
from reconstruction.base.arrays import Floats
from reconstruction.depth.completion.correction import MapCorrector
from reconstruction.depth.completion.network import (
    MAPS,
    VERSION,
    brightness_of,
    completion_input,
)
from reconstruction.depth.method import DepthEstimate
from reconstruction.depth.methods.learned import shipped
from reconstruction.depth.network import LOG_SIGMA
from reconstruction.depth.network_input import inputs_of
from reconstruction.depth.pixels import pixel_of, pixel_rays

BIASES = 0.0, 0.0
"""Of the error over sigma, and of the logarithm of the factor of sigma."""
JUDGED = 400
"""Frames with points, of each held-out set."""
NUMBERS_OF_POINTS = 1, 20, 80, 200, 1000
NONE = torch.zeros(BATCH, 0)
FLOWN, FEWER = 0.2, 0.6
"""Fractions of the samples that are of flights, and of these, of those with fewer points."""


class Frame(NamedTuple):
    """A frame with its map by `learned`, and what is true."""

    image: Floats
    rays: Floats
    estimate: DepthEstimate
    known: Known


class Batches(IterableDataset[list[Tensor]]):
    """Batches of completed frames, without end."""

    def __init__(self, frames: Sequence[Frame], flown: Sequence[Flown]) -> None:
        super().__init__()
        self._frames, self._flown = frames, flown

    def __iter__(self) -> Iterator[list[Tensor]]:
        """The same ones every time."""
        threadpool_limits(1)
        rng = np.random.default_rng(SEED)
        samples = drawn(self._frames, rng, self._flown)
        while True:
            yield stacked([mirrored(next(samples), rng) for _ in range(BATCH)])


Sample = tuple[Any, Any, Any, Any, int]
"""Maps, ln depth and sigma that are corrected, true ln depth, number of points."""


def drawn(
    frames: Sequence[Frame], rng: np.random.Generator, flown: Sequence[Flown] = ()
) -> Iterator[Sample]:
    """Frames with points, without end; some are `flown`."""
    return completed(_chosen(frames, rng, flown))


def _chosen(
    frames: Sequence[Frame], rng: np.random.Generator, flown: Sequence[Flown]
) -> Iterator[Flown]:
    """Frames with points that are drawn, or some of those that a flight had."""
    while True:
        if flown and rng.random() < FLOWN:
            frame = flown[rng.integers(len(flown))]
            if rng.random() < FEWER:
                some = rng.random(len(frame.points.index)) < rng.uniform(0.1, 1)
                frame = frame._replace(points=frame.points[some])
            yield frame
        else:
            image, rays, estimate, known = frames[rng.integers(len(frames))]
            yield Flown(image, rays, estimate, drawn_points(rng, known), known.log_depth)


def completed(frames: Iterable[Flown]) -> Iterator[Sample]:
    """What the network sees of frames with points."""
    correct: MapCorrector | None = None
    for image, rays, estimate, points, log_depth in frames:
        correct = correct or MapCorrector(image.shape)
        correction = correct(np.log(estimate.depth_m), estimate.sigma, points)
        brightness = brightness_of(image)
        if correction is not None and brightness is not None:
            inputs = completion_input(brightness, rays, estimate, correction)
            yield (*inputs, log_depth, len(points.index))


def _aside(file: Path) -> bool:
    family, seed = file.stem.split("_")[:2]
    return kept_aside(family, int(seed))


def mirrored(sample: Sample, rng: np.random.Generator) -> Sample:
    """A sample as it is, or from right to left."""
    if rng.random() < 0.5:
        return sample
    maps, *others, points = sample
    maps = maps[..., ::-1].copy()
    maps[6] *= -1  # the slope of the rays
    return (maps, *(each[:, ::-1] for each in others), points)  # type: ignore[return-value]


def stacked(samples: Sequence[Sample]) -> list[Tensor]:
    """Maps, ln depth, sigma and true ln depth of samples."""
    return [
        torch.from_numpy(np.stack([each[part] for each in samples]).astype(np.float32))
        for part in range(4)
    ]


def frames_of(files: Sequence[Path]) -> dict[str, list[Frame]]:
    """Frames by their family, of those that the learned method has a map of."""
    network, result = shipped(), {}
    for file in files:
        with np.load(file) as archive:
            columns = {name: archive[name] for name in archive.files}
        for number, family in enumerate(columns["family"].tolist()):
            each = {name: values[number] for name, values in columns.items()}
            frame = from_arrays(each)
            if not frame.bright > 0 or not frame.ranged:
                continue
            inputs = inputs_of(frame)
            if network.out_of_distribution(inputs):
                continue
            predicted = network(inputs)
            estimate = DepthEstimate(
                np.exp(predicted.log_depth), predicted.sigma, predicted.no_return
            )
            shape, best = frame.image.shape, frame.best
            known = Known(
                np.log(each["depth_m"].astype(np.float64)),
                pixel_of(frame.directions, frame.optics, shape),
                np.where(frame.lost, np.nan, best.log_depth),
                best.log_sigma,
                frame.max_range_m,
            )
            rays = pixel_rays(frame.optics, shape)
            result.setdefault(family, []).append(Frame(frame.image, rays, estimate, known))
    return result


def loss_of_batch(net: Net, batch: list[Tensor]) -> tuple[Tensor, dict[str, Tensor]]:
    """The loss of a batch, and the parts of it."""
    maps, start, sigma, log_depth = batch
    out = evaluated(net, maps, NONE)
    there = torch.isfinite(log_depth)
    error = torch.where(there, start + sigma * out[:, 0] - torch.nan_to_num(log_depth), 0)
    error = error.clamp(-FARTHEST, FARTHEST)
    log_scale = (torch.log(sigma) + out[:, 1]).clamp(*LOG_SIGMA) - np.log(2) / 2
    unlikely = log_scale + error.abs() * torch.exp(-log_scale)
    relative = (torch.exp(error) - 1).abs()
    fraction = there.float().mean(dim=(1, 2)).clamp(min=0.05)
    parts = {
        name: ((values * there).mean(dim=(1, 2)) / fraction).mean()
        for name, values in (("unlikely", unlikely), ("relative", relative))
    }
    return parts["unlikely"] + OF_RELATIVE * parts["relative"], parts


@torch.no_grad()
def quality(net: torch.nn.Module, samples: Sequence[Sample]) -> dict[str, Any]:
    """By number of points: frames, AbsRel by the points alone and with the network; coverage."""
    figures, within = [], []
    for sample in samples:
        maps, start, sigma, log_depth = stacked([sample])
        out = net(maps, NONE[:1])
        there = torch.isfinite(log_depth)
        if not there.any():
            continue
        error = (start - log_depth)[there], (start + sigma * out[:, 0] - log_depth)[there]
        log_sigma = (torch.log(sigma) + out[:, 1]).clamp(*LOG_SIGMA)[there]
        within.append(float((error[1].abs() < 2 * torch.exp(log_sigma)).float().mean()))
        figures.append((sample[4], *(float(torch.expm1(each).abs().mean()) for each in error)))
    points, before, after = np.array(figures).T
    rows: dict[str, Any] = {"within_2_sigma": round(float(np.mean(within)), 3)}
    for first, last in pairwise(NUMBERS_OF_POINTS):
        some = (points >= first) & (points < last)
        if some.any():
            means = (round(float(each[some].mean()), 4) for each in (before, after))
            rows[f"{first} to {last - 1} points"] = [int(some.sum()), *means]
    return rows


def main() -> None:
    """Train, and write weights and manifest."""
    parser = argparse.ArgumentParser(description=(__doc__ or "").partition("\n")[0])
    parser.add_argument("folder", type=Path)
    parser.add_argument("weights", type=Path)
    parser.add_argument("--flights", type=Path, help="folder of `tools/flight_points.py`")
    parser.add_argument("--steps", type=int, default=40000)
    parser.add_argument("--start", type=Path, help="weights to begin with")
    parser.add_argument("--minutes", type=float, default=np.inf, help="if that is sooner")
    asked = parser.parse_args()
    torch.manual_seed(SEED)
    torch.set_num_threads(1)
    files = sorted(asked.folder.glob("*.npz"))
    aside = files[::ASIDE]
    train = frames_of([file for file in files if file not in set(aside)])
    held = {"family": train.pop(FAMILY_ASIDE)}
    held["seeds"] = [
        frame
        for family, frames in frames_of(aside).items()
        for frame in frames
        if family != FAMILY_ASIDE
    ]
    samples = {
        name: [sample for sample, _ in zip(drawn(each, _rng()), range(JUDGED), strict=False)]
        for name, each in held.items()
    }
    frames = [frame for frames in train.values() for frame in frames]
    flights = sorted(asked.flights.glob("*.npz")) if asked.flights else []
    learned = [file for file in flights if not _aside(file)]
    flown = [frame for file in learned for frame in flown_frames(file)]
    if flown:
        aside = [frame for file in flights if _aside(file) for frame in flown_frames(file)]
        samples["flights"] = list(completed(aside))
    print(len(frames), len(flown), {name: len(each) for name, each in samples.items()}, flush=True)
    net, steps = trained(
        started(asked.start, Net(MAPS, 0, BIASES)),
        loaded(Batches(frames, flown)),
        loss_of_batch,
        lambda net: {name: quality(net, each) for name, each in samples.items()},
        asked.steps,
        asked.minutes,
    )
    weights = {name: value.half().numpy() for name, value in net.state_dict().items()}
    np.savez(asked.weights, version=VERSION, **weights)
    manifest = {
        "steps": steps,
        "start": asked.start and hashlib.sha256(asked.start.read_bytes()).hexdigest(),
        "data": digest(files),
        "scenes": scenes_of(files),
        "frames": len(frames),
        "flights": len(learned),
        "frames_of_flights": len(flown),
        "families": dict(Counter({name: len(each) for name, each in train.items()})),
        "family_aside": FAMILY_ASIDE,
        "seed": SEED,
        "plan": hashlib.sha256(PLAN.read_bytes()).hexdigest(),
        "sha256": hashlib.sha256(asked.weights.read_bytes()).hexdigest(),
        "aside": {name: quality(net, each) for name, each in samples.items()},
    }
    asked.weights.with_suffix(".json").write_text(json.dumps(manifest, indent=2) + "\n")


def _rng() -> np.random.Generator:
    return np.random.default_rng(SEED)


if __name__ == "__main__":
    main()
