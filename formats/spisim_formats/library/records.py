"""What a reader has asked of a file, so that the report names all else.

Parsers make elements of XML and objects of JSON that record every attribute, child and key that is
asked for. What is left at the end of an import was not read, by whatever reader.
"""

from __future__ import annotations

import re
from collections import Counter
from collections.abc import Iterator, Mapping
from typing import Any
from xml.etree.ElementTree import Element

#: What lets light through or scatters it in the air: without it ranges are wrong, not only grey.
GRAVE = re.compile(r"fog|medium|particle|smoke|opacity|transpar|alpha_?mode|(^|\W)map_d$", re.I)
#: Letters of a name that notes quote, and names in a note.
MAX_LETTERS, MAX_NAMES = 80, 20

#: Numbers of what was not read: an owner, and its child, attribute or key.
Rest = Counter[tuple[str, str]]


class RecordedElement(Element):
    """An element of XML that counts as read once it is found, or anything of it is asked for."""

    __slots__ = ("asked", "is_read")

    def __init__(self, tag: str, attrib: dict[str, str] | None = None, **extra: str) -> None:
        super().__init__(tag, attrib or {}, **extra)
        self.is_read = False
        self.asked: set[str] = set()

    def get(self, key: str, default: Any = None) -> Any:
        """Return an attribute."""
        self.is_read = True
        self.asked.add(key)
        return super().get(key, default)

    def find(self, path: str, namespaces: Any = None) -> Any:
        """Return the first child of a path."""
        self.is_read = True
        result = super().find(path, namespaces)
        mark(result)
        return result

    def findall(self, path: str, namespaces: Any = None) -> Any:
        """Return all children of a path."""
        self.is_read = True
        result = super().findall(path, namespaces)
        for each in result:
            mark(each)
        return result

    def findtext(self, path: str, default: Any = None, namespaces: Any = None) -> Any:
        """Return the text of the first child of a path."""
        result = self.find(path, namespaces)
        return default if result is None else result.text or ""


class RecordedObject(dict[str, Any]):
    """An object of JSON, or the properties of a node, whose keys count as read if asked for."""

    def __init__(self, *values: Any) -> None:
        super().__init__(*values)
        self.asked: set[str] = set()

    def get(self, key: str, default: Any = None) -> Any:
        """Return a value."""
        self.asked.add(key)
        return super().get(key, default)

    def __getitem__(self, key: str) -> Any:
        self.asked.add(key)
        return super().__getitem__(key)

    def __contains__(self, key: object) -> bool:
        self.asked.add(str(key))
        return super().__contains__(key)


def sub_element(parent: Element, tag: str) -> RecordedElement:
    """Append a new element to another one."""
    child = RecordedElement(tag)
    parent.append(child)
    return child


def mark(element: Element | None) -> None:
    """Count an element as read, which was come upon otherwise than by a search."""
    if isinstance(element, RecordedElement):
        element.is_read = True


def mark_all(element: Element) -> None:
    """Count an element and all in it as read: it is left out, and a note has named it."""
    for each in element.iter():
        mark(each)
        if isinstance(each, RecordedElement):
            each.asked.update(each.keys())


def unread_elements(root: Element, harmless: frozenset[str]) -> Rest:
    """Return children and attributes that nothing asked for.

    `harmless` are ``tag``, ``parent/tag``, ``parent/*``, ``@attribute`` and ``tag@attribute``.
    """
    read: set[Element] = set()
    for element in reversed(list(root.iter())):
        if getattr(element, "is_read", True) or any(child in read for child in element):
            read.add(element)
    rest: Rest = Counter()
    waiting = [root]
    while waiting:
        element = waiting.pop()
        tag = plain(element.tag)
        keys = element.keys()
        for name in map(plain, set(keys).difference(getattr(element, "asked", keys))):
            if harmless.isdisjoint((f"@{name}", f"{tag}@{name}")):
                rest[f"<{tag}>", name] += 1
        for child in element:
            name = plain(child.tag)
            if not harmless.isdisjoint((name, f"{tag}/{name}", f"{tag}/*")):
                continue
            if child in read:
                waiting.append(child)
            else:
                rest[f"<{tag}>", f"<{name}>"] += 1
    return rest


def unread_keys(value: object, harmless: frozenset[str], owner: str = "") -> Rest:
    """Return keys of objects that nothing asked for; `harmless` are ``key`` and ``owner.key``."""
    rest: Rest = Counter()
    waiting = [(owner, value)]
    while waiting:
        owner, value = waiting.pop()
        if isinstance(value, RecordedObject):
            for key, inner in value.items():
                if key in harmless or f"{owner}.{key}" in harmless:
                    continue
                if key in value.asked or key == "extensions":  # each of glTF's by its name
                    waiting.append((key, inner))
                else:
                    rest[owner, key] += 1
        elif isinstance(value, list):
            objects = [each for each in value if isinstance(each, RecordedObject) and each]
            for each in objects:
                if each.asked:
                    waiting.append((owner, each))
                else:
                    rest["", owner] += 1
    return rest


def notes_of(file: str, rest: Mapping[tuple[str, str], int]) -> Iterator[tuple[str, bool]]:
    """Yield notes on what was not read, one for each owner, and whether each is a warning."""
    for is_grave in (True, False):
        owners: dict[str, list[str]] = {}
        for (owner, name), count in rest.items():
            if bool(GRAVE.search(name)) == is_grave:
                times = f" ({count})" if count > 1 else ""
                owners.setdefault(owner, []).append(f"{name[:MAX_LETTERS]}{times}")
        for owner, names in owners.items():
            more = ["and more"] if len(names) > MAX_NAMES else []
            place = f" of {owner[:MAX_LETTERS]}" if owner else ""
            yield f"{file}: not read{place}: {', '.join(names[:MAX_NAMES] + more)}", is_grave


def words(text: str) -> frozenset[str]:
    """Return the words of a text, as of a list of names."""
    return frozenset(text.split())


def plain(tag: object) -> str:
    """Return a tag or attribute without its namespace."""
    return tag.rpartition("}")[2] if isinstance(tag, str) else ""
