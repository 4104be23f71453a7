"""One look for all plots of the package, and figures as files."""

import io
from functools import partial
from pathlib import Path
from typing import Any, Literal

from matplotlib import rc_context
from matplotlib.figure import Figure

from reconstruction.base.files import mark
from reconstruction.base.text import printable

#: Of the four laser spots, on white; those of the pages are the same.
SPOT_COLOURS = ("#2f78b7", "#c96a15", "#2f8f62", "#8a5bb8")
#: Of curves, in turn, as in `plots.mplstyle`.
CURVE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555")


#: What figures are made and saved in, `with plot_style():` or decorated; users' settings are not
#: asked.
plot_style = partial(rc_context, fname=Path(__file__).with_name("plots.mplstyle"))


def file_of(
    figure: Figure, kind: str, form: Literal["png", "svg"] = "png", **options: Any
) -> bytes:
    """The figure as a file that tells its kind; equal figures give equal files.

    `options` are those of `savefig`.
    """
    buffer = io.BytesIO()
    maker = {"png": {"Software": mark(kind)}, "svg": {"Creator": mark(kind), "Date": None}}
    figure.savefig(buffer, format=form, metadata=maker[form], **options)
    return buffer.getvalue()


def drawn(words: str) -> str:
    """Words of strangers for a figure: no formula, and no characters that fonts do not have."""
    return printable(words).replace("$", r"\$").replace("\t", " ")
