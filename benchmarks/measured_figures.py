"""What a set of measurements is, and what a comparison with it gives; `measured.py` runs them all.

A module `measured_NAME.py` beside this one lists its sets as `SETS`.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass
from pathlib import Path

from matplotlib.figure import Figure

from spisim_paper.checks import Check, Table


@dataclass(frozen=True, eq=False)
class Comparison:
    """What a set of measurements says of the simulator or the reconstruction.

    Parameters
    ----------
    compared : str
        What is compared with what, one or two sentences.
    checks : sequence of Check
        The promised figures, with intervals where they are sampled.
    tables : sequence of Table
        Further figures and explanations; a table without columns is a paragraph.
    picture : matplotlib Figure, optional
        Made without pyplot, or closed there; `measured.py` saves it.
    """

    compared: str
    checks: Sequence[Check]
    tables: Sequence[Table] = ()
    picture: Figure | None = None


@dataclass(frozen=True, eq=False)
class MeasuredSet:
    """A set of measurements and the comparison that is made with it.

    Parameters
    ----------
    folder : str
        Name of the set's folder among the data, as in `measured.sha256`.
    source : str
        Where it comes from, with commit or version, and its licence; Markdown.
    compare : callable
        From the set's folder and whether to be quick (all within a minute) to the comparison.
        It reads every file that it finds there of the set's kind, however many; InputError for
        files that it cannot read.
    shipped : Path, optional
        A copy in the repository, used when the data lack the set.
    """

    folder: str
    source: str
    compare: Callable[[Path, bool], Comparison]
    shipped: Path | None = None
