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
from spisim.base.config.distributions import stream
from spisim.instrument import Instrument
from spisim_inverse.design.archive import FILE, Archive, Evaluation
from spisim_inverse.design.bench import Bench
from spisim_inverse.design.cases import Part, make_cases
from spisim_inverse.design.judgement import Compared, judge
from spisim_inverse.design.light import TracedLight
from spisim_inverse.design.objectives import OBJECTIVES, figure, over_weathers
from spisim_inverse.design.plan import PlannedDesign
from spisim_inverse.design.sampling import BOUNDS, RANGES, Sample, has_bounds, sample
from spisim_inverse.design.search import Search, front, relative_logs
from spisim_inverse.design.space import Space

KIND = "design"
FINALISTS = 6
"""Best instruments that are measured once more, with other noise, before one is chosen."""
JUDGED_DRAWS = 2
"""Frames of a scene of the judgement for each of the search."""
PLAN, INSTRUMENT, PAGE, LIGHT = "plan.yaml", "instrument.yaml", "design.html", "light"
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


class Measuring:
    """Figures of instruments on the scenes of a part, whose light is traced when needed."""

    def __init__(self, planned: PlannedDesign, folder: Path, part: Part) -> None:
        plan = planned.plan
        self._plan, self._part = plan, part
        with naming(planned.path):
            self._max_range_m = plan.max_range_m or (
                planned.instrument.ranging.tof.unambiguous_range_m
                if planned.instrument.ranges
                else np.inf
            )
        seed = int(stream(plan.seed, part, "light").integers(2**31))
        self._light = TracedLight(make_cases(planned, part), folder / LIGHT, plan.spp, seed)
        self._wanted = {OBJECTIVES[name].samples for name in plan.objectives}

    def samples(
        self, instrument: Instrument, noise: str, draws: int, progress: Callable[[float], None]
    ) -> list[Sample]:
        """Samples of all cases; instruments have equal noise if it has the same name.

        In the judgement, errors of ranges come with their bounds, where there are any.
        """
        lit = self._light.of(instrument, progress)
        wanted = set(self._wanted)
        if self._part == "judgement" and RANGES in wanted:
            wanted |= (
                {BOUNDS} if has_bounds(instrument, (each.case.scene for each in lit)) else set()
            )
        return sample(
            instrument,
            lit,
            wanted,
            max_range_m=self._max_range_m,
            draws=draws,
            seed=int(stream(self._plan.seed, self._part, noise).integers(2**31)),
        )

    def evaluation(self, values: Mapping[str, Any], samples: Sequence[Sample]) -> Evaluation:
        """Figures of samples, which are all defined; InputError if one is not."""
        weathers = {name: over_weathers(name, samples) for name in self._plan.objectives}
        for name, each in weathers.items():
            for weather, value in each.items():
                if not value > 0 or not np.isfinite(value):
                    raise InputError(
                        f"{name} is {value:g} in {weather}: no spot within "
                        f"{self._max_range_m:g} m, or no light"
                    )
        return Evaluation(
            dict(values), {name: figure(each) for name, each in weathers.items()}, weathers
        )


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
    plan = planned.plan
    bench = Bench(planned.instrument, plan.max_aperture_mm)
    space = Space(plan.choose)
    with naming(planned.path):
        check_names(planned, bench)
    with locked_folder(folder):
        archive = Archive(folder, planned)
        seen = Measuring(planned, folder, "search")
        evaluate = partial(_evaluated, bench, seen, archive, plan.draws)
        base = evaluate({}, partial(progress, "tracing"))
        if base.figures is None:
            raise InputError(f"{planned.path}: the base: {base.reason}")
        search = Search(
            space,
            plan.objectives,
            base.figures,
            evaluate,
            plan.evaluations,
            plan.seed,
            partial(progress, "searching"),
        )
        with naming(planned.path):
            evaluations = [base, *search.run(space.of_base(bench))]
        best = front(evaluations, plan.objectives)
        finalists = _finalists(evaluations, base, plan.objectives)
        confirmed = [
            seen.evaluation(
                each.values,
                seen.samples(bench.make(each.values), "confirmation", 2 * plan.draws, _quiet),
            )
            for each in [base, *finalists]
        ]
        chosen = _best(confirmed, confirmed[0], plan.objectives)
        result = _judged(
            planned, folder, bench, (confirmed[0], chosen, evaluations, best), progress
        )
        _write(folder, result)
        return result


