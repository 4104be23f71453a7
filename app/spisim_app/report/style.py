"""The common style of all plots, which are saved as files or inlined in pages as SVG."""

import io
import re
from collections.abc import Callable
from functools import partial
from pathlib import Path
from typing import Any, Literal
from xml.etree import ElementTree

from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure

from reconstruction.base.files import mark
from reconstruction.base.text import printable

#: Colours of the laser spots, also used in pages; more spots begin again with the first.
SPOT_COLOURS = (
    *("#2f78b7", "#c96a15", "#2f8f62", "#8a5bb8"),
    *("#b83b4b", "#1d8a99", "#857a1d", "#b8559a"),
)
#: Colours of curves, as in `plots.mplstyle`.
CURVE_COLOURS = ("#0072b2", "#d55e00", "#009e73", "#cc79a7", "#e69f00", "#56b4e9", "#555555")


#: Context or decorator for making and saving figures independently of user settings.
plot_style = partial(rc_context, fname=Path(__file__).with_name("plots.mplstyle"))


def file_of(
    figure: Figure, kind: str, form: Literal["png", "svg"] = "png", **options: Any
) -> bytes:
    """Return the figure as a file with its kind; equal figures give equal files.

    `options` are those of `savefig`.
    """
    buffer = io.BytesIO()
    maker = {"png": {"Software": mark(kind)}, "svg": {"Creator": mark(kind), "Date": None}}
    figure.savefig(buffer, format=form, metadata=maker[form], **options)
    return buffer.getvalue()


def spot_looks(count: int) -> list[tuple[str, str]]:
    """Return colour and label of each spot; spots of one colour share the label of the first."""
    step, looks = len(SPOT_COLOURS), []
    for k in range(count):
        more = ", …" if k + 2 * step < count else ""
        label = f"spots {k}, {k + step}{more}" if k + step < count else f"spot {k}"
        looks.append((SPOT_COLOURS[k % step], label if k < step else ""))
    return looks


def drawn(words: str) -> str:
    """Escape untrusted text for a figure: no formulas, no missing glyphs."""
    return printable(words).replace("$", r"\$").replace("\t", " ")


#: Widths in inches; the page displays the one that fits, with the same font size.
WIDE_IN, NARROW_IN = 8.6, 3.7

#: Colours of plots and their replacements in pages.
VARIABLES = {
    "#20262c": "--ink",
    "#404040": "--ink",
    "#4c4c4c": "--quiet",
    "#5a646e": "--quiet",
    "#808080": "--quiet",
    "#b0b0b0": "--quiet",
    "#cccccc": "--line",
    "#e5e5e5": "--line",
    "#ffffff": "--panel",
    **{colour: f"--spot-{number}" for number, colour in enumerate(SPOT_COLOURS)},
    **{colour: f"--curve-{number}" for number, colour in enumerate(CURVE_COLOURS)},
}
_SVG = "{http://www.w3.org/2000/svg}"
_LINK = "{http://www.w3.org/1999/xlink}href"


def plot_in_page(name: str, draw: Callable[[float], Figure | None]) -> Markup | None:
    """Draw a plot for wide and for narrow windows; None if there is nothing to draw.

    `draw` is called with the width in inches. `name`, of letters and digits, must be unique in the
    page.
    """
    drawn = []
    for width_in, kind in ((WIDE_IN, "wide"), (NARROW_IN, "narrow")):
        figure = draw(width_in)
        if figure is None:
            return None
        drawn.append(_svg(figure, f"{name}-{kind}-", f"for-{kind}"))
    return Markup("").join(drawn)


def _svg(figure: Figure, prefix: str, look: str) -> Markup:
    """Return inline SVG with all text escaped."""
    buffer = io.BytesIO()
    unset = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with rc_context({"svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata=unset, transparent=True)
    root = ElementTree.fromstring(buffer.getvalue())
    for element in root.iter():
        element.tag = element.tag.removeprefix(_SVG)
        _name_apart(element, prefix)
        if style := element.get("style"):
            element.set("style", _coloured(style))
    for size in ("width", "height", "version"):
        root.attrib.pop(size, None)
    root.set("class", look)
    root.set("role", "img")
    return Markup(ElementTree.tostring(root, encoding="unicode", method="html"))


def _name_apart(element: ElementTree.Element, prefix: str) -> None:
    """Make identifiers within the plot unique in the page."""
    if name := element.get("id"):
        element.set("id", prefix + name)
    if link := element.attrib.pop(_LINK, None):
        element.set("href", f"#{prefix}{link[1:]}")
    if clip := element.get("clip-path"):
        element.set("clip-path", clip.replace("url(#", f"url(#{prefix}"))


def _coloured(style: str) -> str:
    """Replace colours and fonts by those of the page."""
    style = re.sub(r"font: *([\d.]+px)[^;]*", r"font-size: \1", style)
    return re.sub(
        r"#[0-9a-f]{6}",
        lambda result: f"var({VARIABLES[result[0]]})" if result[0] in VARIABLES else result[0],
        style,
    )
