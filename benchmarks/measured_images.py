"""How well images and their noise agree with measured single-photon recordings.

    python benchmarks/measured_images.py FOLDER [--quick] [--json]

FOLDER holds photon counts of a single-pixel camera (docs/recordings.md#photon-counts). None is part
of this repository. Recordings whose names differ in the exposure alone are taken as one scene.

Noise: readings of one scene at two exposures; the excess over photon noise is estimated from half
of the patterns, and predicts the differences of the other half. Images: the default method sees a
random half of the patterns; what it leaves unexplained of the differences of the other half, with
the throughput that pairs show and with all patterns alike. The same is done with recordings drawn
from the measured image and throughput, in which differences do or do not share the throughput of
the sums: they tell which of both the measured gain speaks for. Intervals: Student's, over halves.
"""

import sys
from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from scipy.ndimage import gaussian_filter
from scipy.stats import t

from reconstruction import Reconstructor
from reconstruction.base.arrays import Mask
from reconstruction.base.errors import InputError
from reconstruction.base.text import json_line
from reconstruction.calibration import ThroughputCalibration, excess_noise, throughput_of
from reconstruction.capture import Capture
from reconstruction.capture.importers import capture_from_readings
from reconstruction.operators import decoder_for
from spisim_formats.recordings.photon_counts import NAME, RECORDING

#: Random halves, and those of a quick run.
HALVES, QUICK_HALVES = 40, 4
#: Halves of the patterns in which the excess noise is estimated and judged.
NOISE_HALVES = 200
CONFIDENCE = 0.95


@dataclass(frozen=True)
class Figure:
    """A figure of a recording with its interval."""

    recording: str
    name: str
    value: float
    low: float
    high: float
    limit: str = ""


def figures(folder: Path, halves: int = HALVES) -> Iterator[Figure]:
    """All figures of the recordings in a folder; InputError if there is none."""
    paths = sorted(path for path in folder.rglob("*.npy") if RECORDING.recognises(path))
    if not paths:
        raise InputError(f"{folder}: holds no recording named DATE_SCENE_PATTERNS_EXPOSURE.npy")
    captures = {path.stem: captured(path) for path in paths}
    for one, other in repeated(list(captures)):
        yield from noise_figures(f"{one} and {other}", captures[one], captures[other])
    for name, capture in captures.items():
        yield from throughput_figures(name, capture, halves)


def captured(path: Path) -> Capture:
    """The capture of a recording."""
    recording = RECORDING.load(path)
    return capture_from_readings(recording.readings, recording.plan, about=recording.about)


def repeated(names: list[str]) -> Iterator[tuple[str, str]]:
    """Pairs of recordings whose names differ in the exposure alone, the shorter first."""
    scenes: dict[str, list[tuple[int, str]]] = {}
    for name in names:
        match = NAME.fullmatch(f"{name}.npy")
        assert match is not None
        begin, end = match.span("exposure_us")
        scenes.setdefault(name[:begin] + name[end:], []).append((int(match["exposure_us"]), name))
    for same in scenes.values():
        ordered = [name for _, name in sorted(same)]
        yield from pairwise(ordered)


