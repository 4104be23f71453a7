"""Repair COLLADA files that pycollada rejects although other programs read them.

pycollada drops a whole scene for one node with a dangling reference, and everything whose material
has a texture without a file. It moves nodes with a broken pose and meshes with invalid coordinates,
and rejects numbers with decimal commas, which some locales produce.
"""

import io
import math
from collections.abc import Callable, Iterable
from typing import Any
from xml.etree.ElementTree import Element, SubElement, tostring

from spisim_formats.library.content import LEFT_OUT, Content
from spisim_formats.library.files import quoted

#: Elements that instantiate library content, and the part of a node that is lost with it.
INSTANCES = ("geometry", "controller", "camera", "light", "node", "material")
#: Elements that hold numbers.
NUMBERS = ("float_array", "color", "float", "matrix", "translate", "rotate", "scale", "lookat",
           "bind_shape_matrix")  # fmt: skip
#: Transforms of a node, and their number counts.
POSITIONS = {"matrix": 16, "lookat": 9, "skew": 7, "rotate": 4, "translate": 3, "scale": 3}


def load_document(root: Element, data: bytes | None, file: str, content: Content) -> Any:
    """Load pycollada's document without its unreadable elements; notes report them.

    `data` are the file's bytes, None if they were repaired.
    """

    def leave_out(find: Callable[[Element], Iterable[tuple[Element, str]]]) -> bool:
        faults = dict(find(root))
        for parent in list(root.iter()) if faults else ():
            for child in [each for each in parent if each in faults]:
                parent.remove(child)
                content.note(f"{LEFT_OUT}{file}: {faults[child]}")
        return bool(faults)

    mends = [_mend_pictures(root), _mend_commas(root), _mend_holes(root)]
    mends += [leave_out(_unusable), leave_out(_dangling)]
    document = _load(tostring(root) if data is None or any(mends) else data)
    if document is None:
        leave_out(_unread)
        leave_out(_dangling)
        document = _load(tostring(root), is_last=True)
    for error in document.errors:
        content.note(f"{file}: {' '.join(str(error.msg).split()):.200}")
    return document


def _load(data: bytes, *, is_last: bool = False) -> Any:
    """Return pycollada's document; None if something is missing in it, unless it `is_last`."""
    from collada import Collada
    from collada.common import DaeError, DaeUnsupportedError

    try:
        document = Collada(io.BytesIO(data), ignore=[DaeError])
    except Exception:  # of any kind, within pycollada
        if is_last:
            raise
        return None
    is_whole = all(isinstance(error, DaeUnsupportedError) for error in document.errors)
    return document if is_whole or is_last else None


def _dangling(root: Element) -> Iterable[tuple[Element, str]]:
    """Yield elements that refer to a missing element."""
    available = {each.get("id") for each in root.iter()}
    for element in root.iter():
        reference = _reference(element)
        if reference.startswith("#") and reference[1:] not in available:
            kind = _tag(element).removeprefix("instance_")
            yield element, f"{kind} {quoted(reference)} is not in the file"


def _unusable(root: Element) -> Iterable[tuple[Element, str]]:
    """Yield nodes with invalid transforms, and geometries with invalid numbers."""
    for element in root.iter():
        name = quoted(element.get("name") or element.get("id") or "")
        if _tag(element) == "node":
            for child in element:
                if not _is_placing(child):
                    yield element, f"node {name}: its {_tag(child)} is not made of finite numbers"
        elif _tag(element) == "geometry" and any(
            _tag(array) == "float_array" and "nan" in (array.text or "").lower()
            for array in element.iter()
        ):
            yield element, f"geometry {name}: a float_array has numbers that are not finite (NaN)"


def _is_placing(element: Element) -> bool:
    """Return whether an element has the right numbers, if it is a transform."""
    if (count := POSITIONS.get(_tag(element))) is None:
        return True
    try:
        values = [float(word) for word in (element.text or "").split()]
    except ValueError:
        return False
    return len(values) == count and all(map(math.isfinite, values))


def _unread(root: Element) -> Iterable[tuple[Element, str]]:
    """Yield elements of the libraries that pycollada cannot read, testing one by one."""
    from collada import Collada, xmlutil
    from collada.camera import Camera
    from collada.common import DaeError
    from collada.controller import Controller
    from collada.geometry import Geometry
    from collada.light import Light
    from collada.material import CImage, Effect, Material

    skeleton = Element(root.tag, root.attrib)
    skeleton.extend(each for each in root if _tag(each) == "asset")
    document = Collada(io.BytesIO(tostring(skeleton)), ignore=[DaeError])
    its_own = xmlutil.ET.fromstring(tostring(root))  # an lxml element if lxml is installed
    for library, kind, loader in (
        ("images", "image", CImage),
        ("effects", "effect", Effect),
        ("materials", "material", Material),
        ("geometries", "geometry", Geometry),
        ("controllers", "controller", Controller),
        ("lights", "light", Light),
        ("cameras", "camera", Camera),
    ):
        path = f"{{*}}library_{library}/{{*}}{kind}"
        for element, own in zip(root.findall(path), its_own.findall(path), strict=True):
            try:
                if (made := loader.load(document, {}, own)) is not None:
                    getattr(document, library).append(made)
            except Exception as error:  # of any kind, within pycollada
                why = " ".join(str(error.msg).split()) if isinstance(error, DaeError) else "damaged"
                yield element, f"{kind} {quoted(element.get('id', ''))}: {why:.200}"


def _mend_pictures(root: Element) -> bool:
    """Add an empty reference to textures without one."""
    bare = [
        image
        for image in root.findall("{*}library_images/{*}image")
        if not any(_tag(child) == "init_from" for child in image)
    ]
    for image in bare:
        SubElement(image, image.tag.replace("image", "init_from"))
    return bool(bare)


def _mend_commas(root: Element) -> bool:
    commas = [
        number for number in root.iter() if _tag(number) in NUMBERS and "," in (number.text or "")
    ]
    for number in commas:
        number.text = (number.text or "").replace(",", ".")
    return bool(commas)


def _mend_holes(root: Element) -> bool:
    """Join the holes of polygons to their outlines by seams, as pycollada skips such polygons."""
    holed = [each for each in root.iter() if _tag(each) == "ph"]
    for polygons in (each for each in root.iter() if _tag(each) == "polygons"):
        stride = 1 + max((int(each.get("offset", 0)) for each in polygons.iter()), default=0)
        for polygon in (each for each in polygons if _tag(each) == "ph"):
            outline, *holes = [(ring.text or "").split() for ring in polygon]
            joined = [*outline, *outline[:stride]]
            for hole in holes:
                joined += [*hole, *hole[:stride], *outline[:stride]]
            polygon.tag = polygon.tag.replace("ph", "p")
            polygon[:] = []
            polygon.text = " ".join(joined)
    return bool(holed)


def _tag(element: Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _reference(element: Element) -> str:
    kind = _tag(element)
    if not kind.startswith("instance_") or kind.removeprefix("instance_") not in INSTANCES:
        return ""
    return element.get("target" if kind == "instance_material" else "url", "")
