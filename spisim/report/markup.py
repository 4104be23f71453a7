"""Pieces of the page as HTML, and numbers as people read them."""

from collections.abc import Iterable
from html import escape
from importlib.resources import files

import numpy as np


def page(title: str, body: str, style: str = "") -> str:
    """A whole page that needs no other file; `style` is CSS besides that of all pages."""
    common = files(__package__).joinpath("style.css").read_text(encoding="utf-8")
    return (
        '<!doctype html><html lang="en"><head><meta charset="utf-8">'
        '<meta name="viewport" content="width=device-width, initial-scale=1">'
        f"<title>{escape(title)}</title><style>{common}{style}</style></head>"
        f"<body>{body}</body></html>"
    )


def section(title: str, explanation: str, body: str) -> str:
    """A part of the page; the body is HTML."""
    paragraph = f"<p>{escape(explanation)}</p>" if explanation else ""
    return f"<section><h2>{escape(title)}</h2>{paragraph}{body}</section>"


def card(value: str, label: str, note: str) -> str:
    """A figure that matters, and what it is."""
    return (
        f'<div class="card"><b>{escape(value)}</b><span>{escape(label)}</span>'
        f"<small>{escape(note)}</small></div>"
    )


def table(heads: Iterable[str], rows: Iterable[Iterable[str]]) -> str:
    """A table; cells are HTML."""
    head = "".join(f"<th>{escape(h)}</th>" for h in heads)
    body = "".join("<tr>" + "".join(f"<td>{cell}</td>" for cell in row) + "</tr>" for row in rows)
    return f'<div class="tables"><table><tr>{head}</tr>{body}</table></div>'


def details(title: str, text: str) -> str:
    """Text that opens on a click."""
    return f"<details><summary>{escape(title)}</summary><pre>{escape(text)}</pre></details>"


def number(value: float | None, digits: int) -> str:
    """With so many decimal places; a dash where there is none."""
    return "–" if value is None or not np.isfinite(value) else f"{value:,.{digits}f}"


def length(metres: float | None) -> str:
    """In the unit that suits it; a dash where there is none."""
    if metres is None or not np.isfinite(metres):
        return "–"
    return f"{100 * metres:.1f} cm" if abs(metres) < 1 else f"{metres:.2f} m"


def duration(seconds: float) -> str:
    """A time in the unit that suits it."""
    if not np.isfinite(seconds):
        return "not known"
    for factor, unit in ((1.0, "s"), (1e3, "ms"), (1e6, "µs"), (1e9, "ns")):
        if round(seconds * factor, 6) >= 1:
            return f"{seconds * factor:.4g} {unit}"
    return f"{seconds * 1e12:.4g} ps"
