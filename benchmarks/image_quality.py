"""How good images are, by method: the measured car, drawn scenes and photographs.

    pip install 'spisim[benchmarks]'
    python benchmarks/image_quality.py [--quick] [--json] [--markdown]

The scenes are those of image_quality.yaml, drawn anew for this and known to no method; they are
traced on the first run, into out/image-quality, which takes a few minutes. Photographs are
scikit-image's, with noise of a thirtieth of the coefficients' rms. The car's truth is the image of
all its patterns. Intervals are of the mean over images, by bootstrap. `--markdown` pastes the
tables into docs/results/images.md.
"""

import subprocess
import sys
from collections import defaultdict
from collections.abc import Iterator
from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np
import skimage.data
from numpy.typing import NDArray
from options import benchmark_options, finish
from skimage.color import rgb2gray
from skimage.metrics import structural_similarity
from skimage.transform import resize

import spisim.dataset
from reconstruction import Capture, Reconstructor
from reconstruction.capture import first_patterns
from reconstruction.capture.importers import capture_from_readings
from reconstruction.operators import expose, make_plan
from spisim_paper.checks import Check, Table, surroundings

HERE = Path(__file__).parent
PAGE = HERE.parent / "docs" / "results" / "images.md"
PLAN = HERE / "image_quality.yaml"
SCENES = HERE.parent / "out" / "image-quality"
CAR = HERE.parent / "tests" / "data" / "car_buckets_201.npy"
PACKAGES = ("spisim", "numpy", "scipy", "scikit-image")
FRACTIONS = (0.03125, 0.0625, 0.125, 0.25)
METHODS = (
    *("zero-filled", "pursuit", "least-squares", "fitted-covariance", "total-variation"),
    *("edge-preserving", "learned"),
)
REFERENCE, DEFAULT = "least-squares", "edge-preserving"
PHOTOGRAPHS = (
    *("astronaut", "brick", "camera", "chelsea", "clock", "coffee", "coins", "grass", "gravel"),
    *("hubble_deep_field", "immunohistochemistry", "moon", "page", "rocket", "text"),
)
SIDE = 64
PHOTOGRAPH_SNR = 30.0
RESAMPLED = 2000
COMPILED: dict[bytes, Reconstructor] = {}

Image = NDArray[np.float64]
Metrics = dict[str, float]


@dataclass(frozen=True)
class Case:
    """A recording and its true image, one of those that a row of the tables is the mean of."""

    row: str
    capture: Capture
    truth: Image


def main() -> int:
    """Quality by row, sampling ratio and method."""
    options = benchmark_options(__doc__, "every fourth image, three shares", PAGE)
    result: dict[tuple[str, float], list[dict[str, Metrics]]] = defaultdict(list)
    for fraction in FRACTIONS[: 3 if options.quick else None]:
        COMPILED.clear()
        for number, case in enumerate(cases()):
            if not (options.quick and number % 4):
                result[case.row, fraction].append(measured(case, fraction))
    tables = [
        table(result, "correlation", "Correlation with the true image", 3),
        table(result, "psnr_db", "PSNR, dB", 2),
        table(result, "ssim", "SSIM", 3),
        compared(result),
    ]
    return finish(options, PAGE, "image", surroundings(PACKAGES), tables, checks(result))


def cases() -> Iterator[Case]:
    """All recordings."""
    yield car()
    yield from drawn()
    yield from photographs()


def car() -> Case:
    """The measured car."""
    readings = np.load(CAR).astype(np.float64)
    plan = make_plan((32, 32), order="natural", polarity="signed")
    capture = capture_from_readings(readings, plan, untrusted=[0])
    truth = Reconstructor(capture.setup, image="zero-filled")(capture.frame()).image
    return Case("measured car", capture, truth.astype(np.float64))


