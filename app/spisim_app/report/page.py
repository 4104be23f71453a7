"""Pages from templates, and numbers as text."""

from base64 import b64encode
from dataclasses import dataclass
from functools import cache, partial
from hashlib import sha256
from pathlib import Path
from typing import Any

import numpy as np
from jinja2 import Environment, PackageLoader, StrictUndefined
from markupsafe import Markup

from reconstruction.base.files import mark, write_atomically
from reconstruction.base.text import printable

from .pictures import packed
from .style import SPOT_COLOURS
from .units import engineering

#: Scripts of the pages, in this order.
SCRIPTS = ("pictures", "cloud", "explore", "sequences")


def write_page(path: str | Path, kind: str, template: str, **content: Any) -> None:
    """Write a page that needs no other file; all of its content is escaped.

    `kind` is stored in its mark. Raises OSError if the file cannot be written.
    """
    own = {"mark": mark(kind), "script": page_script()}
    page = _templates().get_template(f"{template}.html").render(content | own)
    write_atomically(path, page.encode())


@dataclass(frozen=True)
class Script:
    """The script of a page, and the digest that allows no other to run."""

    text: Markup
    digest: str


@cache
def page_script() -> Script:
    """Return the single script of all pages, whose parts detect whether they apply."""
    folder = Path(__file__).with_name("scripts")
    parts = [(folder / f"{name}.js").read_text(encoding="utf-8") for name in SCRIPTS]
    text = "(() => {\n" + "\n".join(parts) + "})();"
    return Script(Markup(text), f"sha256-{b64encode(sha256(text.encode()).digest()).decode()}")


@cache
def _templates() -> Environment:
    templates = Environment(
        loader=PackageLoader(__package__),
        autoescape=True,
        undefined=StrictUndefined,
        trim_blocks=True,
        lstrip_blocks=True,
        finalize=_plain_text,
    )
    templates.filters |= {
        "number": number,
        "metres": length,
        "distance": distance,
        "electrons": partial(engineering, unit="e⁻"),
        "plain": plain,
        "capital": capital,
        "packed": packed,
        "spot_colour": lambda number: f"var(--spot-{number % len(SPOT_COLOURS)})",
    }
    return templates


def _plain_text(value: Any) -> Any:
    """Remove control characters from text; escaped text stays escaped."""
    return Markup(printable(value)) if isinstance(value, Markup) else printable(str(value))


def capital(words: str) -> str:
    """Capitalize the first letter only."""
    return words[:1].upper() + words[1:]


def number(value: float | None, digits: int) -> str:
    """Format with this many decimal places; a dash for None."""
    return "–" if value is None or not np.isfinite(value) else f"{value:,.{digits}f}"


def plain(value: object) -> str:
    """Format any value of a file briefly; a dash for None."""
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(plain, value))
    return str(value)


def length(metres: float | None) -> str:
    """Format a length in a suitable unit; a dash for None."""
    if metres is None or not np.isfinite(metres):
        return "–"
    if 0.01 <= abs(metres) < 1:
        return f"{100 * metres:.1f} cm".replace("-", "−")
    return engineering(metres, "m")


def distance(metres: float | None) -> str:
    """Format metres to the millimetre; a dash for None."""
    return "–" if metres is None or not np.isfinite(metres) else f"{metres:,.3f} m"


def duration(seconds: float) -> str:
    """Format a time in a suitable unit."""
    if not np.isfinite(seconds):
        return "unknown"
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")):
        if round(seconds * factor, 6) >= 1:
            return f"{seconds * factor:.4g} {unit}"
    return f"{seconds * 1e12:.4g} ps"
