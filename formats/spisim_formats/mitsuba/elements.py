"""Mitsuba scene files put together: includes, `$parameters`, and what their elements come to.

What the elements say is left to Mitsuba's own parser, which is handed in from above. Which files
are read is not: it opens whatever a file names, looks for it in the working directory too, lets
parameters double until the memory is full, and overflows its stack, which ends the process, on
elements nested deeply. So it gets elements one to a line, with nothing left to open or replace.
"""

from __future__ import annotations

import re
from collections import Counter
from dataclasses import dataclass, field
from pathlib import Path
from typing import TypeAlias, TypeVar
from xml.etree.ElementTree import Element, SubElement, tostring

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim_formats.library.files import Folders, quoted, read_bytes
from spisim_formats.library.records import RecordedObject, Rest, words
from spisim_formats.library.xml import numbers, parse_xml

MAX_INCLUDE_DEPTH = 15  # as Mitsuba's own
MAX_INCLUDES = 1000
#: Of a text with its parameters filled in, which may hold parameters themselves.
MAX_CHARACTERS = 100_000

Value = TypeVar("Value", bool, float, str, Floats)


@dataclass(eq=False)
class Node:
    """An object of a scene such as a "shape" or "bsdf".

    `properties` are numbers, flags, texts, vectors and colours (3,), transforms (4, 4) and other
    nodes, in the order of the file; nodes that are referred to appear in several, even in circles.
    """

    kind: str
    type: str
    id: str = ""
    name: str = ""
    properties: RecordedObject = field(default_factory=RecordedObject, repr=False)

    @property
    def what(self) -> str:
        """How messages call it."""
        name = (self.id or self.name)[:80]
        return " ".join(filter(None, (self.type, self.kind, repr(name) if name else None)))

    @property
    def children(self) -> list[Node]:
        """The nodes in it."""
        return [value for value in self.properties.values() if isinstance(value, Node)]

    def forget(self) -> None:
        """Count it as read: it is left out, and a note has named it."""
        self.properties.asked.update(("type", *self.properties))

    def value(self, name: str, default: Value) -> Value:
        """The property of this name; InputError unless its type and shape are the default's."""
        result = self.properties.get(name, default)
        result = float(result) if type(result) is int else result
        if type(result) is not type(default) or np.shape(result) != np.shape(default):
            raise InputError(f"{self.what}: {name} is of another type than expected")
        return result


#: Elements without parameters and includes, one to a line, and the file that each stands in.
Elements: TypeAlias = list[tuple[str, Path]]
#: What tells how a scene is rendered, not what it is.
UNUSED = ("integrator", "sampler", "film", "rfilter")


@dataclass(frozen=True)
class Source:
    """The elements of a scene, and the folders in which it looks for files, the scene's first."""

    elements: Elements
    folders: tuple[Path, ...]
    left_out: tuple[str, ...] = ()


def read_source(path: Path, folders: Folders) -> Source:
    """What a scene file of format 2 or 3 and its includes hold; InputError for what is not read.

    Files are looked for as Mitsuba does: beside the file that names them, in the folders of
    `<path>`, the last one first, beside the scene, and in the folders that may be read.
    """
    reader = _Reader(path, folders)
    reader.read(path, (path.resolve(),), ())
    searched = (path.parent, *reader.folders, *folders.roots)
    return Source(reader.elements, searched, tuple(dict.fromkeys(reader.left_out)))