def drawn() -> Iterator[Case]:
    """Drawn scenes, simulated."""
    command = ["spisim", "dataset", str(PLAN), "--output", str(SCENES)]
    subprocess.run([sys.executable, "-m", *command], check=True)
    for sample in spisim.dataset.open(SCENES):
        capture = sample.capture
        truth = capture.truth.at(0) if capture.truth is not None else None
        assert truth is not None
        weather = "fog" if "scene.fog.kind" in sample.parameters else "clear"
        row = f"scenes, {sample.parameters['instrument']}, {weather}"
        yield Case(row, capture, truth.image.astype(np.float64))


def photographs() -> Iterator[Case]:
    """Photographs with white noise of the recording's stated level."""
    plan = make_plan((SIDE, SIDE), SIDE**2 // 4, polarity="signed")
    for number, name in enumerate(PHOTOGRAPHS):
        picture = np.asarray(getattr(skimage.data, name)(), dtype=np.float64)
        grey = rgb2gray(picture[..., :3]) if picture.ndim == 3 else picture
        side = min(grey.shape)
        top, left = ((length - side) // 2 for length in grey.shape)
        square = grey[top : top + side, left : left + side]
        truth = 1e9 * resize(square, (SIDE, SIDE), anti_aliasing=True) / square.max()
        light = expose(plan, truth)
        noise = float(np.std(light[1:])) / PHOTOGRAPH_SNR
        readings = light + noise * np.random.default_rng(number).standard_normal(light.shape)
        capture = capture_from_readings(readings, plan)
        # So much light that its own noise is none beside this.
        buckets = replace(capture.buckets, electrons_per_count=1.0, noise_electrons=noise)
        yield Case("photographs", replace(capture, buckets=buckets), truth)


def measured(case: Case, fraction: float) -> dict[str, Metrics]:
    """Quality by method, and of the default with the noise unknown."""
    plan = case.capture.plan
    capture = first_patterns(case.capture, min(round(fraction * plan.pixels), plan.sampled))
    available = images(capture)
    scale = capture.buckets.electrons_per_count
    unknown = replace(capture, buckets=replace(capture.buckets, electrons_per_count=np.nan))
    forgotten = images(unknown)[DEFAULT] * (scale if np.isfinite(scale) else 1.0)
    if capture.plan.patterns.dc_row not in capture.plan.index or case.row == "measured car":
        available = {name: level_of(image, case.truth) for name, image in available.items()}
        forgotten = level_of(forgotten, case.truth)
    flat = np.full_like(case.truth, case.truth.mean())
    minimum = min(
        squared_error(available["zero-filled"], case.truth), squared_error(flat, case.truth)
    )
    named = available | {"noise unknown": forgotten}
    return {name: metrics(image, case.truth, minimum) for name, image in named.items()}


def images(capture: Capture) -> dict[str, Image]:
    """Images by method; what is compiled serves all recordings of the same patterns."""
    digest = capture.setup.digest(0)
    if digest not in COMPILED:
        COMPILED[digest] = Reconstructor(capture.setup, image=METHODS, ranging=(), depth=())
    result = COMPILED[digest](capture.frame())
    return {name: image.astype(np.float64) for name, image in result.images.items()}


def level_of(image: Image, truth: Image) -> Image:
    """The image with the level of the truth, where the recording does not state it."""
    return image - image.mean() + truth.mean()


def squared_error(image: Image, truth: Image) -> float:
    """Mean over the pixels."""
    return float(np.mean((image - truth) ** 2))


def metrics(image: Image, truth: Image, minimum: float) -> Metrics:
    """Of one image; ``minimum`` is the squared error of the better of zero-filled and flat."""
    error = squared_error(image, truth)
    span = float(np.ptp(truth))
    spread = image.std() * truth.std()
    covariance = np.mean((image - image.mean()) * (truth - truth.mean()))
    return {
        "correlation": float(covariance / spread) if spread > 0 else 0.0,
        "psnr_db": 10 * np.log10(float(truth.max()) ** 2 / error),
        "ssim": float(structural_similarity(image, truth, data_range=span)),
        "gain_db": 10 * np.log10(minimum / error),
    }


Estimate = dict[tuple[str, float], list[dict[str, Metrics]]]


def values(result: list[dict[str, Metrics]], method: str, metric: str) -> Image:
    """One number of each image."""
    return np.array([each[method][metric] for each in result])


def table(result: Estimate, metric: str, title: str, digits: int) -> Table:
    """Means by row and method."""
    rows = [
        (
            row,
            f"{100 * fraction:.3g}",
            str(len(each)),
            *(f"{values(each, method, metric).mean():.{digits}f}" for method in METHODS),
        )
        for (row, fraction), each in result.items()
    ]
    return Table(title, ("recordings", "patterns, %", "images", *METHODS), rows)


def compared(result: Estimate) -> Table:
    """What the default gains, with intervals and the worst image."""
    rows = []
    for (row, fraction), each in result.items():
        gain = difference(each, "correlation")
        over_zero = values(each, DEFAULT, "psnr_db") - values(each, "zero-filled", "psnr_db")
        forgotten = values(each, "noise unknown", "psnr_db") - values(each, DEFAULT, "psnr_db")
        rows.append(
            (
                row,
                f"{100 * fraction:.3g}",
                "{:+.4f} ({:+.4f} to {:+.4f})".format(gain.mean(), *interval(gain)),
                "{:+.2f} ({:+.2f} to {:+.2f})".format(over_zero.mean(), *interval(over_zero)),
                f"{over_zero.min():+.2f}",
                f"{values(each, DEFAULT, 'gain_db').mean():+.2f}",
                f"{forgotten.mean():+.2f}",
            )
        )
    title = "The default: mean, its 95 % interval and the worst image"
    columns = (
        "recordings",
        "patterns, %",
        "correlation over least squares",
        "dB over zero-filled",
        "worst, dB",
        "dB over the better of zero-filled and flat",
        "dB where the noise is unknown",
    )
    return Table(title, columns, rows)


def difference(result: list[dict[str, Metrics]], metric: str) -> Image:
    """The default less the reference, of each image."""
    return values(result, DEFAULT, metric) - values(result, REFERENCE, metric)


def interval(numbers: Image) -> tuple[float, float]:
    """95 % interval of the mean, by bootstrap."""
    drawn = np.random.default_rng(0).integers(len(numbers), size=(RESAMPLED, len(numbers)))
    low, high = np.percentile(numbers[drawn].mean(axis=1), [2.5, 97.5])
    return float(low), float(high)


def checks(result: Estimate) -> list[Check]:
    """What is promised."""
    few = FRACTIONS[0]
    at_few = [difference(each, "correlation").mean() for (_, s), each in result.items() if s == few]
    highest = min(interval(difference(each, "correlation"))[1] for each in result.values())
    promised = [
        Check(
            "correlation over least squares at 3 %, mean of rows",
            float(np.mean(at_few)),
            0.01,
            True,
        ),
        Check("the same, upper end of the interval in the worst row", highest, 0.0, True),
    ]
    for weather, limit in (("clear", 1.4), ("fog", 1.2)):
        each = result.get((f"scenes, paper, {weather}", few))
        if each:
            gains = values(each, DEFAULT, "psnr_db") - values(each, "zero-filled", "psnr_db")
            name = f"dB over zero-filled, paper, {weather}, 3 %"
            promised.append(Check(name, float(gains.mean()), limit, True))
            promised.append(Check(f"{name}, worst image", float(gains.min()), -0.1, True))
    car = values(result["measured car", few], DEFAULT, "correlation").mean()
    promised.append(Check("correlation of the car at 3 %", float(car), 0.91, True))
    lost = [
        (values(each, DEFAULT, "psnr_db") - values(each, "noise unknown", "psnr_db")).mean()
        for each in result.values()
    ]
    promised.append(Check("dB lost where the noise is unknown, worst row", float(max(lost)), 0.1))
    return promised


if __name__ == "__main__":
    sys.exit(main())
