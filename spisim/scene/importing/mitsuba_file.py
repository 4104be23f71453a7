"""Mitsuba XML with its parameters, includes and references resolved; nothing of it is executed."""

from __future__ import annotations

import re
from collections.abc import Mapping
from dataclasses import dataclass, field
from pathlib import Path
from xml.etree.ElementTree import Element

from reconstruction.errors import InputError, nearest
from spisim.scene.importing.files import Folders, read_bytes
from spisim.scene.importing.xml import numbers, parse_xml

MAX_INCLUDE_DEPTH = 15  # as Mitsuba's own
MAX_INCLUDES = 1000
#: Of a text with its parameters filled in, which may hold parameters themselves.
MAX_CHARACTERS = 100_000


@dataclass(frozen=True)
class Item:
    """An element of a scene file, with `$parameters` replaced, and the file that it stands in."""

    tag: str
    attributes: Mapping[str, str]
    children: tuple[Item, ...]
    path: Path

    @property
    def what(self) -> str:
        """How messages call it."""
        name = self.attributes.get("id") or self.attributes.get("name")
        kind = self.attributes.get("type")
        return " ".join(filter(None, (kind, self.tag, repr(name) if name else None)))

    def named(self, name: str) -> Item | None:
        """The child of this name, or None."""
        return next((row for row in self.children if row.attributes.get("name") == name), None)

    def value(self, name: str) -> str | None:
        """The text of the parameter of this name, or None."""
        found = self.named(name)
        return None if found is None else found.attributes.get("value")

    def number(self, name: str, default: float) -> float:
        """The number of the parameter of this name; InputError for what is none."""
        text = self.value(name)
        return default if text is None else numbers(text, 1, f"{self.what}: {name}")[0]

    def flag(self, name: str) -> bool:
        """Whether the parameter of this name is there and true."""
        return (self.value(name) or "false").strip().lower() == "true"

    def point(self, name: str, default: list[float]) -> list[float]:
        """The point of this name, three numbers, by attributes or as one text."""
        found = self.named(name)
        return default if found is None else found.vector(0.0)

    def vector(self, missing: float) -> list[float]:
        """Three numbers from `value` (or one for all), else from x, y and z."""
        text = self.attributes.get("value")
        if text is not None:
            count = len(text.replace(",", " ").split())
            found = numbers(text, 1 if count == 1 else 3, self.what)
            return found * 3 if count == 1 else found
        return [
            numbers(self.attributes[axis], 1, f"{self.what}: {axis}")[0]
            if axis in self.attributes
            else missing
            for axis in "xyz"
        ]


@dataclass
class SceneFile:
    """The items of a scene and of what it includes, and those with an id."""

    items: list[Item] = field(default_factory=list)
    by_id: dict[str, Item] = field(default_factory=dict)

    def resolve(self, item: Item) -> Item:
        """What a `<ref>` refers to; anything else is itself. InputError for an unknown id."""
        seen: list[str] = []
        while item.tag == "ref":
            name = item.attributes.get("id", "")
            if name not in self.by_id or name in seen:
                raise InputError(f"ref {name!r}: {nearest(name, self.by_id)}")
            seen.append(name)
            item = self.by_id[name]
        return item


def read_scene_file(path: Path, folders: Folders) -> SceneFile:
    """A Mitsuba scene file of format 2 or 3; InputError for what cannot be read."""
    scene = SceneFile()
    _Includer(folders, scene).read(path, (path.resolve(),))
    return scene


class _Includer:
    def __init__(self, folders: Folders, scene: SceneFile) -> None:
        self._folders = folders
        self._scene = scene
        self._parameters: dict[str, str] = {}
        self._count = 0

    def read(self, path: Path, chain: tuple[Path, ...]) -> None:
        root = parse_xml(read_bytes(path), path)
        if root.tag != "scene":
            raise InputError(f"{path}: is no Mitsuba scene: its root is <{root.tag}>, not <scene>")
        version = root.get("version", "")
        if not re.match(r"[23]\.", version):
            raise InputError(
                f"{path}: version {version!r}: Mitsuba scene format 2 or 3 is expected; Mitsuba 3 "
                "itself upgrades older files"
            )
        for element in root:
            if element.tag == "default":
                name = element.get("name", "")
                self._parameters.setdefault(name, self._filled(element.get("value", ""), path))
            elif element.tag == "include":
                self._include(self._filled(element.get("filename", ""), path), path, chain)
            elif element.tag == "alias":
                item = Item("ref", {"id": element.get("id", "")}, (), path)
                self._scene.by_id[element.get("as", "")] = item
            else:
                self._scene.items.append(self._item(element, path))

    def _include(self, name: str, path: Path, chain: tuple[Path, ...]) -> None:
        what = f"{path}: include {name!r}"
        self._count += 1
        found = self._folders.find(name, path.parent, what)
        if found in chain:
            names = " → ".join(str(link) for link in (*chain, found))
            raise InputError(f"{what}: includes itself: {names}")
        if len(chain) > MAX_INCLUDE_DEPTH or self._count > MAX_INCLUDES:
            raise InputError(
                f"{what}: more than {MAX_INCLUDE_DEPTH} includes in one another, or {MAX_INCLUDES}"
            )
        self.read(found, (*chain, found))

    def _item(self, element: Element, path: Path) -> Item:
        attributes = {key: self._filled(value, path) for key, value in element.attrib.items()}
        children = tuple(self._item(child, path) for child in element)
        item = Item(element.tag, attributes, children, path)
        if "id" in attributes and element.tag != "ref":
            self._scene.by_id[attributes["id"]] = item
        return item

    def _filled(self, text: str, path: Path) -> str:
        """A text with the values of its `$parameters`."""
        filled = 0

        def value(found: re.Match[str]) -> str:
            nonlocal filled
            name = found[1]
            if name not in self._parameters:
                known = nearest(name, self._parameters)
                raise InputError(f"{path}: ${name} has no <default>: {known}")
            filled += len(self._parameters[name])
            if filled > MAX_CHARACTERS:
                raise InputError(f"{path}: ${name} makes a text of over {MAX_CHARACTERS:,} letters")
            return self._parameters[name]

        return re.sub(r"\$(\w+)", value, text)
