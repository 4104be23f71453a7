"""One look for all plots of the package, and figures as files."""

import io
from functools import partial
from pathlib import Path
from typing import Any, Literal

from matplotlib import rc_context
from matplotlib.figure import Figure

#: Of the four laser spots, on white; those of the pages are the same.
SPOT_COLOURS = ("#2f78b7", "#c96a15", "#2f8f62", "#8a5bb8")


#: What figures are made and saved in, `with plot_style():` or decorated; users' settings are not
#: asked.
plot_style = partial(rc_context, fname=Path(__file__).with_name("plots.mplstyle"))


def file_of(figure: Figure, kind: Literal["png", "svg"] = "png", **options: Any) -> bytes:
    """The figure as a file; equal figures give equal files. `options` are those of `savefig`."""
    buffer = io.BytesIO()
    undated = {"png": "Software", "svg": "Date"}[kind]
    figure.savefig(buffer, format=kind, metadata={undated: None}, **options)
    return buffer.getvalue()
