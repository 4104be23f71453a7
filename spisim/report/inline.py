"""Plots as part of a page: words that stay words, in its fonts, its colours by day and by night."""

import io
import re
from collections.abc import Callable
from xml.etree import ElementTree

from markupsafe import Markup
from matplotlib import rc_context
from matplotlib.figure import Figure

from .style import CURVE_COLOURS, SPOT_COLOURS

#: Widths in inches of which a page shows the one that it has room for; letters keep their size.
WIDE_IN, NARROW_IN = 8.6, 3.7

#: Colours of plots, and what stands for them in pages.
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
    """A plot, drawn for wide and for narrow windows; None where there is nothing to draw.

    `draw` is given the width in inches. `name`, of letters and digits, is unlike those of other
    plots of the page.
    """
    drawn = []
    for width_in, kind in ((WIDE_IN, "wide"), (NARROW_IN, "narrow")):
        figure = draw(width_in)
        if figure is None:
            return None
        drawn.append(_svg(figure, f"{name}-{kind}-", f"for-{kind}"))
    return Markup("").join(drawn)


def _svg(figure: Figure, prefix: str, look: str) -> Markup:
    """SVG to stand in HTML; all words are escaped."""
    buffer = io.BytesIO()
    no_return = dict.fromkeys(("Creator", "Date", "Format", "Type"))
    with rc_context({"svg.fonttype": "none"}):
        figure.savefig(buffer, format="svg", metadata=no_return, transparent=True)
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
    """Names within the plot that no other plot of the page has."""
    if name := element.get("id"):
        element.set("id", prefix + name)
    if link := element.attrib.pop(_LINK, None):
        element.set("href", f"#{prefix}{link[1:]}")
    if clip := element.get("clip-path"):
        element.set("clip-path", clip.replace("url(#", f"url(#{prefix}"))


def _coloured(style: str) -> str:
    """Colours that the page decides on, and letters of its own."""
    style = re.sub(r"font: *([\d.]+px)[^;]*", r"font-size: \1", style)
    return re.sub(
        r"#[0-9a-f]{6}",
        lambda result: f"var({VARIABLES[result[0]]})" if result[0] in VARIABLES else result[0],
        style,
    )