class _Reader:
    def __init__(self, top: Path, folders: Folders) -> None:
        self.elements: Elements = []
        self.folders: tuple[Path, ...] = ()  # of the scene file itself
        self.left_out: list[str] = []
        self._top = top
        self._folders = folders
        self._parameters: dict[str, str] = {}
        self._includes = 0

    def read(self, path: Path, chain: tuple[Path, ...], folders: tuple[Path, ...]) -> None:
        root = parse_xml(read_bytes(path), path)
        if root.tag != "scene":
            raise InputError(f"{path}: is no Mitsuba scene: its root is <{root.tag}>, not <scene>")
        version = root.get("version", "")
        if not re.match(r"[23]\.", version):
            raise InputError(
                f"{path}: version {quoted(version)}: Mitsuba scene format 2 or 3 is expected; "
                "Mitsuba 3 itself upgrades older files"
            )
        for element in root:
            _drop_unused(element)
            self._fill(element, path)
            if element.tag == "default":
                name, value = element.get("name", ""), element.get("value", "")
                self._parameters.setdefault(name, value)
            elif element.tag == "path":
                folders = (path.parent / element.get("value", ""), *folders)
                if path == self._top:
                    self.folders = folders
            elif element.tag == "include":
                self._include(element.get("filename", ""), path, chain, folders)
            elif element.tag not in UNUSED:
                self._take(element, path, folders)

    def _include(
        self, name: str, path: Path, chain: tuple[Path, ...], folders: tuple[Path, ...]
    ) -> None:
        what = f"{path}: include {quoted(name)}"
        self._includes += 1
        result = self._folders.find(name, path.parent, what, (*folders, *self._folders.roots))
        if result in chain:
            names = " → ".join(str(link) for link in (*chain, result))
            raise InputError(f"{what}: includes itself: {names}")
        if len(chain) > MAX_INCLUDE_DEPTH or self._includes > MAX_INCLUDES:
            raise InputError(
                f"{what}: more than {MAX_INCLUDE_DEPTH} includes in one another, or {MAX_INCLUDES}"
            )
        self.read(result, (*chain, result), folders)

    def _take(self, element: Element, path: Path, folders: tuple[Path, ...]) -> None:
        around = Element("scene")
        around.append(element)
        for each in list(around.iter()):
            each.text = each.tail = None
            for spectrum in each.findall("spectrum[@filename]"):
                each.remove(spectrum)  # the parser would open the file
                name, file = (quoted(spectrum.get(key, "")) for key in ("name", "filename"))
                self.left_out.append(f"{each.get('type', each.tag)[:80]}: {name} of {file}")
            if each.tag == "include":
                raise InputError(f"{path}: include within <{element.tag}>: move it out of there")
            if each.tag == "rotate":
                _make_axis_unit(each, path)
            if each.tag == "rgb" and re.fullmatch("#[0-9a-fA-F]{6}", each.get("value", "").strip()):
                parts = bytes.fromhex(each.get("value", "").strip(" #"))
                each.set("value", " ".join(str(part / 255) for part in parts))
            if each.tag == "string" and each.get("name") == "filename" and path != self._top:
                each.set("value", self._located(each.get("value", ""), path, folders))
        look = element.find("transform[@name='to_world']/lookat[@up]")
        if element.tag == "sensor" and look is not None:  # of which the parser keeps a matrix
            SubElement(element, "vector", name="up", value=look.get("up", ""))
        self.elements += [(tostring(each, "unicode"), path) for each in around]

    def _located(self, name: str, path: Path, folders: tuple[Path, ...]) -> str:
        """The file that an included file refers to, or where that is missing, its name."""
        try:
            return str(self._folders.find(name, path.parent, "", (*folders, *self._folders.roots)))
        except InputError:
            return name

    def _fill(self, element: Element, path: Path) -> None:
        """Put the values of `$parameters` into an element and all within it."""
        for each in element.iter():
            for key, text in each.items():
                each.set(key, self._filled(text, path))

    def _filled(self, text: str, path: Path) -> str:
        filled = 0

        def value(match: re.Match[str]) -> str:
            nonlocal filled
            name = match[1]
            if name not in self._parameters:
                candidate = nearest(name, self._parameters)
                raise InputError(f"{path}: ${name} has no <default>: {candidate}")
            filled += len(self._parameters[name])
            if filled > MAX_CHARACTERS:
                raise InputError(f"{path}: ${name} makes a text of over {MAX_CHARACTERS:,} letters")
            return self._parameters[name]

        return re.sub(r"\$(\w+)", value, text)


def _drop_unused(element: Element) -> None:
    """Remove what is not used here, and may have parameters that only the command line gives."""
    for each in list(element.iter()):
        for inner in [child for child in each if child.tag in UNUSED]:
            each.remove(inner)
    if element.tag in UNUSED:
        element.attrib.clear()
        del element[:]


def _make_axis_unit(turn: Element, path: Path) -> None:
    """Mitsuba shears about an axis of another length, where the file means to turn."""
    text = turn.attrib.pop("value", None) or " ".join(turn.get(name, "0") for name in "xyz")
    axis = np.array(numbers(text, 3, f"{path}: rotate: axis"))
    for name, component in zip("xyz", axis / (np.linalg.norm(axis) or 1), strict=True):
        turn.set(name, repr(float(component)))


#: Properties that light does not see, ``kind.*`` for all of a kind.
HARMLESS = words("""
sensor.* shape.face_normals shape.flip_tex_coords emitter.sampling_weight texture.filter_type
texture.wrap_mode texture.accel texture.format medium.sample_emitters
medium.has_spectral_extinction medium.majorant_resolution_factor medium.majorant_factor
""")
#: Kinds of which others refer to some, and leave libraries of the rest.
VISIBLE = ("shape", "emitter", "sensor")


def unread_nodes(scene: Node) -> Rest:
    """Return what of shapes, emitters, and what they refer to, nothing asked for."""
    rest: Rest = Counter()
    seen: set[Node] = set()
    waiting = [node for node in scene.children if node.kind in VISIBLE]
    while waiting:
        node = waiting.pop()
        if node in seen:
            continue
        seen.add(node)
        for key, value in node.properties.items():
            if not HARMLESS.isdisjoint((f"{node.kind}.{key}", f"{node.kind}.*")):
                continue
            owner = node.type if node.kind in node.type else f"{node.type} {node.kind}"
            if not isinstance(value, Node):
                rest[owner, key] += key not in node.properties.asked
            elif value.properties.asked:
                waiting.append(value)
            else:
                rest[owner, value.what] += 1
    return +rest
