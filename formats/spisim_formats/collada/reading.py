"""COLLADA (.dae): triangles, nodes, unit and axes, read with pycollada.

trimesh's loader ignores `unit` and `up_axis`, and drops the names of materials.
"""

import math
from functools import cache, partial
from pathlib import Path
from typing import Any
from xml.etree.ElementTree import Element

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, LimitError
from spisim.scene.polygons import triangulate
from spisim.scene.shapes import check_mesh
from spisim_formats.collada.lamps import light
from spisim_formats.collada.mending import load_document
from spisim_formats.library.content import (
    Axis,
    Content,
    Part,
    Surface,
    readable,
    with_seams,
)
from spisim_formats.library.files import Folders, quoted, read_bytes
from spisim_formats.library.opacity import Opacity, cut
from spisim_formats.library.records import (
    RecordedElement,
    Rest,
    mark,
    plain,
    unread_elements,
    words,
)
from spisim_formats.library.textures import Texture, read_channels
from spisim_formats.library.vertex_colors import Color, mean_color, tinted
from spisim_formats.library.xml import parse_lenient_xml

AXES: dict[str, Axis] = {"X_UP": "x", "Y_UP": "y", "Z_UP": "z"}
#: Cameras look along -z, with x to the right.
LOOKING = np.diag([-1.0, 1.0, -1.0, 1.0])
BOUND = "skins are left out: skinned meshes are in their bind pose"
#: Elements that pycollada reads, or this module, with attributes; all that describe the file only.
READ = words("""
accessor ambient bind_material bind_shape_matrix blinn bool_array camera COLLADA color constant
constant_attenuation controller diffuse directional effect falloff_angle falloff_exponent float
float_array geometry h IDREF_array image init_from input instance_camera instance_controller
instance_effect instance_geometry instance_light instance_material instance_node
instance_visual_scene int_array joints lambert library_cameras library_controllers library_effects
library_geometries library_images library_lights library_materials library_nodes
library_visual_scenes light linear_attenuation lines linestrips lookat material matrix mesh morph
Name_array newparam node optics orthographic p param perspective ph phong point polygons polylist
profile_COMMON quadratic_attenuation rotate sampler2D scale scene SIDREF_array skeleton skin source
spot surface targets technique technique_common texture translate transparency transparent
triangles trifans tristrips v vcount vertex_weights vertices visual_scene
""")
HARMLESS = words("""
asset extra camera/* sampler2D/* surface/* phong/ambient blinn/ambient lambert/ambient
bind_material/bind instance_material/bind instance_material/bind_vertex_input @schemaLocation
skeleton
""")
ATTRIBUTES = words("""
base closed_path count digits id layer magnitude material meter method name offset opaque
profile semantic set sid source stride symbol target texcoord texture type url version
""")
#: Maximum nesting of instanced nodes.
MAX_DEPTH = 400
MAX_NODES = 200_000


def read_collada(path: Path, folders: Folders) -> Content:
    """Read the parts of a COLLADA file; damaged elements are left out with a note.

    Raises InputError if it is not COLLADA, or has no scene.
    """
    content = Content()
    data = read_bytes(path)
    # for what it refuses, too: pycollada's own parser expands entities
    root = parse_lenient_xml(data, path, content.note)
    with readable(str(path), "a COLLADA file"):
        content.records.append((path.name, _unread(root).copy))  # before it is mended
        document = load_document(root, None if content.notes else data, path.name, content)
        _take_asset(document.assetInfo, content)
        scene = document.scene or next(iter(document.scenes), None)
        walk = _Walk(content, _pictures(document, path, folders, content))
        for node in scene.nodes if scene else ():
            walk.add(node, np.eye(4), path.stem, 0)
        content.check_not_empty(path, "holds no triangles" if scene else "has no scene")
        return content


def _unread(root: Element) -> Rest:
    """Return what of a document neither pycollada nor this module reads."""
    waiting = [root]
    while waiting:
        element = waiting.pop()
        if plain(element.tag) in READ and isinstance(element, RecordedElement):
            waiting += element  # what is in others is not read
            mark(element)
            element.asked |= {name for name in element.keys() if plain(name) in ATTRIBUTES}  # noqa: SIM118
    return unread_elements(root, HARMLESS)


