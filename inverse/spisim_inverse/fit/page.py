"""The page of a fit."""

from pathlib import Path

import numpy as np

from spisim_app.report.page import write_page
from spisim_app.report.style import plot_in_page, plot_style
from spisim_compare.comparison import probability
from spisim_compare.page import z_figure
from spisim_inverse.fit.result import Fitted, factors_of_patterns, in_words

MAX_CORRELATED = 12
"""Maximum number of parameters whose correlations are printed."""


@plot_style()
def write_fit(path: Path, kind: str, title: str, fitted: Fitted) -> None:
    """Write the page; raises OSError if the file cannot be written."""
    model = fitted.model
    readings = model.views[0].readings
    factors = factors_of_patterns(fitted)
    few = [number for number, each in enumerate(fitted.estimates) if each not in factors]
    names = [fitted.estimates[number].name for number in few]
    correlation = fitted.correlation[np.ix_(few, few)].tolist()
    write_page(
        path,
        kind,
        "fit",
        title=title,
        lead=in_words(fitted)[-1 if fitted.fits else -2],
        warnings=fitted.warnings,
        cards=_cards(fitted),
        estimates=[fitted.estimates[number] for number in few],
        factors="\n".join(f"{each.name} {each.value:.4f} ± {each.sigma:.2g}" for each in factors),
        priors=fitted.priors,
        names=names,
        correlation=correlation if len(few) <= MAX_CORRELATED else [],
        plot=plot_in_page(
            "readings",
            lambda width_in: z_figure(
                {"fitted": fitted.z}, model.group[model.usable], model.groups[0], width_in
            ),
        ),
        groups=fitted.groups,
        worst=fitted.worst,
        probability=probability,
        facts={
            "frames": str(sum(int(np.max(each.readings.frames)) for each in model.views)),
            "light paths per pixel": str(fitted.spp),
            "condition number": f"{fitted.information.condition:.3g}",
            "least determined": fitted.information.weakest,
            **readings.capture.setup.facts,
        },
    )


def _cards(fitted: Fitted) -> list[tuple[str, str, str]]:
    per_reading = fitted.chi_squared / fitted.freedom
    return [
        (f"{per_reading:.2f}", "χ² per degree of freedom", f"{fitted.freedom} degrees"),
        (probability(fitted.probability), "probability", "of so large a χ² if the model is right"),
        (str(len(fitted.estimates)), "parameters", "fitted"),
    ]