def noise_figures(names: str, first: Capture, second: Capture) -> Iterator[Figure]:
    """Measured over predicted noise of differences, and z-scores of images.

    Those of images are below 1: both images are drawn towards the same prior, whose width is in the
    sigma of each.
    """
    rng = np.random.default_rng(0)
    factor, error = excess_noise(first, second)
    reach = float(t.isf((1 - CONFIDENCE) / 2, first.plan.sampled - 2)) * error
    yield Figure(
        names, "variance of differences over photons'", factor, factor - reach, factor + reach
    )
    ratios = []
    for _ in range(NOISE_HALVES):
        rows = rng.random(first.plan.sampled) < 0.5
        fitted, _ = excess_noise(first, second, rows)
        judged, _ = excess_noise(first, second, ~rows)
        ratios.append(np.sqrt(judged / fitted))
    low, high = np.quantile(ratios, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    middle = float(np.mean(ratios))
    yield Figure(names, "noise over predicted, other patterns", middle, low, high, "0.9 to 1.1")
    both = [_with_excess(each, factor) for each in (first, second)]
    yield _agreement(names, *both)


def _with_excess(capture: Capture, factor: float) -> Capture:
    return replace(capture, buckets=replace(capture.buckets, excess_noise_factor=factor))


def _agreement(names: str, first: Capture, second: Capture) -> Figure:
    """Rms of the difference of two images over what their stated sigmas and priors allow."""
    ratio = float(second.buckets.signal.sum() / first.buckets.signal.sum())
    one, other = (Reconstructor(each.setup)(each.batch(0, 1)) for each in (first, second))
    assert one.sigma is not None
    assert other.sigma is not None
    sigma = np.hypot(other.sigma, ratio * one.sigma)
    z = ((other.image - ratio * one.image) / sigma).ravel()
    value = float(np.sqrt(np.mean(z**2)))
    rng = np.random.default_rng(0)
    again = [np.sqrt(np.mean(rng.choice(z, z.size) ** 2)) for _ in range(1000)]
    low, high = np.quantile(again, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Figure(names, "rms of z, images", value, float(low), float(high))


def throughput_figures(name: str, capture: Capture, halves: int) -> Iterator[Figure]:
    """Scatter of the pairs, and what the throughput explains, measured and in drawn recordings."""
    found = throughput_of([capture])
    if found is None:
        return
    yield _scatter(name, found)
    yield explained(name, "measured", capture, halves)
    for what, acts in (("drawn, sums alone", False), ("drawn, differences too", True)):
        yield explained(name, what, drawn(capture, acts=acts), halves)


def _scatter(name: str, found: ThroughputCalibration) -> Figure:
    """Scatter of the pairs, with its interval from patterns drawn anew."""
    rng, known = np.random.default_rng(0), found.factors[np.isfinite(found.factors)][1:]
    again = [np.std(rng.choice(known, known.size)) / np.std(known) for _ in range(1000)]
    low, high = found.scatter * np.quantile(again, [(1 - CONFIDENCE) / 2, (1 + CONFIDENCE) / 2])
    return Figure(name, "scatter of pairs, rms", found.scatter, float(low), float(high))


def explained(name: str, what: str, capture: Capture, halves: int) -> Figure:
    """Fall of the unexplained variance of unseen differences by throughput, dB."""
    rng = np.random.default_rng(1)
    method = Reconstructor(capture.setup)
    gains = []
    for _ in range(halves):
        seen = rng.random(capture.plan.sampled) < 0.5
        seen[capture.plan.distinct == capture.plan.patterns.dc_row] = True
        alike = unexplained(method, capture, seen, alike=True)
        gains.append(10 * np.log10(alike / unexplained(method, capture, seen, alike=False)))
    reach = t.isf((1 - CONFIDENCE) / 2, halves - 1) * np.std(gains, ddof=1)
    middle, error = float(np.mean(gains)), float(reach / np.sqrt(halves))
    return Figure(name, f"gain in dB, {what}", middle, middle - error, middle + error)


def unexplained(method: Reconstructor, capture: Capture, seen: Mask, *, alike: bool) -> float:
    """Variance of unseen differences (K,) that the image of the ``seen`` ones leaves."""
    plan = capture.plan
    readings = seen[np.searchsorted(np.sort(plan.distinct), plan.index)]
    known = replace(capture, buckets=replace(capture.buckets, saturated=~readings[None]))
    factors = np.ones(plan.sampled)
    if alike:
        stated = replace(plan, throughput=np.ones(plan.patterns.rows))
        known = replace(known, plan=stated)
        method = Reconstructor(known.setup)
    else:
        found = throughput_of([capture])
        if found is not None:
            factors = np.nan_to_num(found.factors[plan.distinct], nan=1.0)
    image = method(known.batch(0, 1)).image
    decoder = decoder_for(plan)
    differences = decoder.decode(capture.buckets.signal[0])
    predicted = factors * decoder.operator.forward(image.astype(np.float64))
    return float(np.mean((differences - predicted)[~seen] ** 2))


def drawn(capture: Capture, *, acts: bool) -> Capture:
    """Recording drawn from an image and the measured sums, which ``acts`` on differences or not."""
    plan, decoder = capture.plan, decoder_for(capture.plan)
    signal = capture.buckets.signal[0]
    sums = signal.reshape(-1, 2).sum(axis=1)
    factors = sums / sums[1:].mean() if acts else np.ones(sums.size)
    image = decoder.operator.min_norm(decoder.decode(signal) / factors)
    image = np.maximum(gaussian_filter(image, 0.5), 0)
    differences = factors * decoder.operator.forward(image)
    sums = np.maximum(sums, np.abs(differences))
    light = np.stack([sums + differences, sums - differences], axis=1).ravel() / 2
    counts = np.random.default_rng(2).poisson(light)[None].astype(np.float64)
    return replace(capture, plan=plan, buckets=replace(capture.buckets, counts=counts))


def main(arguments: list[str]) -> int:
    """Print the figures of a folder."""
    folders = [each for each in arguments if not each.startswith("--")]
    if len(folders) != 1:
        print((__doc__ or "").partition("\n\n")[2].partition("\n")[0].strip(), file=sys.stderr)
        return 2
    every = list(figures(Path(folders[0]), QUICK_HALVES if "--quick" in arguments else HALVES))
    for each in every:
        print(
            f"{each.recording:58} {each.name:40} {each.value:8.3f} "
            f"{each.low:8.3f} {each.high:8.3f} {each.limit}"
        )
    if "--json" in arguments:
        print(json_line({"figures": [vars(each) for each in every]}))
    return 0


if __name__ == "__main__":
    sys.exit(main(sys.argv[1:]))