def check_names(planned: PlannedDesign, bench: Bench) -> None:
    """Raise InputError for an unknown parameter, or one that is a bundle without fields."""
    for name, choice in planned.plan.choose.items():
        bundled = choice.values is not None and all(isinstance(v, Mapping) for v in choice.values)
        paths = [name]
        if bundled and "." not in name and name not in type(bench.base).model_fields:
            assert choice.values is not None
            paths = [path for value in choice.values for path in value]
        for path in paths:
            with naming("choose"):
                bench.check_name(path)


def _quiet(fraction: float) -> None:
    return None


def _evaluated(
    bench: Bench,
    seen: Measuring,
    archive: Archive,
    draws: int,
    values: Mapping[str, Any],
    progress: Callable[[float], None] = _quiet,
) -> Evaluation:
    """An evaluation, from the archive if it is there."""
    kept = archive.get(values)
    if kept is not None:
        return kept
    try:
        instrument = bench.make(values)
        evaluation = seen.evaluation(values, seen.samples(instrument, "search", draws, progress))
    except InputError as error:
        evaluation = Evaluation(dict(values), None, reason=str(error))
    archive.add(evaluation)
    return evaluation


def _finalists(
    evaluations: Sequence[Evaluation], base: Evaluation, objectives: Sequence[str]
) -> list[Evaluation]:
    assert base.figures is not None
    figures = base.figures
    ranked = sorted(evaluations, key=lambda each: relative_logs(each, figures, objectives).sum())
    return [each for each in ranked if each.values][:FINALISTS]


def _best(
    evaluations: Sequence[Evaluation], base: Evaluation, objectives: Sequence[str]
) -> Evaluation:
    assert base.figures is not None
    figures = base.figures
    return min(evaluations, key=lambda each: relative_logs(each, figures, objectives).sum())


def _judged(
    planned: PlannedDesign,
    folder: Path,
    bench: Bench,
    searched: tuple[Evaluation, Evaluation, Sequence[Evaluation], Sequence[Evaluation]],
    progress: Progress,
) -> Design:
    """The design with its figures on unseen scenes."""
    base, chosen, evaluations, best = searched
    unseen, draws = Measuring(planned, folder, "judgement"), JUDGED_DRAWS * planned.plan.draws
    best = [best[n] for n in np.unique(np.linspace(0, len(best) - 1, FINALISTS).astype(int))]
    wanted = [base, chosen, *best]
    samples = []
    for number, each in enumerate(wanted):

        def part(fraction: float, number: int = number) -> None:
            progress("judging", (number + fraction) / len(wanted))

        samples.append(unseen.samples(bench.make(each.values), "judgement", draws, part))
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
        judge(samples[0], samples[1], planned.plan.objectives),
        bench.make(chosen.values),
        {name: (bench.start(name), value) for name, value in chosen.values.items()},
    )


def _write(folder: Path, result: Design) -> None:
    planned = result.planned
    plan, comment = planned.text, f"# {mark(KIND)}\n"
    heading = (
        f"{comment}# {planned.plan.name}: chosen among {len(result.evaluations)} instruments\n"
    )
    own = folder / PLAN
    if not (own.exists() and own.samefile(planned.path)):
        write_atomically(own, (plan if comment in plan else comment + plan).encode())
    write_atomically(folder / INSTRUMENT, (heading + result.instrument.text).encode())


def outputs_of(folder: Path) -> list[Path]:
    """Files that a design writes into its folder."""
    return [folder / name for name in (PLAN, FILE, INSTRUMENT, PAGE)]
