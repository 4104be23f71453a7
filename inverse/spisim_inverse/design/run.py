"""A design from its plan to the chosen instrument."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass
from functools import partial
from pathlib import Path
from typing import Any

import numpy as np

from reconstruction.base.errors import InputError, naming
from reconstruction.base.files import mark, write_atomically
from reconstruction.base.folders import locked_folder
from spisim.instrument import Instrument
from spisim_inverse.design.archive import Archive, Evaluation
from spisim_inverse.design.bench import Bench
from spisim_inverse.design.judgement import Compared, judge
from spisim_inverse.design.measuring import Measuring
from spisim_inverse.design.plan import PlannedDesign
from spisim_inverse.design.search import Search, front, score
from spisim_inverse.design.space import Space

KIND = "design"
FINALISTS = 4
"""Best instruments that are measured once more, with other noise, before one is chosen, and most
of the front that are judged.
"""
JUDGED_DRAWS = 3
"""Frames of a scene for base and chosen instrument in the judgement, for each of the search."""
PLAN, INSTRUMENT, PAGE = "plan.yaml", "instrument.yaml", "design.html"
Progress = Callable[[str, float], None]


@dataclass(frozen=True, eq=False)
class Design:
    """A finished search.

    ``base`` and ``chosen`` are figures with the noise of the confirmation, on the scenes of the
    search; ``judged`` are those on scenes that it has not seen, also of the ``front``.
    """

    planned: PlannedDesign
    base: Evaluation
    chosen: Evaluation
    evaluations: Sequence[Evaluation]
    front: Sequence[Evaluation]
    front_judged: Sequence[Mapping[str, float]]
    base_judged: Mapping[str, float]
    judged: Sequence[Compared]
    instrument: Instrument
    changed: Mapping[str, tuple[Any, Any]]

    def summary(self) -> dict[str, Any]:
        """Plain values, ready for JSON."""
        return {
            "design": self.planned.plan.name,
            "evaluations": len(self.evaluations),
            "chosen": dict(self.chosen.values),
            "search": {"base": self.base.figures, "chosen": self.chosen.figures},
            "front": [
                {"values": each.values, "search": each.figures, "judgement": judged}
                for each, judged in zip(self.front, self.front_judged, strict=True)
            ],
            "judgement": [each.summary() for each in self.judged],
        }


def run_design(
    planned: PlannedDesign, folder: Path, progress: Progress = lambda stage, fraction: None
) -> Design:
    """Search, choose, judge, and write the chosen instrument.

    The folder keeps light and evaluations, so that an interrupted run goes on where it was.

    Parameters
    ----------
    planned
        The plan.
    folder
        Where everything is kept.
    progress
        Called with the stage, "tracing", "searching" or "judging", and its finished fraction.

    Raises
    ------
    InputError
        If the plan's names, scenes or limits do not suit its base, if no instrument is possible, if
        an objective does not depend on a parameter, or if the folder holds another design.
    """
    bench = Bench(planned.instrument, planned.plan.max_aperture_mm)
    seen, unseen = (Measuring(planned, folder, part) for part in ("search", "judgement"))
    with naming(planned.path):
        check_names(planned, bench)
    with locked_folder(folder):
        archive = Archive(folder, planned)
        with naming(planned.path):
            evaluations = _searched(planned, bench, seen, archive, progress)
        base, chosen = _confirmed(planned, bench, seen, evaluations)
        result = _judged(planned, unseen, bench, (base, chosen), evaluations, progress)
        _write(folder, result)
        return result


def check_names(planned: PlannedDesign, bench: Bench) -> None:
    """Raise InputError for an unknown parameter, or an unknown field in a bundle."""
    for name, allowed in planned.plan.choose.items():
        values = allowed.values or ()
        paths = [name]
        if bench.is_bundle(name) and values and all(isinstance(v, Mapping) for v in values):
            paths = [path for value in values for path in value]
        for path in paths:
            with naming("choose"):
                bench.check_name(path)


def _searched(
    planned: PlannedDesign, bench: Bench, seen: Measuring, archive: Archive, progress: Progress
) -> list[Evaluation]:
    """All instruments of the search, the base first."""
    plan, space = planned.plan, Space(planned.plan.choose)

    def evaluate(values: Mapping[str, Any], traced: Callable[[float], None] = _quiet) -> Evaluation:
        kept = archive.get(values)
        if kept is None:
            kept = _evaluated(bench, seen, plan.draws, values, traced)
            if not values and kept.figures is None:
                raise InputError(f"the base: {kept.reason}")
            archive.add(kept)
        return kept

    base = evaluate({}, partial(progress, "tracing"))
    assert base.figures is not None
    search = Search(
        space,
        plan.objectives,
        base.figures,
        evaluate,
        plan.evaluations,
        plan.seed,
        plan.at_most,
        partial(progress, "searching"),
    )
    return [base, *search.run(space.of_base(bench))]


def _evaluated(
    bench: Bench,
    seen: Measuring,
    draws: int,
    values: Mapping[str, Any],
    traced: Callable[[float], None],
) -> Evaluation:
    try:
        return seen.evaluation(values, seen.samples(bench.make(values), "search", draws, traced))
    except InputError as error:
        return Evaluation(dict(values), None, reason=str(error))


def _confirmed(
    planned: PlannedDesign, bench: Bench, seen: Measuring, evaluations: Sequence[Evaluation]
) -> tuple[Evaluation, Evaluation]:
    """The base and the best instrument, measured with other noise than that of the search."""
    plan = planned.plan
    weights = np.ones(len(plan.objectives))

    def ranked(some: Sequence[Evaluation], base: Evaluation) -> list[Evaluation]:
        figures = base.figures
        assert figures is not None
        return sorted(
            some, key=lambda each: score(each, figures, weights, plan.objectives, plan.at_most)
        )

    first, *others = evaluations
    again = [
        seen.evaluation(
            each.values, seen.samples(bench.make(each.values), "confirmation", plan.draws, _quiet)
        )
        for each in [first, *ranked(others, first)[:FINALISTS]]
    ]
    return again[0], ranked(again, again[0])[0]


def _judged(
    planned: PlannedDesign,
    unseen: Measuring,
    bench: Bench,
    confirmed: tuple[Evaluation, Evaluation],
    evaluations: Sequence[Evaluation],
    progress: Progress,
) -> Design:
    """The design with its figures on unseen scenes."""
    objectives, draws = planned.plan.objectives, planned.plan.draws
    base, chosen = confirmed
    whole = front(evaluations, objectives)
    best = [whole[n] for n in np.unique(np.linspace(0, len(whole) - 1, FINALISTS).astype(int))]
    wanted = [base, chosen, *best]
    times = [JUDGED_DRAWS, JUDGED_DRAWS, *(1 for _ in best)]
    samples = []
    for number, (each, more) in enumerate(zip(wanted, times, strict=True)):

        def part(fraction: float, number: int = number) -> None:
            progress("judging", (number + fraction) / len(wanted))

        samples.append(unseen.samples(bench.make(each.values), "judgement", more * draws, part))
    figures = [
        unseen.evaluation(each.values, one).figures or {}
        for each, one in zip(wanted, samples, strict=True)
    ]
    return Design(
        planned,
        base,
        chosen,
        evaluations,
        best,
        figures[2:],
        figures[0],
        judge(samples[0], samples[1], objectives),
        bench.make(chosen.values),
        {name: (bench.start(name), value) for name, value in chosen.values.items()},
    )


def _write(folder: Path, result: Design) -> None:
    planned = result.planned
    plan, comment = planned.text, f"# {mark(KIND)}\n"
    chosen = f"chosen among {len(result.evaluations)} instruments"
    own = folder / PLAN
    if not (own.exists() and own.samefile(planned.path)):
        write_atomically(own, (plan if comment in plan else comment + plan).encode())
    text = f"{comment}# {planned.plan.name}: {chosen}\n{result.instrument.text}"
    write_atomically(folder / INSTRUMENT, text.encode())


def _quiet(fraction: float) -> None:
    return None
