"""COLLADA that pycollada gives up, for what other programs overlook."""

from xml.etree.ElementTree import Element, tostring

from spisim.scene.importing.files import shown

#: What shows a thing of a library, and the part of a node that gets lost with it.
INSTANCES = ("geometry", "controller", "camera", "light", "node", "material")
#: Elements of numbers.
NUMBERS = ("float_array", "color", "float", "matrix", "translate", "rotate", "scale", "lookat",
           "bind_shape_matrix")  # fmt: skip


def mended(root: Element, data: bytes) -> tuple[bytes, list[str]]:
    """The file's bytes, anew where they had to be mended, and what is told of what they lack.

    pycollada drops a whole scene for one node that shows what is not there, and refuses numbers
    with commas for points, which some locales make.
    """
    known = {each.get("id") for each in root.iter()}
    dangling = []
    for parent in list(root.iter()):
        for child in list(parent):
            reference = _reference(child)
            if reference.startswith("#") and reference[1:] not in known:
                parent.remove(child)
                kind = _tag(child).removeprefix("instance_")
                dangling.append(f"{kind} {shown(reference)} is not in the file: left out")
    commas = [
        number for number in root.iter() if _tag(number) in NUMBERS and "," in (number.text or "")
    ]
    for number in commas:
        number.text = (number.text or "").replace(",", ".")
    return (tostring(root) if dangling or commas else data), dangling


def _tag(element: Element) -> str:
    return element.tag.rpartition("}")[2] if isinstance(element.tag, str) else ""


def _reference(element: Element) -> str:
    kind = _tag(element)
    if not kind.startswith("instance_") or kind.removeprefix("instance_") not in INSTANCES:
        return ""
    return element.get("target" if kind == "instance_material" else "url", "")
