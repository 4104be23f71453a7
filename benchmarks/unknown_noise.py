"""Unknown noise of few readings: the default image beside those with the noise stated.

    pip install 'spisim[benchmarks]'
    python benchmarks/unknown_noise.py [--recordings FOLDER] [--quick] [--json] [--markdown]

White noise of a given size over the rms of the coefficients is added to the first readings of the
measured car, of the truths of the scenes of image_quality.yaml, of photographs, and of the captures
(`*.h5`) in folders that are named, whose truth is the image of all their patterns. Three images by
the default method: the noise is unknown, stated as it is, or stated as next to none. Unknown noise
should lose little to the better of the others. `--markdown` pastes the table into
docs/results/images.md.
"""

import sys
from collections import defaultdict
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
from image_quality import (
    COMPILED,
    DEFAULT,
    PACKAGES,
    PAGE,
    Image,
    car,
    drawn,
    interval,
    photographs,
)
from options import benchmark_options, finish

from reconstruction import Capture, Reconstructor, read_capture
from reconstruction.capture import first_patterns
from reconstruction.capture.importers import capture_from_readings
from reconstruction.operators import decoder_for, expose, make_plan
from spisim_paper.checks import Check, Table, surroundings

READINGS = (8, 16, 31, 64, 128, 410)
NOISES = (0.0, 0.1, 0.3, 1.0, 3.0)
"""Over the rms of the coefficients other than the level."""
NEXT_TO_NONE = 1e-4
"""The same, stated as zero."""
MAX_LOST = 0.01
REPORTED = ("unknown", "as it is", "as none")

Group = tuple[str, int, float]
Estimate = dict[Group, list[list[float]]]


def main() -> int:
    """Correlations by recordings, number of readings and noise."""
    recordings = {"nargs": "*", "default": [], "help": "folders of captures to try, too"}
    quick = "every fourth image, two numbers of readings"
    options = benchmark_options(__doc__, quick, PAGE, others={"--recordings": recordings})
    result: Estimate = defaultdict(list)
    chosen = list(cases(map(Path, options.recordings)))
    for readings in READINGS[2:4] if options.quick else READINGS:
        COMPILED.clear()
        for number, (row, capture, truth) in enumerate(chosen):
            if options.quick and number % 4:
                continue
            few = first_patterns(capture, readings)
            for noise in NOISES:
                rng = np.random.default_rng([number, readings, int(10 * noise)])
                result[row, readings, noise].append(correlations(few, truth, noise, rng))
    tables = [table(result)]
    return finish(options, PAGE, "unknown noise", surroundings(PACKAGES), tables, checks(result))


def cases(folders: Iterator[Path]) -> Iterator[tuple[str, Capture, Image]]:
    """Name of the row, a capture without a stated noise, and its true image."""
    measured = car()
    yield measured.row, measured.capture, measured.truth
    for case in [*drawn(), *photographs()]:
        row, _, weather = case.row.partition(", ")
        if weather.startswith("fga015"):
            continue  # the same scenes
        plan = make_plan(case.truth.shape, READINGS[-1], polarity="signed")
        yield row, capture_from_readings(expose(plan, case.truth), plan), case.truth
    for folder in folders:
        for file in sorted(folder.glob("*.h5")):
            capture = read_capture(file)
            whole = Reconstructor(capture.setup, image="zero-filled", ranging=(), depth=())
            yield folder.name, capture, whole(capture.frame()).image.astype(np.float64)


def correlations(capture: Capture, truth: Image, noise: float, rng: np.random.Generator) -> list:
    """Of the default image with the true one, for each of `REPORTED`."""
    buckets = capture.buckets
    decoder = decoder_for(capture.plan, buckets.usable[0])
    varying = decoder.operator.varying
    rms = np.sqrt(np.mean(decoder.decode(buckets.signal[0])[varying] ** 2))
    of_one = np.sqrt(decoder.own_variance(np.ones(capture.plan.exposures))[varying].mean())
    scale = float(rms / of_one)  # of a reading whose coefficients vary as the image's do
    counts = buckets.signal[:1] + noise * scale * rng.standard_normal(buckets.signal[:1].shape)
    result = []
    for sigma in (np.nan, max(noise, NEXT_TO_NONE) * scale, NEXT_TO_NONE * scale):
        reported = replace(
            buckets,
            counts=counts,
            saturated=buckets.saturated[:1],
            electrons_per_count=1.0 if np.isfinite(sigma) else np.nan,
            offset_counts=0.0,
            noise_electrons=sigma,
            excess_noise_factor=1e-12,  # no shot noise
            baseline_electrons=0.0,
            dead_time_s=0.0,
        )
        one = replace(capture, buckets=reported, spots=None, pattern_taps=None, truth=None)
        key = one.setup.digest(0)
        if key not in COMPILED:
            COMPILED[key] = Reconstructor(one.setup, image=DEFAULT, ranging=(), depth=())
        image = COMPILED[key](one.frame()).image.astype(np.float64)
        result.append(float(np.corrcoef(image.ravel(), truth.ravel())[0, 1]) if image.any() else 0)
    return result


def lost(each: Sequence[Sequence[float]]) -> Image:
    """What is lost, of each image, to that of the better stated noise of the group."""
    values = np.array(each)
    return values[:, 1 + int(np.argmax(values[:, 1:].mean(axis=0)))] - values[:, 0]


def table(result: Estimate) -> Table:
    """Means by group, and what is lost."""
    rows = []
    for (row, readings, noise), each in result.items():
        low, high = interval(lost(each))
        means = (f"{value:.3f}" for value in np.mean(each, axis=0))
        text = f"{lost(each).mean():+.3f} ({low:+.3f} to {high:+.3f})"
        rows.append((row, str(readings), f"{noise:g}", str(len(each)), *means, text))
    columns = ("recordings", "readings", "noise", "images", *REPORTED, "lost to the better")
    return Table("Correlation with the true image, by what is known of the noise", columns, rows)


def checks(result: Estimate) -> list[Check]:
    """What is promised."""
    of_groups = [float(lost(each).mean()) for each in result.values()]
    weak = [float(lost(each).mean()) for (_, _, noise), each in result.items() if noise <= 0.3]
    return [
        Check(
            "correlation lost where noise is unknown, mean of rows", np.mean(of_groups), MAX_LOST
        ),
        Check("the same, noise of 0.3 or less", np.mean(weak), MAX_LOST),
        Check("the same, worst row", max(of_groups), MAX_LOST),
    ]


if __name__ == "__main__":
    sys.exit(main())
