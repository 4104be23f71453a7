"""XML without document types: no entities to expand, no files to fetch."""

from __future__ import annotations

import math
from pathlib import Path
from xml.etree import ElementTree
from xml.etree.ElementTree import Element
from xml.parsers import expat

from reconstruction.errors import InputError

#: Elements within elements; what is nested deeper is not meant to be read.
MAX_DEPTH = 200


def parse_xml(data: bytes, path: Path) -> Element:
    """Root element; InputError for what is no XML, nested too deeply, or has a document type."""
    refuse_doctype(data, path)
    try:
        return ElementTree.fromstring(data)
    except (ElementTree.ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: not valid XML: {error}") from None


def refuse_doctype(data: bytes, path: Path) -> None:
    """InputError for XML with a document type, in which alone entities can be declared.

    Expat stops at the declaration, before it reads anything in it. The same pass finds elements
    that are nested too deeply; other errors are left to the parser proper.
    """
    parser = expat.ParserCreate()
    depth = 0

    def doctype(*_: object) -> None:
        raise InputError(
            f"{path}: has a document type (DOCTYPE), which could expand entities or read other "
            "files; remove it"
        )

    def start(*_: object) -> None:
        nonlocal depth
        depth += 1
        if depth > MAX_DEPTH:
            raise InputError(f"{path}: elements are nested more than {MAX_DEPTH} deep")

    def end(*_: object) -> None:
        nonlocal depth
        depth -= 1

    parser.StartDoctypeDeclHandler = doctype
    parser.StartElementHandler = start
    parser.EndElementHandler = end
    try:
        parser.Parse(data, True)
    except expat.ExpatError as error:
        raise InputError(f"{path}: not valid XML: {error}") from None
    except (ValueError, LookupError) as error:
        if isinstance(error, InputError):
            raise
        raise InputError(f"{path}: not valid XML: {error}") from None


def numbers(text: str | None, count: int, what: str) -> list[float]:
    """Finite numbers in a text, split at spaces or commas; InputError unless there are `count`."""
    try:
        values = [float(word) for word in (text or "").replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        found = (text or "").strip()
        raise InputError(f"{what}: expected {count} finite numbers; found {found!r:.80}")
    return values
