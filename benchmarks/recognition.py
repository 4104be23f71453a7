"""How often `--order auto` is right, and how often it says so.

    pip install 'spisim[benchmarks]'
    python benchmarks/recognition.py [--quick] [--json] [--markdown]

The true images of image_quality.py's scenes by the paper's instrument, which nothing was set on,
are shown in every known order, at four shares of the patterns. From image to image polarities take
turns, and no noise and noise of a thirtieth of the readings' spread. `--markdown` pastes the tables
into docs/results/recordings.md.
"""

import sys
from collections import defaultdict
from collections.abc import Callable, Iterable, Iterator, Sequence
from itertools import pairwise
from pathlib import Path
from typing import NamedTuple

import numpy as np
from image_quality import PACKAGES, Image, drawn
from options import benchmark_options, finish

from reconstruction.base.errors import InputError
from reconstruction.image import candidate_layouts, recognise
from reconstruction.operators import POLARITIES, expose, make_plan
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "recordings.md"
FRACTIONS = (0.03125, 0.125, 0.25, 1.0)
NOISES = {"none": 0.0, "1/30": 1 / 30}
BACKGROUND = 0.1
"""Of the brightest reading."""
SURE = 0.95
"""What is less sure than this is warned of."""
BINS = (0.0, 0.5, 0.8, SURE, 0.99, 1.0)


class Answer(NamedTuple):
    """To one recording: how sure it was, 0 where no layout was named, and whether it is right."""

    order: str
    fraction: float
    noise: str
    stated: float
    right: bool

    @property
    def reported(self) -> bool:
        """Whether a layout was named."""
        return self.stated > 0


def main() -> int:
    """Answers by sampling ratio, by order and by how sure they were."""
    options = benchmark_options(__doc__, "every eighth image", PAGE)
    images = [case.truth for case in drawn() if "paper" in case.row]
    result = list(answers(images[:: 8 if options.quick else 1]))
    tables = [
        table(result, "fraction of patterns", ("patterns, %", "noise"), by_fraction),
        table(result, "order", ("order",), lambda answer: (answer.order,)),
        calibration(result),
    ]
    return finish(options, PAGE, "benchmark", surroundings(PACKAGES), tables, checks(result))


def answers(images: Iterable[Image]) -> Iterator[Answer]:
    """Of every image in every order."""
    for number, image in enumerate(images):
        polarity = sorted(POLARITIES)[number % len(POLARITIES)]
        noise = list(NOISES)[number % len(NOISES)]
        for fraction in FRACTIONS:
            rows = round(fraction * image.size)
            for order in orders(image.shape, rows):
                yield answer(image, order, polarity, rows, noise, number)


def orders(shape: tuple[int, ...], rows: int) -> list[str]:
    """Known orders of so many rows; of those that are equal, one."""
    return [layout.order for layout in candidate_layouts((shape[0], shape[1]), rows, "signed")]


def answer(image: Image, order: str, polarity: str, rows: int, noise: str, seed: int) -> Answer:
    """What is said of one recording."""
    shape = (image.shape[0], image.shape[1])
    plan = make_plan(shape, rows, order, polarity)
    light = expose(plan, image)
    light = light + BACKGROUND * light.max() * (plan.polarity != 0)
    varying = light[plan.index != plan.patterns.dc_row]
    rng = np.random.default_rng(seed)
    readings = light + NOISES[noise] * np.std(varying) * rng.standard_normal(light.shape)
    try:
        result = recognise(readings[None], shape)
    except InputError:
        return Answer(order, rows / image.size, noise, 0.0, False)
    best = result[0].layout.plan
    right = np.array_equal(best.index, plan.index) and np.array_equal(best.polarity, plan.polarity)
    return Answer(order, rows / image.size, noise, result[0].probability, right)


Estimate = list[Answer]


def by_fraction(answer: Answer) -> tuple[str, ...]:
    """Share of patterns and noise."""
    return f"{100 * answer.fraction:.3g}", answer.noise


def table(
    result: Estimate, what: str, columns: tuple[str, ...], key: Callable[[Answer], tuple[str, ...]]
) -> Table:
    """Shares of answers, by what ``key`` says of each."""
    groups: dict[tuple[str, ...], Estimate] = defaultdict(list)
    for each in result:
        groups[key(each)].append(each)
    rows = []
    for name, group in groups.items():
        reported = [each for each in group if each.reported]
        sure = [each for each in reported if each.stated >= SURE]
        rows.append(
            (
                *name,
                str(len(group)),
                fraction_of(reported, group),
                fraction_of([each for each in reported if each.right], reported),
                f"{100 * mean([each.stated for each in reported]):.1f}",
                fraction_of(sure, group),
                fraction_of([each for each in sure if not each.right], group),
            )
        )
    titles = ("recordings", "recognised, %", "of these right, %", "stated, mean, %")
    more = (f"{100 * SURE:g} % sure, %", "sure and wrong, %")
    return Table(f"Layouts recognised, by {what}", (*columns, *titles, *more), rows)


def calibration(result: Estimate) -> Table:
    """How often answers of the same stated probability are right."""
    rows = []
    for low, high in pairwise(BINS):
        group = [a for a in result if a.reported and low <= a.stated < high + (high == 1.0)]
        rows.append(
            (
                f"{100 * low:g} to {100 * high:g}",
                str(len(group)),
                f"{100 * mean([each.stated for each in group]):.1f}",
                fraction_of([each for each in group if each.right], group),
            )
        )
    columns = ("stated, %", "recordings", "stated, mean, %", "right, %")
    return Table("How often what is stated is so", columns, rows)


def checks(result: Estimate) -> list[Check]:
    """What is promised."""
    reported = [each for each in result if each.reported]
    sure = [each for each in reported if each.stated >= SURE]
    over = mean([each.stated for each in reported]) - mean([each.right for each in reported])
    return [
        Check("right where 95 % sure or more", mean([each.right for each in sure]), SURE, True),
        Check("stated over right, of all recognised", over, 0.05),
    ]


def fraction_of(some: Estimate, of: Estimate) -> str:
    """In per cent."""
    return f"{100 * len(some) / len(of):.1f}" if of else "–"


def mean(numbers: Sequence[float]) -> float:
    """Their mean, nan where there is none."""
    return float(np.mean(numbers)) if numbers else float("nan")


if __name__ == "__main__":
    sys.exit(main())
