"""XML without document types, so that no entities are expanded and no files fetched."""

import math
import re
from codecs import BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Callable
from pathlib import Path
from xml.etree.ElementTree import Element, ParseError, TreeBuilder

from defusedxml import DTDForbidden
from defusedxml.ElementTree import DefusedXMLParser

from reconstruction.base.errors import InputError, LimitError
from spisim_formats.library.records import RecordedElement

#: Limit on nesting, because tree functions recurse and defusedxml has none.
MAX_DEPTH = 200

NAME = r"[^\W\d][\w.-]*"
#: Runs in linear time: no part looks beyond the next `<`, or to the end more than once.
TOKEN = re.compile(
    r"(?P<doctype><!DOCTYPE)"
    r"|(?P<ignored><!--.*?(?:-->|\Z)|<\?.*?(?:\?>|\Z))"
    r"|(?P<cdata><!\[CDATA\[.*?(?:\]\]>|\Z))"
    rf"|(?P<tag></?{NAME}(?:[^<>\"']++|\"[^\"<]*+\"|'[^'<]*+')*+>)"
    r"|(?P<text>[^<]+|<)",
    re.DOTALL,
)
#: A name, and an optional value with or without quotes.
ATTRIBUTE = re.compile(r"""([^\s=/"'<>]+)(?:\s*=\s*("[^"]*"|'[^']*'|[^\s"'<>]+))?""")
#: Characters not allowed in XML, and ampersands that begin no entity.
NOT_XML = re.compile("[^\t\n\r\x20-\ud7ff\ue000-\ufffd\U00010000-\U0010ffff]")
LOOSE = re.compile(r"&(?!(?:amp|lt|gt|quot|apos|#\d+|#x[0-9A-Fa-f]+);)")


class BadXML(InputError):
    """A file is not well-formed; a lenient reader may repair it."""


def parse_xml(data: bytes, path: Path) -> Element:
    """Return the root element. Raises InputError if malformed, too deep, or with a DOCTYPE."""
    try:
        parser = DefusedXMLParser(target=TreeBuilder(RecordedElement), forbid_dtd=True)
        parser.feed(data)
        root: Element = parser.close()
    except DTDForbidden:
        raise InputError(
            f"{path}: has a document type (DOCTYPE), which could expand entities or read other "
            "files; remove it"
        ) from None
    except (ParseError, ValueError, LookupError) as error:
        raise BadXML(f"{path}: not valid XML: {error}") from None
    level = [root]
    for _ in range(MAX_DEPTH):
        level = [child for element in level for child in element]
    if level:
        raise LimitError(f"{path}: elements are nested more than {MAX_DEPTH} deep")
    return root


def parse_lenient_xml(data: bytes, path: Path, note: Callable[[str], None]) -> Element:
    """Parse as `parse_xml`, but repair what other parsers tolerate, with a note."""
    try:
        return parse_xml(data, path)
    except BadXML as error:
        root = parse_xml(mended(data).encode(), path)
        fault = str(error).removeprefix(f"{path}: ")
        note(f"{path.name}: {fault}; it is read as it was meant")
        return root


def mended(data: bytes) -> str:
    """Repair the texts and attributes of XML as far as that needs no guess.

    It repairs stray `&` and `<`, forbidden characters, attributes without quotes or value or given
    twice, dashes in comments, a late declaration, undefined prefixes, and names with two colons.
    Unclosed elements remain, because the content of a truncated file is unknown.
    """
    text = TOKEN.sub(_sound, NOT_XML.sub("", _decoded(data)))
    used = set(re.findall(rf"[<\s/]({NAME}):[A-Za-z_]", text))
    lacking = used - set(re.findall(rf"xmlns:({NAME})", text)) - {"xml", "xmlns"}
    declared = "".join(f' xmlns:{name}="{name}"' for name in sorted(lacking))
    return re.sub(rf"<{NAME}(?::{NAME})?", rf"\g<0>{declared}", text, count=1)


def _decoded(data: bytes) -> str:
    """Decode text by its byte order mark or declaration, else as UTF-8."""
    if data.startswith((BOM_UTF16_LE, BOM_UTF16_BE)):
        return data.decode("utf-16", errors="replace")
    declared = re.match(rb"[^<]*<\?xml[^>]*encoding\s*=\s*[\"']([\w.-]+)", data)
    try:
        return data.decode(declared[1].decode() if declared else "utf-8-sig", errors="replace")
    except LookupError:
        return data.decode(errors="replace")


def _sound(token: re.Match[str]) -> str:
    match token.lastgroup:
        case "tag":
            return _sound_tag(token[0])
        case "text":
            return _escaped(token[0])
        case "ignored":
            return "\n" * token[0].count("\n")  # keeps line numbers correct
    return token[0]


def _sound_tag(tag: str) -> str:
    start = "</" if tag.startswith("</") else "<"
    name, *words = (match for match in ATTRIBUTE.finditer(tag.rstrip("/> \t\r\n"), len(start)))
    attributes: dict[str, str] = {}
    for word in words:
        attributes.setdefault(_plain(word[1]), (word[2] or word[1]).strip("\"'"))
    listed = "".join(
        f' {each}="{_escaped(value).replace(chr(34), "&quot;")}"'
        for each, value in attributes.items()
        if re.fullmatch(rf"{NAME}(:{NAME})?", each)
    )
    return f"{start}{_plain(name[1])}{listed}{'/' if tag.endswith('/>') else ''}>"


def _plain(name: str) -> str:
    """Return a name with at most one colon."""
    prefix, colon, rest = name.replace("::", ".").partition(":")
    return f"{prefix}{colon}{rest.replace(':', '.')}"


def _escaped(text: str) -> str:
    return LOOSE.sub("&amp;", text).replace("<", "&lt;")


def numbers(text: str | None, count: int, what: str) -> list[float]:
    """Return finite numbers in a text, separated by spaces or commas; InputError unless `count`."""
    try:
        values = [float(word) for word in (text or "").replace(",", " ").split()]
    except ValueError:
        values = []
    if len(values) != count or not all(map(math.isfinite, values)):
        result = (text or "").strip()
        raise InputError(f"{what}: expected {count} finite numbers; found {result!r:.80}")
    return values