def _take_asset(asset: Any, content: Content) -> None:
    """Read unit and axes."""
    content.up = AXES[asset.upaxis]
    content.up_why = f"up_axis of the file: {asset.upaxis}"
    stated = asset.xmlnode.find("{*}up_axis")
    if stated is None or not stated.text:
        content.up_why = "the file has no up_axis, and COLLADA then means y"
    if asset.unitmeter is None:
        content.unit_why = "the file has no unit, and COLLADA then means metres"
        return
    if not 0 < asset.unitmeter < math.inf:
        raise InputError(f"unit: meter should be a positive number; found {asset.unitmeter}")
    content.unit_m = asset.unitmeter
    content.unit_why = f"unit of the file: {asset.unitname or 'unnamed'}, {content.unit_m:g} m"


class _Walk:
    """Adds the content of nodes."""

    def __init__(self, content: Content, pictures: dict[str, Texture | None]) -> None:
        self._content = content
        self._pictures = pictures
        self._meshes: dict[int, list[tuple[trimesh.Trimesh, str | None, Color | None]]] = {}
        self._nodes = 0

    def add(self, node: Any, parent: Floats, name: str, depth: int) -> None:
        """Add a node and its descendants. Raises InputError for too many, as of nested ones."""
        from collada.scene import (
            CameraNode,
            ControllerNode,
            GeometryNode,
            LightNode,
            Node,
            NodeNode,
        )

        self._nodes += 1
        if self._nodes > MAX_NODES:
            raise LimitError(f"more than {MAX_NODES:,} nodes (instances counted)")
        if depth > MAX_DEPTH:
            raise LimitError(f"node {quoted(name)}: nodes are nested more than {MAX_DEPTH} deep")
        if isinstance(node, NodeNode):  # an instance
            node = node.node
        if isinstance(node, Node):
            to_world = parent @ np.asarray(node.matrix, float)
            for child in node.children:
                self.add(child, to_world, node.name or node.id or name, depth + 1)
            return
        with self._content.leaving_out(f"node {quoted(name)}"):
            if isinstance(node, GeometryNode):
                self._add_geometry(node.geometry, node.materials, parent, name)
            elif isinstance(node, ControllerNode):
                self._add_controlled(node, parent, name)
            elif isinstance(node, LightNode):
                self._content.glows += light(node.light, parent, name, self._content)
            elif isinstance(node, CameraNode):
                self._content.cameras.append(parent @ LOOKING)

    def _add_controlled(self, node: Any, to_world: Floats, name: str) -> None:
        """Add a skinned mesh in its bind pose, or a morphed one in its base shape."""
        from collada.controller import Morph, Skin

        controller = node.controller
        if isinstance(controller, Skin):
            bind = np.asarray(controller.bind_shape_matrix, float).reshape(4, 4)
            self._content.note(BOUND)
            self._add_geometry(controller.geometry, node.materials, to_world @ bind, name)
        elif isinstance(controller, Morph):
            self._content.note("morphs are left out: their meshes are as they begin")
            self._add_geometry(controller.source_geometry, node.materials, to_world, name)

    def _add_geometry(self, geometry: Any, materials: Any, to_world: Floats, name: str) -> None:
        if id(geometry) not in self._meshes:
            self._meshes[id(geometry)] = _meshes(geometry, self._content)
        surfaces = {
            bound.symbol: _surface(bound.target, self._pictures, self._content)
            for bound in materials
        }
        for mesh, symbol, color in self._meshes[id(geometry)]:
            surface = surfaces.get(symbol, Surface(symbol))
            surface = tinted(surface, color, self._content, name or geometry.name)
            self._content.add(Part(name or geometry.name, mesh, to_world, surface))


