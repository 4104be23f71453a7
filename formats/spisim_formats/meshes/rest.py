"""What of mesh files is not read: keywords, elements, properties, and colours of faces."""

import re
from collections import Counter
from collections.abc import Collection

import numpy as np

from spisim_formats.library.records import Rest, words

#: Keywords of OBJ that are read, or say nothing of where a surface is.
OBJ = words("v vt vn f o g s usemtl mtllib l p")
#: Keywords of MTL that are read, and ambient light.
MTL = words("newmtl kd map_kd d tr map_d ka map_ka illum")
STL = words("solid facet outer vertex endloop endfacet endsolid")
#: Elements of PLY and their properties: places, directions, texture coordinates, colours.
PLY = {
    "vertex": words("x y z nx ny nz s t u v texture_u texture_v red green blue r g b"),
    "face": words("vertex_indices vertex_index texcoord texnumber"),
}


def unread_words(text: str, read: Collection[str], owner: str = "") -> Rest:
    """Count the lines whose first word, in lower case, is none of those that are read."""
    known = "|".join(map(re.escape, read))
    others = re.findall(rf"^[ \t]*(?!(?:{known})(?:\s|$))([^\W\d][\w:.-]*)", text, re.M | re.I)
    return Counter((owner, word) for word in others)


def unread_ply(header: bytes) -> Rest:
    """Count elements and properties of a header that are not read, and pictures in comments."""
    rest: Rest = Counter()
    element = ""
    for line in header.decode("ascii", errors="replace").splitlines():
        match line.split():
            case ["element", name, *_]:
                element = name
                if name not in PLY:
                    rest["", name] += 1
            case ["property", *_, name] if element in PLY and name not in PLY[element]:
                rest[element, name] += 1
            case ["comment", "TextureFile", *_]:
                rest["comment", "TextureFile"] += 1
    return rest


def unread_stl(data: bytes) -> Rest:
    """Count triangles with attributes, which some programs use for colours, or keywords."""
    if data[:5].lower() == b"solid" and b"\0" not in data[:1024]:
        return unread_words(data.decode("utf-8", errors="replace"), STL)
    records = np.frombuffer(data[84 : 84 + (len(data) - 84) // 50 * 50], np.uint8).reshape(-1, 50)
    count = int(records[:, 48:].any(axis=1).sum())
    colors = {
        ("triangles", "attribute (a colour)"): count,
        ("header", "COLOR"): b"COLOR=" in data[:80],
    }
    return +Counter(colors)


def unread_off(data: bytes) -> Rest:
    """Name numbers that follow the place of the first vertex and the corners of the first face."""
    lines = re.sub(rb"#.*", b"", data).split(b"\n")
    rows = [line for line in lines if re.match(rb"\s*[-+.\d]", line)]
    rest: Rest = Counter()
    try:
        vertex, face = rows[1].split(), rows[1 + int(rows[0].split()[0])].split()
        rest["vertices", "further numbers"] += len(vertex) > 3
        rest["faces", "further numbers (colours)"] += len(face) > 1 + int(face[0])
    except (IndexError, ValueError):  # damaged, which its reader says
        pass
    return +rest
