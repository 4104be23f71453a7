"""OBJ, OFF and STL files as trimesh reads them well.

It folds concave polygons over, and takes only some of what these formats allow.
"""

import re
import struct
from codecs import BOM_UTF8, BOM_UTF16_BE, BOM_UTF16_LE
from collections.abc import Iterator, Sequence
from itertools import pairwise
from typing import TypeAlias

import numpy as np
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.errors import InputError
from spisim.scene.polygons import Ints, triangulate

#: Indices of the corners of each polygon.
Polygons: TypeAlias = Sequence[Sequence[int]] | NDArray[np.integer]

#: Byte order marks of Unicode other than UTF-8.
MARKS = {BOM_UTF16_LE: "utf-16", BOM_UTF16_BE: "utf-16"}
#: Lines of an OBJ file that hold numbers, which a comment may follow.
COMMENTED = re.compile(r"^((?:v|vt|vn|vp|f|l|p) [^#\n]*)#.*$", re.M)
#: A comment after a name, in which there may be a `#` at the beginning of a word.
COMMENT = re.compile(r" +#(?: .*)?$", re.M)
POLYGON = re.compile(r"^f(?: ++\S++){4,} *$", re.M)
RELATIVE = re.compile(r"^f [^\n]*?[ /]-\d", re.M)
#: Kinds of vertices that a corner of an OBJ file refers to, in its order.
REFERRED = ("v", "vt", "vn")
#: Bytes of an STL file before its triangles, and of each of those.
STL_HEADER, STL_TRIANGLE = 84, 50


def decoded(data: bytes) -> str:
    """Text of a file in UTF-16 with a mark, UTF-8, or else Latin-1; lines end in newlines."""
    coding = next((name for mark, name in MARKS.items() if data.startswith(mark)), "utf-8")
    try:
        text = data.decode(coding)
    except UnicodeDecodeError:
        text = data.decode("latin-1")
    return text.replace("\r\n", "\n").replace("\r", "\n").removeprefix("\ufeff")


def plain_obj(text: str) -> tuple[str, str]:
    """OBJ text of triangles with absolute indices, without comments, and faults of its polygons."""
    _check_indices(text)
    text = text.replace("\t", " ")
    if text.startswith(" ") or "\n " in text:
        text = re.sub(r"^ +", "", text, flags=re.M)
    if "#" in text:
        text = re.sub(r"^#.*$", "", text, flags=re.M)
    if "\\" in text:
        text = re.sub(r"\\ *\n", " ", text)
    if "#" in text:
        text = COMMENTED.sub(r"\1", text)
        text = re.sub(r"^usemtl .*$", lambda line: COMMENT.sub("", line[0]), text, flags=re.M)
    if RELATIVE.search(text):
        text = "\n".join(_absolute(text.split("\n")))
    faces = POLYGON.findall(text)
    if not faces:
        return text, ""
    points = np.loadtxt(re.findall(r"^v (.*)$", text, re.M), usecols=(0, 1, 2), ndmin=2)
    counts = [len(face.split()) - 1 for face in faces]
    words = " ".join(face[2:] for face in faces).split()
    indices = np.array(re.sub(r"/\S*", "", " ".join(words)).split(), np.int64) - 1
    triangles = triangulate(points, counts, indices)
    if triangles.are_fans:
        return text, triangles.fault
    lines = [f"f {words[a]} {words[b]} {words[c]}\n" for a, b, c in triangles.corners.tolist()]
    ends = np.searchsorted(triangles.polygons, np.arange(len(faces)), side="right").tolist()
    each = iter("".join(lines[start:end]) for start, end in pairwise([0, *ends]))
    return POLYGON.sub(lambda _: next(each), text), triangles.fault


def _check_indices(text: str) -> None:
    """InputError for vertex 0, as OBJ files count from 1: trimesh takes the last one."""
    if zero := re.search(r"^[ \t]*f[ \t](?:[^\n#]*[ \t])?0+(?=[/\s]|\Z)", text, re.M):
        line = text.count("\n", 0, zero.end()) + 1
        raise InputError(f"line {line}: a face of vertex 0; an OBJ file counts from 1")


def _absolute(lines: Sequence[str]) -> Iterator[str]:
    """Lines of an OBJ file with indices from 1 instead of those back from the line."""
    before = dict.fromkeys(REFERRED, 0)

    def counted(corner: str) -> str:
        numbers = corner.split("/")
        for place, (kind, number) in enumerate(zip(REFERRED, numbers, strict=False)):
            if number.startswith("-"):
                absolute = before[kind] + 1 + int(number)
                if absolute < 1:
                    raise InputError(
                        f"a face refers to {kind} {number}, but {before[kind]} are before it"
                    )
                numbers[place] = str(absolute)
        return "/".join(numbers)

    for line in lines:
        kind = line.partition(" ")[0]
        if kind in before:
            before[kind] += 1
        yield " ".join(["f", *map(counted, line.split()[1:])]) if kind == "f" else line


def plain_off(text: str) -> tuple[str, str]:
    """OFF text of triangles, and faults of its polygons."""
    lines = [line for row in text.split("\n") if (line := row.partition("#")[0].strip())]
    if not lines or (start := re.match(r"(?:ST|C|N|4|n)*OFF\b *", lines[0])) is None:
        return text, ""
    lines[0] = lines[0][start.end() :]
    lines = lines if lines[0] else lines[1:]
    vertices, faces = (int(word) for word in lines[0].split()[:2])
    rows = [line.split() for line in lines[vertices + 1 : vertices + faces + 1]]
    corners = [[int(word) for word in row[1 : int(row[0]) + 1]] for row in rows]
    if all(len(polygon) == 3 for polygon in corners):
        return text, ""
    points = np.loadtxt(lines[1 : vertices + 1], usecols=(0, 1, 2), ndmin=2)
    made, fault = triangles_of(points, corners)
    head = [f"OFF\n{vertices} {len(made)} 0", *lines[1 : vertices + 1]]
    return "\n".join([*head, *(f"3 {a} {b} {c}" for a, b, c in made.tolist())]), fault


def plain_stl(data: bytes) -> tuple[bytes, str]:
    """STL file without what surrounds it, and a note on bytes after its last triangle.

    Raises InputError if a binary file is too short or too long.
    """
    count = struct.unpack_from("<I", data, 80)[0] if len(data) >= STL_HEADER else 0
    needed = STL_HEADER + STL_TRIANGLE * count
    surplus = len(data) - needed
    if count and 0 <= surplus < STL_TRIANGLE:
        what = f"{surplus} bytes after the last triangle are left out" if surplus else ""
        return data[:needed], what
    text = data.removeprefix(BOM_UTF8).lstrip()
    if text[:5].lower() == b"solid" and b"\0" not in text[:1024]:
        loops = re.findall(rb"^\s*(vertex|endloop)\s", text, re.M | re.I)
        if len(loops) != 4 * sum(word.lower() == b"endloop" for word in loops):
            raise InputError("cannot be read as STL: its loops should have three corners each")
        return text, ""
    if len(data) >= STL_HEADER and surplus:
        raise InputError(
            f"cannot be read as STL: {count:,} triangles need {needed:,} bytes; the file has "
            f"{len(data):,}"
        )
    return data, ""


def triangles_of(points: ArrayLike, polygons: Polygons) -> tuple[Ints, str]:
    """Triangles (t, 3) of polygons, and their fault."""
    indices = np.fromiter((corner for polygon in polygons for corner in polygon), np.int64)
    made = triangulate(points, [len(polygon) for polygon in polygons], indices)
    return indices[made.corners], made.fault
