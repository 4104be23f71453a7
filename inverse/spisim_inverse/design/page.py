"""The page of a design."""

from collections.abc import Mapping
from pathlib import Path
from typing import Any

import numpy as np

from spisim.version import __version__
from spisim_app.report.page import plain, write_page
from spisim_app.report.style import plot_in_page, plot_style
from spisim_app.report.units import engineering
from spisim_inverse.design.bench import TIMES
from spisim_inverse.design.judgement import Compared
from spisim_inverse.design.objectives import OBJECTIVES
from spisim_inverse.design.plots import front_figure, judgement_figure, search_figure
from spisim_inverse.design.run import KIND, Design


@plot_style()
def write_design(path: Path, design: Design) -> None:
    """Write the page; raises OSError if the file cannot be written."""
    plan = design.planned.plan
    write_page(
        path,
        KIND,
        "design",
        title=plan.name,
        lead=plan.description or f"The instrument that measures best of {len(design.evaluations)}.",
        cards=_cards(design),
        changed=[
            (name, plain(_rounded(before)), plain(_rounded(_over_sum(name, after))))
            for name, (before, after) in design.changed.items()
        ],
        search=[
            (OBJECTIVES[name].title, *_both(name, design, "search")) for name in plan.objectives
        ],
        judged=[_row(each) for each in design.judged],
        plots={
            "search": plot_in_page("search", lambda width: search_figure(design, width)),
            "front": plot_in_page("front", lambda width: front_figure(design, width)),
            "judgement": plot_in_page("judgement", lambda width: judgement_figure(design, width)),
        },
        objectives=[OBJECTIVES[name].title for name in plan.objectives],
        front=[_front_row(design, number) for number in range(len(design.front))],
        worlds={
            "search": ", ".join(source.world for source in plan.search),
            "judgement": ", ".join(source.world for source in plan.judgement),
        },
        evaluations=len(design.evaluations),
        plan=design.planned.text,
        version=__version__,
    )


def in_words(design: Design) -> list[str]:
    """The result in sentences."""
    if not design.chosen.values:
        return ["No instrument of the search is better than its base."]
    lines = []
    for name in design.planned.plan.objectives:
        title = OBJECTIVES[name].title
        for each in design.judged:
            if each.name == title:
                low, high = each.interval()
                lines.append(
                    f"{each.weather}: {title.split(',')[0]} {_value(each.base, each.unit)} "
                    f"with the base, {_value(each.chosen, each.unit)} with the chosen instrument, "
                    f"{each.change:.2f} times ({low:.2f} to {high:.2f})"
                )
    return ["On scenes that the search has not seen:", *lines]


def _cards(design: Design) -> list[tuple[str, str, str]]:
    cards = []
    for name in design.planned.plan.objectives:
        _, _, seen = _both(name, design, "search")
        title = OBJECTIVES[name].title.split(",")[0]
        figures = [each for each in design.judged if each.name == OBJECTIVES[name].title]
        unseen = float(np.exp(np.mean(np.log([each.change for each in figures]))))
        cards.append((f"{unseen:.2f} ×", title, f"of the base, unseen scenes; {seen} in search"))
    return [*cards, (str(len(design.evaluations)), "instruments", "simulated by the search")]


def _both(name: str, design: Design, part: str) -> tuple[str, str, str]:
    base, chosen = design.base.figures, design.chosen.figures
    assert base is not None
    assert chosen is not None
    unit = OBJECTIVES[name].unit
    before, after = base[name], chosen[name]
    return _value(before, unit), _value(after, unit), f"{after / before:.2f}"


def _row(each: Compared) -> tuple[str, str, str, str, str]:
    (low, high), digits = each.interval(), "+.1f" if each.is_fraction else ".2f"
    change = f"{each.change:{digits}} ({low:{digits}} to {high:{digits}})"
    verdict = {True: "better", False: "worse", None: ""}[each.better]
    values = _value(each.base, each.unit), _value(each.chosen, each.unit)
    return (f"{each.weather}: {each.name}", *values, change, verdict)


def _front_row(design: Design, number: int) -> list[str]:
    seen, unseen = design.front[number], design.front_judged[number]
    assert seen.figures is not None
    values = "; ".join(
        f"{name} {plain(_rounded(_over_sum(name, value)))}" for name, value in seen.values.items()
    )
    cells = [values or "the base"]
    for name in design.planned.plan.objectives:
        unit = OBJECTIVES[name].unit
        cells += [_value(seen.figures[name], unit), _value(unseen[name], unit)]
    return cells


def _over_sum(name: str, value: Any) -> Any:
    """Relative times as fractions of their sum."""
    return [each / sum(value) for each in value] if name == TIMES else value


def _value(value: float, unit: str) -> str:
    text = engineering(value, unit) if unit and unit != "%" else f"{value:.3g} {unit}"
    return text.strip().replace(" ", "\N{NO-BREAK SPACE}")


def _rounded(value: Any) -> Any:
    """Numbers with few digits, within lists and mappings."""
    if isinstance(value, Mapping):
        return ", ".join(f"{name} {plain(_rounded(part))}" for name, part in value.items())
    if isinstance(value, list | tuple):
        return [_rounded(part) for part in value]
    return float(f"{value:.3g}") if isinstance(value, float) else value
