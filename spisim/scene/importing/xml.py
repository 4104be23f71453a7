"""XML without document types: no entities to expand, no files to fetch."""

import math
import re
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError

from defusedxml import DTDForbidden
from defusedxml.ElementTree import fromstring

from reconstruction.errors import InputError

#: Elements within elements; defusedxml has no limit, and what walks or writes a tree recurses.
MAX_DEPTH = 200


def parse_xml(data: bytes, path: Path) -> Element:
    """Root element; InputError for what is no XML, nested too deeply, or has a document type."""
    try:
        root: Element = fromstring(data, forbid_dtd=True)
    except DTDForbidden:
        raise InputError(
            f"{path}: has a document type (DOCTYPE), which could expand entities or read other "
            "files; remove it"
        ) from None
    except (ParseError, ValueError, LookupError) as error:
        raise InputError(f"{path}: not valid XML: {error}") from None
    level = [root]
    for _ in range(MAX_DEPTH):
        level = [child for element in level for child in element]
    if level:
        raise InputError(f"{path}: elements are nested more than {MAX_DEPTH} deep")
    return root


def parse_lenient_xml(data: bytes, path: Path) -> Element:
    """As `parse_xml`, for what robotics' parsers overlook.

    Dashes in comments, space before the declaration, prefixes of names that stand for nothing, and
    names with two colons.
    """
    data = re.sub(rb"<!--.*?-->", _lines, data.lstrip(b"\xef\xbb\xbf \t\r\n"), flags=re.DOTALL)
    data = re.sub(rb"(</?[A-Za-z_][\w.-]*)::", rb"\1.", data)
    used = set(re.findall(rb"[<\s/]([A-Za-z_][\w.-]*):[A-Za-z_]", data))
    lacking = used - set(re.findall(rb"xmlns:([\w.-]+)", data)) - {b"xml", b"xmlns"}
    declared = b"".join(b' xmlns:%b="%b"' % (name, name) for name in sorted(lacking))
    return parse_xml(re.sub(rb"<([A-Za-z_][\w.-]*)", rb"<\1" + declared, data, count=1), path)


def _lines(comment: re.Match[bytes]) -> bytes:
    """As many line ends as a comment has, so that messages count right."""
    return b"\n" * comment[0].count(b"\n")


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