def _meshes(
    geometry: Any, content: Content
) -> list[tuple[trimesh.Trimesh, str | None, Color | None]]:
    """Return triangles of a geometry, the symbol of their material, and their mean colour."""
    from collada.polylist import Polylist
    from collada.triangleset import TriangleSet

    name = geometry.name or geometry.id
    result = []
    for primitive in geometry.primitives:
        with content.leaving_out(f"geometry {quoted(name)}"):
            triangles = primitive
            if isinstance(primitive, Polylist) and primitive.vertex is not None:
                cut = triangulate(primitive.vertex, primitive.vcounts, primitive.vertex_index)
                if cut.fault:
                    content.note(f"geometry {quoted(name)}: {cut.fault}")
                index = primitive.index[cut.corners].ravel()
                triangles = TriangleSet(primitive.sources, primitive.material, index)
            if not isinstance(triangles, TriangleSet) or triangles.vertex is None:
                content.note(f"geometry {quoted(name)}: lines are left out")
                continue
            mesh = trimesh.Trimesh(triangles.vertex, triangles.vertex_index, process=False)
            check_mesh(mesh, name)
            color = _color(triangles, mesh.area_faces)
            mesh.remove_unreferenced_vertices()
            result.append((_textured(triangles, mesh), primitive.material, color))
    return result


def _color(triangles: Any, areas: Any) -> Color | None:
    """Return the mean of the colours at the triangles' corners, if there are any."""
    given = triangles.sources.get("COLOR")
    if not given or len(areas) != len(triangles.index):
        return None
    return mean_color(given[0][4].data, triangles.index[:, :, given[0][0]], areas)


def _textured(triangles: Any, mesh: trimesh.Trimesh) -> trimesh.Trimesh:
    """Add the first texture coordinates to a mesh, splitting vertices where they differ."""
    if not len(triangles.texcoordset):
        return mesh
    uv, numbers = np.asarray(triangles.texcoordset[0]), np.asarray(triangles.texcoord_indexset[0])
    if numbers.shape != triangles.vertex_index.shape or not numbers.max(initial=0) < len(uv):
        return mesh
    return with_seams(triangles.vertex, triangles.vertex_index, uv, numbers)


def _opacity(
    effect: Any, pictures: dict[str, Texture | None], name: str, content: Content
) -> Opacity | None:
    """Return what of an effect is opaque.

    Of one that is transparent altogether nothing is taken, because exporters write it for opaque
    ones.
    """
    given, factor = getattr(effect, "transparent", None), getattr(effect, "transparency", None)
    alpha = 1.0 if factor is None else float(factor)
    by_color = given is not None and effect.opaque_mode == "RGB_ZERO"
    fraction: Any = 1.0
    if (sampler := getattr(given, "sampler", None)) is not None:
        texture = pictures.get(sampler.surface.image.id)
        if texture is None:
            raise InputError("its picture is missing")
        (fraction,) = read_channels(texture, 0 if by_color else 3)
    elif given is not None and len(given) >= 3:
        fraction = float(np.mean(given[:3])) if by_color else float([*given, 1.0][3])
    opaque = np.atleast_2d(1 - alpha * fraction if by_color else alpha * fraction)
    if not (opaque > 0).any():
        content.warn(f"material {quoted(name)}: transparent altogether; it is taken for opaque")
        return None
    return cut(opaque.astype(np.float32))


def _surface(material: Any, pictures: dict[str, Texture | None], content: Content) -> Surface:
    name = material.name or material.id
    opaque = partial(_opacity, material.effect, pictures, name, content)
    opacity = cache(partial(content.attempt, f"material {quoted(name)}: opacity", opaque))
    diffuse = getattr(material.effect, "diffuse", None)
    sampler = getattr(diffuse, "sampler", None)
    if sampler is not None:
        texture = pictures.get(sampler.surface.image.id)
        return Surface(name, texture=texture, opacity=opacity)
    if not isinstance(diffuse, tuple | list) or len(diffuse) < 3:  # nothing
        return Surface(name, opacity=opacity)
    red, green, blue = (float(value) for value in diffuse[:3])
    return Surface(name, (red, green, blue), opacity=opacity)


def _pictures(
    document: Any, path: Path, folders: Folders, content: Content
) -> dict[str, Texture | None]:
    """Return textures by id, with a note on missing files."""
    what = f"{path.name}: texture"
    return {
        image.id: content.texture(image.path or "", path.parent, folders, what)
        for image in document.images
    }
