"""PLY files of polygons as files of triangles: trimesh reads no binary ones of several sizes."""

import re
import struct
from collections.abc import Iterable, Sequence
from dataclasses import dataclass

import numpy as np

from spisim.scene.mesh_files import Polygons, triangles_of

#: Types of numbers, for `struct` and NumPy.
CODES = {
    "char": "b", "int8": "b", "uchar": "B", "uint8": "B", "short": "h", "int16": "h",
    "ushort": "H", "uint16": "H", "int": "i", "int32": "i", "uint": "I", "uint32": "I",
    "int64": "q", "uint64": "Q", "float": "f", "float32": "f", "double": "d", "float64": "d",
}  # fmt: skip
CORNERS = ("vertex_indices", "vertex_index")


@dataclass(frozen=True)
class Property:
    """A number of an element, or a list of them with a `length`; both are codes of types."""

    name: str
    code: str
    length: str = ""


@dataclass(frozen=True)
class Element:
    """Vertices, faces or others, and their lines in the header."""

    name: str
    count: int
    properties: tuple[Property, ...]
    header: str

    def dtype(self, order: str, sizes: Sequence[int] = ()) -> np.dtype[np.void]:
        """Type of a row whose lists have these sizes."""
        left = list(sizes)
        fields: list[tuple[str, str, tuple[int, ...]]] = []
        for each in self.properties:
            if each.length:
                fields.append((f"size of {each.name}", order + each.length, ()))
            fields.append((each.name, order + each.code, (left.pop(0),) if each.length else ()))
        return np.dtype(fields)

    @property
    def lists(self) -> list[str]:
        """Names of properties that are lists."""
        return [each.name for each in self.properties if each.length]

    @property
    def corners(self) -> str:
        """Name of the list of a face's vertices."""
        return next((name for name in self.lists if name in CORNERS), self.lists[0])


def plain_ply(data: bytes) -> tuple[bytes, str]:
    """PLY file of triangles, and faults of its polygons.

    A file of polygons loses all but its vertices and their indices.
    """
    end = re.search(rb"^end_header[ \t]*\r?\n", data, re.M)
    if end is None:
        return data, ""
    foreign = rb"^(?:comment|obj_info)[^\n]*[\x80-\xff][^\n]*\n"
    head = re.sub(foreign, b"", data[: end.end()], flags=re.M)
    if len(head) < end.end():
        data = head + data[end.end() :]
    body = memoryview(data)[len(head) :]
    form = re.split(rb"^element", head, maxsplit=1, flags=re.M)[0].decode()
    elements = {each.name: each for each in _elements(head.decode())}
    vertex, face = elements.get("vertex"), elements.get("face")
    if vertex is None or face is None or vertex.lists or not face.lists:
        return data, ""
    order = ">" if "big" in form else "<"
    if "ascii" in form:
        vertices, polygons = _from_text(bytes(body).decode("latin-1"), elements.values())
    else:
        vertices, polygons = _from_binary(body, elements.values(), order)
    if all(len(polygon) == 3 for polygon in polygons):
        return data, ""
    if "ascii" in form:
        columns = [[each.name for each in vertex.properties].index(axis) for axis in "xyz"]
        points = np.loadtxt(vertices.decode().splitlines(), usecols=columns, ndmin=2)
    else:
        table = np.frombuffer(vertices, vertex.dtype(order))
        points = np.column_stack([table[axis] for axis in "xyz"])
    made, fault = triangles_of(points, polygons)
    top = (
        f"{form}{vertex.header}element face {len(made)}\n"
        "property list uchar int vertex_indices\nend_header\n"
    )
    if "ascii" in form:
        faces = "".join(f"3 {a} {b} {c}\n" for a, b, c in made.tolist()).encode()
    else:
        rows = np.zeros(len(made), [("size", "u1"), ("corners", f"{order}i4", 3)])
        rows["size"], rows["corners"] = 3, made
        faces = rows.tobytes()
    return top.encode() + vertices + faces, fault


def _elements(header: str) -> list[Element]:
    """Elements of a PLY file in the order of their data."""
    result = []
    for text in re.findall(r"^element\s.*\n(?:(?!element|end_header).*\n)*", header, re.M):
        first, *rest = [line.split() for line in text.splitlines()]
        properties = [
            Property(words[-1], CODES[words[-2]], CODES[words[2]] if words[1] == "list" else "")
            for words in rest
            if words[0] == "property"
        ]
        result.append(Element(first[1], int(first[2]), tuple(properties), text))
    return result


def _from_text(body: str, elements: Iterable[Element]) -> tuple[bytes, Polygons]:
    """Lines of the vertices, and the polygons."""
    lines = body.splitlines()
    vertices, polygons = b"", []
    for element in elements:
        rows, lines = lines[: element.count], lines[element.count :]
        if element.name == "vertex":
            vertices = "".join(f"{row}\n" for row in rows).encode()
        elif element.name == "face":
            polygons = [_corners(row.split(), element) for row in rows]
    return vertices, polygons


def _corners(words: Sequence[str], face: Element) -> list[int]:
    at = 0
    for each in face.properties:
        stop = at + 1 + (int(words[at]) if each.length else 0)
        if each.name == face.corners:
            return [int(word) for word in words[at + 1 : stop]]
        at = stop
    return []


def _from_binary(
    body: memoryview, elements: Iterable[Element], order: str
) -> tuple[bytes, Polygons]:
    """Bytes of the vertices, and the polygons."""
    at, vertices = 0, b""
    polygons: Polygons = []
    for element in elements:
        start = at
        if element.lists:
            rows, at = _rows(body, at, element, order)
            polygons = rows if element.name == "face" else polygons
        else:
            at += element.count * element.dtype(order).itemsize
        if element.name == "vertex":
            vertices = bytes(body[start:at])
    return vertices, polygons


def _rows(body: memoryview, at: int, element: Element, order: str) -> tuple[Polygons, int]:
    """Corners of an element's rows, and where it ends."""
    rows: list[Sequence[int]] = []
    kinds: dict[tuple[int, ...], np.dtype[np.void]] = {}
    for _ in range(element.count):
        sizes = _sizes(body, at, element, order)
        if sizes not in kinds:
            kinds[sizes] = element.dtype(order, sizes)
        kind = kinds[sizes]
        if not rows and at + element.count * kind.itemsize <= len(body):
            table = np.frombuffer(body, kind, element.count, at)  # if all are of one size
            lists = zip(element.lists, sizes, strict=True)
            if all((table[f"size of {name}"] == size).all() for name, size in lists):
                return table[element.corners], at + table.nbytes
        rows.append(np.frombuffer(body, kind, 1, at)[element.corners][0])
        at += kind.itemsize
    return rows, at


def _sizes(body: memoryview, at: int, element: Element, order: str) -> tuple[int, ...]:
    """Sizes of the lists in the row at this place."""
    sizes: list[int] = []
    for each in element.properties:
        if each.length:
            sizes += struct.unpack_from(order + each.length, body, at)
            at += struct.calcsize(order + each.length)
        at += struct.calcsize(order + each.code) * (sizes[-1] if each.length else 1)
    return tuple(sizes)
