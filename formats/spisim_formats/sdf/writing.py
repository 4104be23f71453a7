"""Write scenes as Gazebo worlds: SDFormat 1.9, a static model and an OBJ file for each object."""

from collections.abc import Collection, Iterable, Sequence
from xml.etree.ElementTree import Element, SubElement, indent, tostring

import trimesh

from reconstruction.base.files import mark
from spisim.scene.model import Ambient, Scene, SceneObject
from spisim.scene.write import MESH
from spisim_formats.sdf.light import SKY_KLX, SUN_KLX

LIBRARY = "materials.mtl"
SUN = "sun"


def sdf_files(
    scene: Scene, folder: str, further: Sequence[Element] = ()
) -> tuple[bytes, dict[str, bytes]]:
    """Return the world file of a scene, and its meshes and materials by their names in `folder`.

    `further` elements are added to the world. Poses are those of the centres of the objects'
    bounds; daylight is the inverse of an import. Names that SDFormat forbids are changed.
    """
    root = Element("sdf", version="1.9")
    taken = {SUN, *(element.get("name", "") for element in further)}
    world = SubElement(root, "world", name=_allowed_name(scene.name, ()))
    world.extend(further)
    _add_daylight(world, scene.ambient)
    files = {LIBRARY: _library(scene)}
    for number, thing in enumerate(scene.objects):
        files[f"object-{number}.obj"] = _obj(thing)
        middle = thing.mesh.bounds.mean(axis=0)
        name = _allowed_name(thing.name, taken)
        taken.add(name)
        model = SubElement(world, "model", name=name)
        SubElement(model, "static").text = "true"
        SubElement(model, "pose").text = f"{_numbers(middle)} 0 0 0"
        visual = SubElement(SubElement(model, "link", name="link"), "visual", name="visual")
        mesh = SubElement(SubElement(visual, "geometry"), "mesh")
        SubElement(mesh, "uri").text = f"{folder}/object-{number}.obj"
    indent(root)
    return tostring(root, "utf-8", xml_declaration=True), files


def _allowed_name(name: str, taken: Collection[str]) -> str:
    """Return a name allowed by SDFormat: without ``::``, not reserved, unique among siblings."""
    allowed = name.replace("::", "_")
    if allowed == "world" or (allowed.startswith("__") and allowed.endswith("__")):
        allowed = f"scene {allowed}"
    while allowed in taken:
        allowed += "_"
    return allowed


def _add_daylight(world: Element, ambient: Ambient) -> None:
    scene = SubElement(world, "scene")
    SubElement(scene, "ambient").text = _numbers([min(1.0, ambient.sky_klx / SKY_KLX)] * 3 + [1])
    if ambient.sun_klx > 0:
        sun = SubElement(world, "light", name=SUN, type="directional")
        SubElement(sun, "direction").text = _numbers(ambient.sun_direction)
        SubElement(sun, "diffuse").text = "1 1 1 1"
        SubElement(sun, "intensity").text = _numbers([ambient.sun_klx / SUN_KLX])


def _obj(thing: SceneObject) -> bytes:
    """Return an object about the centre of its bounds, with exact numbers."""
    points = thing.mesh.vertices - thing.mesh.bounds.mean(axis=0)
    look = trimesh.visual.TextureVisuals(uv=getattr(thing.mesh.visual, "uv", None))
    bare = trimesh.Trimesh(points, thing.mesh.faces, process=False, visual=look)
    text = trimesh.exchange.obj.export_obj(
        bare, include_normals=False, include_color=False, write_texture=False, digits=17
    )
    rows = [row for row in text.splitlines() if row[:2] in ("v ", "vt", "f ")]
    where = next(k for k, row in enumerate(rows) if row.startswith("f "))
    head = [f"# {mark(MESH)}", f"mtllib {LIBRARY}"]
    return "\n".join(
        [*head, *rows[:where], f"usemtl {thing.material.name}", *rows[where:], ""]
    ).encode()


def _library(scene: Scene) -> bytes:
    grey = {thing.material.name: thing.material.reflectance for thing in scene.objects}
    rows = [f"newmtl {name}\nKd {_numbers([value] * 3)}" for name, value in grey.items()]
    return "\n".join([f"# {mark(MESH)}", *rows, ""]).encode()


def _numbers(values: Iterable[float]) -> str:
    return " ".join(repr(float(value)) for value in values)
