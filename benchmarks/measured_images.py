"""Recordings of a single-photon camera with a mirror array: are their noise and images understood?

Recordings whose names differ in the exposure alone are of one scene. The excess over the noise of
photons is estimated from the earlier half of their patterns, and predicts the differences between
recordings in the later half; a table has the same from the smaller differences for the larger.
Images: the default method sees a random half of the patterns of a recording; what does it leave
unexplained of the differences of the other half, with the throughput that pairs show, and with all
patterns alike?

The same is done with recordings drawn from the measured sums and an image, in which differences do
or do not share the throughput of the sums.
"""

from collections.abc import Iterator
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np
from intervals import of_size
from matplotlib.figure import Figure
from measured_figures import Comparison, MeasuredSet
from scipy.ndimage import gaussian_filter
from scipy.stats import norm, t

from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats, Mask
from reconstruction.base.errors import InputError
from reconstruction.calibration import excess_noise, throughput_of
from reconstruction.capture import Capture
from reconstruction.capture.importers import capture_from_readings
from reconstruction.operators import decoder_for
from spisim_formats.recordings.photon_counts import NAME, RECORDING
from spisim_paper.checks import Check, Interval, Table

#: Random halves of the patterns that images see, and those of a quick run.
HALVES, QUICK_HALVES = 40, 4
MAX_NOISE_OFF, MAX_Z_OFF = 0.15, 0.1
#: Promised gain, dB, by the date in the name; images of others must not be worse.
GAIN_DB = {"240321": 0.4, "240324": 0.75}
CONFIDENCE = 0.95
TEXT = (
    "Images are drawn towards a prior of which both exposures' sigmas hold the width, so their "
    "difference is smaller than these together. A gain is no proof that differences share the "
    "throughput of the sums: recordings drawn without it gain as much, because the prior expects "
    "less of coarse patterns than these scenes have."
)


@dataclass(frozen=True)
class Gain:
    """Fall of the variance left unexplained, dB: mean over random halves, and its interval."""

    mean: float
    interval: Interval

    @property
    def text(self) -> str:
        """The mean and its interval."""
        low, high = self.interval(CONFIDENCE)
        return f"{self.mean:+.2f} ({low:+.2f} to {high:+.2f})"


def compare(folder: Path, quick: bool) -> Comparison:
    """Noise of repeated scenes, and the gain of every recording."""
    paths = sorted(path for path in folder.rglob("*.npy") if RECORDING.recognises(path))
    if not paths:
        raise InputError(f"{folder}: holds no recording named DATE_SCENE_PATTERNS_EXPOSURE.npy")
    captures = {path.stem: captured(path) for path in paths}
    checks, noise_rows, gain_rows = [], [], []
    for one, other in repeated(list(captures)):
        pair_checks, row = noise_of(captures[one], captures[other])
        checks += pair_checks
        noise_rows.append((f"{one}, {other}", *row))
    halves = QUICK_HALVES if quick else HALVES
    for name, capture in captures.items():
        found = throughput_of([capture])
        if found is None:
            gain_rows.append((name, "none beyond noise", "", "", ""))
            continue
        gain = gain_of(capture, halves)
        limit = GAIN_DB.get(name.partition("_")[0], 0.0)
        checks.append(Check(f"{name}: gain, dB", gain.mean, limit, True, gain.interval))
        others = [gain_of(drawn(capture, acts=acts), halves).text for acts in (False, True)]
        gain_rows.append((name, f"{100 * found.scatter:.1f} %", gain.text, *others))
    tables = [
        Table("Two exposures of one scene", NOISE_COLUMNS, noise_rows),
        Table("Unexplained variance of unseen differences", GAIN_COLUMNS, gain_rows),
        Table(TEXT),
    ]
    compared = (
        "Noise of differences beside that of photons, and how well an image from half of the "
        "patterns explains the others, with and without their throughput"
    )
    return Comparison(compared, checks, tables, picture(captures))


NOISE_COLUMNS = (
    *("recordings", "variance over photons'", "noise of later patterns over predicted"),
    *("of larger differences", "rms of z, images"),
)
GAIN_COLUMNS = (
    *("recording", "scatter of pairs", "gain, dB"),
    *("drawn, sums alone", "drawn, differences too"),
)


def picture(captures: dict[str, Capture]) -> Figure:
    """Default images, and sums of pairs by the rows and columns of the Hadamard matrix."""
    figure = Figure(figsize=(3 * len(captures), 6), layout="constrained")
    axes = figure.subplots(2, len(captures), squeeze=False)
    for column, (name, capture) in enumerate(captures.items()):
        image = Reconstructor(capture.setup)(capture.batch(0, 1)).image
        sums = capture.buckets.signal.reshape(-1, 2).sum(axis=1)
        for axis, values in zip(axes[:, column], (image, sums.reshape(image.shape)), strict=True):
            axis.imshow(values, cmap="gray")
            axis.set(xticks=[], yticks=[])
        axes[0, column].set_title(name, fontsize=7)
    axes[0, 0].set_ylabel("default image")
    axes[1, 0].set_ylabel("pattern + complement")
    return figure


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


