"""What each of the paper's results becomes."""

from collections.abc import Sequence
from dataclasses import dataclass

from matplotlib.figure import Figure

from spisim.budget.paper.checks import Check, Table

#: Reflectances of the targets, and the colours that they have in all figures.
REFLECTANCES = (0.2, 0.5, 0.8)
COLOURS = ("#1f5f8b", "#d1762c", "#3f8f4f")


@dataclass(frozen=True, eq=False)
class Result:
    """Tables, with sentences about them among them, what is promised, and the figure."""

    tables: Sequence[Table]
    checks: Sequence[Check]
    figure: Figure


def percent(deviation: float) -> str:
    """A deviation with its sign."""
    return f"{100 * deviation:+.0f} %"
