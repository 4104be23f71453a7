"""Pages from templates, and numbers as people read them."""

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

from .maps import packed
from .units import engineering

#: What moves in pages, in this order.
SCRIPTS = ("pictures", "cloud", "explore", "sequences")


def write_page(path: str | Path, kind: str, template: str, **content: Any) -> None:
    """Write a page that needs no other file; all of its content is escaped.

    `kind` is what its mark tells. Raises OSError where the file cannot be written.
    """
    own = {"mark": mark(kind), "script": page_script()}
    page = _templates().get_template(f"{template}.html").render(content | own)
    write_atomically(path, page.encode())


@dataclass(frozen=True)
class Script:
    """What a page runs, and the digest by which it runs nothing else."""

    text: Markup
    digest: str


@cache
def page_script() -> Script:
    """The one script of all pages; parts find out by themselves whether they have a place."""
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
        finalize=_displayed,
    )
    templates.filters |= {
        "number": number,
        "metres": length,
        "distance": distance,
        "electrons": partial(engineering, unit="e⁻"),
        "plain": plain,
        "capital": capital,
        "packed": packed,
    }
    return templates


def _displayed(value: Any) -> Any:
    """What a page says, without control characters; what is escaped already is of this kind too."""
    return Markup(printable(value)) if isinstance(value, Markup) else printable(str(value))


def capital(words: str) -> str:
    """With a capital letter in front; the others stay as they are."""
    return words[:1].upper() + words[1:]


def number(value: float | None, digits: int) -> str:
    """With so many decimal places; a dash where there is none."""
    return "–" if value is None or not np.isfinite(value) else f"{value:,.{digits}f}"


def plain(value: object) -> str:
    """Whatever a file may tell, in few characters; a dash for nothing."""
    if value is None:
        return "–"
    if isinstance(value, float):
        return f"{value:.4g}"
    if isinstance(value, list | tuple):
        return ", ".join(map(plain, value))
    return str(value)


def length(metres: float | None) -> str:
    """In the unit that suits it; a dash where there is none."""
    if metres is None or not np.isfinite(metres):
        return "–"
    if 0.01 <= abs(metres) < 1:
        return f"{100 * metres:.1f} cm".replace("-", "−")
    return engineering(metres, "m")


def distance(metres: float | None) -> str:
    """In metres to the millimetre; a dash where there is none."""
    return "–" if metres is None or not np.isfinite(metres) else f"{metres:,.3f} m"


def duration(seconds: float) -> str:
    """A time in the unit that suits it."""
    if not np.isfinite(seconds):
        return "not known"
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")):
        if round(seconds * factor, 6) >= 1:
            return f"{seconds * factor:.4g} {unit}"
    return f"{seconds * 1e12:.4g} ps"