def noise_of(first: Capture, second: Capture) -> tuple[list[Check], tuple[str, ...]]:
    """How well noise is predicted, and a row of figures."""
    patterns = first.plan.sampled
    factor, error = excess_noise(first, second)
    decoder = decoder_for(first.plan)
    size = np.abs(decoder.decode(second.buckets.signal[0]))
    ratio, interval = judged_noise(first, second, np.arange(patterns) < patterns // 2)
    by_size, _ = judged_noise(first, second, size < np.median(size))
    low, high = interval(CONFIDENCE)
    off = of_size(lambda confidence: (interval(confidence)[0] - 1, interval(confidence)[1] - 1))
    checks = [
        Check(
            "noise of later patterns off that predicted", abs(ratio - 1), MAX_NOISE_OFF, False, off
        ),
        Check("rms of z of their exposures off 1", abs(ratio - 1), MAX_Z_OFF, False, off),
    ]
    both = [
        replace(each, buckets=replace(each.buckets, excess_noise_factor=factor))
        for each in (first, second)
    ]
    return checks, (
        f"{factor:.2f} ± {error:.2f}",
        f"{ratio:.3f} ({low:.3f} to {high:.3f})",
        f"{by_size:.3f}",
        f"{_agreement(*both):.2f}",
    )


def judged_noise(first: Capture, second: Capture, fitted: Mask) -> tuple[float, Interval]:
    """Noise of the other patterns over that predicted by the excess of the ``fitted`` ones (K,)."""
    (known, known_error), (judged, error) = (
        excess_noise(first, second, each) for each in (fitted, ~fitted)
    )
    ratio = float(np.sqrt(judged / known))
    sigma = float(np.hypot(known_error / known, error / judged)) / 2

    def interval(confidence: float) -> tuple[float, float]:
        reach = float(norm.isf((1 - confidence) / 2)) * sigma
        return ratio * float(np.exp(-reach)), ratio * float(np.exp(reach))

    return ratio, interval


def _agreement(first: Capture, second: Capture) -> float:
    """Rms of the difference of two default images over their sigmas."""
    ratio = float(second.buckets.signal.sum() / first.buckets.signal.sum())
    one, other = (Reconstructor(each.setup)(each.batch(0, 1)) for each in (first, second))
    assert one.sigma is not None
    assert other.sigma is not None
    z = (other.image - ratio * one.image) / np.hypot(other.sigma, ratio * one.sigma)
    return float(np.sqrt(np.mean(z**2)))


def gain_of(capture: Capture, halves: int) -> Gain:
    """Gain by throughput of images that see random halves of the patterns."""
    rng = np.random.default_rng(1)
    plan = capture.plan
    ones = replace(plan, throughput=np.ones(plan.patterns.rows))
    alike = replace(capture, plan=ones)
    found = throughput_of([capture])
    factors = np.ones(plan.sampled)
    if found is not None:
        factors = np.nan_to_num(found.factors[plan.distinct], nan=1.0)
    methods = [Reconstructor(each.setup) for each in (alike, capture)]
    gains = []
    for _ in range(halves):
        seen = rng.random(plan.sampled) < 0.5
        seen[plan.distinct == plan.patterns.dc_row] = True
        before = unexplained(methods[0], alike, seen, np.ones(plan.sampled))
        gains.append(10 * np.log10(before / unexplained(methods[1], capture, seen, factors)))
    mean, error = float(np.mean(gains)), float(np.std(gains, ddof=1) / np.sqrt(halves))

    def interval(confidence: float) -> tuple[float, float]:
        reach = float(t.isf((1 - confidence) / 2, halves - 1)) * error
        return mean - reach, mean + reach

    return Gain(mean, interval)


def unexplained(method: Reconstructor, capture: Capture, seen: Mask, factors: Floats) -> float:
    """Variance of unseen differences that the image of ``seen`` (K,) ones leaves."""
    plan, buckets = capture.plan, capture.buckets
    row_of = {int(row): number for number, row in enumerate(plan.distinct)}
    readings = seen[[row_of[int(row)] for row in plan.index]]
    known = replace(capture, buckets=replace(buckets, saturated=~readings[None]))
    image = method(known.batch(0, 1)).image.astype(np.float64)
    decoder = decoder_for(replace(plan, throughput=None))
    differences = decoder.decode(buckets.signal[0])
    return float(np.mean((differences - factors * decoder.operator.forward(image))[~seen] ** 2))


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


SETS = (
    MeasuredSet(
        "single-photon-images",
        "[Photon_Counter_FPGA_SinglePixelImaging](https://github.com/cka09191/"
        "Photon_Counter_FPGA_SinglePixelImaging) at 6b1836f, no licence",
        compare,
    ),
)
