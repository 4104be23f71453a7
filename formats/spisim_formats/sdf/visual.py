"""Geometry and material of a `<visual>` of SDFormat."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from functools import cache, partial
from pathlib import Path
from xml.etree.ElementTree import Element

import numpy as np
import trimesh

from reconstruction.base.errors import InputError, naming, nearest
from spisim.base.config.files import grey_picture
from spisim.scene.shapes import check_triangles
from spisim_formats.format import readers
from spisim_formats.library import shapes
from spisim_formats.library.content import (
    Content,
    Part,
    Shape,
    Surface,
    pose_faults,
    scaling,
    translation,
)
from spisim_formats.library.files import Folders
from spisim_formats.library.metallic import Metallic
from spisim_formats.library.opacity import Opacity, cut, times
from spisim_formats.library.records import mark_all
from spisim_formats.library.source_material import SourceMaterial
from spisim_formats.library.textures import Texture, read_channels
from spisim_formats.library.units import to_metres
from spisim_formats.library.xml import numbers

#: Texture elements by property, and those that are left out.
MAPS = {"albedo_map": "base", "metalness_map": "metal", "roughness_map": "roughness"}
MORE_MAPS = {"normal_map": "bumps are", "emissive_map": "own light is"}
#: Alpha of albedo maps from which Gazebo draws a surface.
ALPHA_CUTOFF = 0.5
#: Geometries of Gazebo that are not read.
LEFT_OUT = ("polyline", "image", "empty")


class Visuals:
    """Reads visuals; a mesh file used by several is read once."""

    def __init__(self, folders: Folders, content: Content) -> None:
        self.content = content
        self._folders = folders
        self._files: dict[Path, list[Part]] = {}
        self._faults: dict[Path, InputError] = {}
        self._cut_outs: dict[Path | bytes, Opacity | None] = {}

    def read(self, visual: Element, path: Path, what: str) -> list[Part]:
        """Return the parts of a visual in its own frame; files are searched beside `path`."""
        transparency = _number(visual, "transparency", 0.0, what)
        if transparency >= 1:
            self.content.note(f"{what}: is fully transparent and left out")
            mark_all(visual)
            return []
        parts = self._read(visual, path, what)
        if not transparency > 0:
            return parts
        return [replace(part, surface=_thinner(part.surface, 1 - transparency)) for part in parts]

    def _read(self, visual: Element, path: Path, what: str) -> list[Part]:
        geometry = visual.find("geometry")
        kinds = [] if geometry is None else [child for child in geometry if child.tag in AVAILABLE]
        if not kinds:
            if geometry is None or not len(geometry):
                self.content.note(f"{what}: has no geometry")
                return []
            result = ", ".join(child.tag for child in geometry)
            raise InputError(f"{what}: geometry {result:.80} is unknown: {nearest('', AVAILABLE)}")
        kind = kinds[0]
        surface = None
        with self.content.leaving_out(f"{what}: material"):
            surface = self._surface(visual, path, what)
        if kind.tag in LEFT_OUT:
            mark_all(kind)
            if kind.tag != "empty":
                self.content.note(f"{what}: geometry {kind.tag} is left out")
            return []
        if kind.tag in FROM_FILES:
            return FROM_FILES[kind.tag](self, kind, surface, path, what)
        shape, pose = SHAPES[kind.tag](kind, what), np.eye(4)
        if kind.tag == "plane":
            pose = _facing(kind, what)
        return [Part("", shape, pose, surface or Surface())]

    def _mesh(self, element: Element, surface: Surface | None, path: Path, what: str) -> list[Part]:
        uri = (element.findtext("uri") or "").strip()
        parts = self._load(self._folders.find(uri, path.parent, f"{what}: mesh"), what)
        if (submesh := element.find("submesh")) is not None:
            parts = _only(parts, submesh, what)
        factors = numbers(element.findtext("scale") or "1 1 1", 3, f"{what}: scale")
        grown = scaling(factors)
        for fault in pose_faults(grown[None]).values():
            raise InputError(f"{what}: scale {factors}: {fault}")
        return [
            Part(part.name, part.geometry, grown @ part.to_world, surface or part.surface)
            for part in parts
        ]

    def _heightmap(
        self, element: Element, surface: Surface | None, path: Path, what: str
    ) -> list[Part]:
        uri = (element.findtext("uri") or "").strip()
        file = self._folders.find(uri, path.parent, f"{what}: heightmap")
        size = numbers(element.findtext("size") or "1 1 1", 3, f"{what}: size")
        start = numbers(element.findtext("pos") or "0 0 0", 3, f"{what}: pos")
        with naming(f"{what}: heightmap"):
            mesh = heightmap(file, size)
        words = () if surface is None else surface.words
        ground = Surface("terrain", None, words)
        return [Part("terrain", mesh, translation(start), ground)]

    def _load(self, path: Path, what: str) -> list[Part]:
        """Return the parts of a mesh file in metres.

        As in Gazebo, a unit applies, but the axes stay as they are in the file, because Gazebo's
        meshes have z up whatever up_axis says (gz-common, AssimpLoader).
        """
        suffix = path.suffix.lower()
        given = readers(meshes_alone=True)
        if suffix not in given:
            raise InputError(f"{what}: mesh {path.name!r}: {nearest(suffix, given)}")
        if path in self._faults:
            raise self._faults[path]
        if path not in self._files:
            try:
                with naming(f"{what}: mesh"):
                    content = given[suffix](path, self._folders)
            except InputError as error:
                self._faults[path] = error
                raise
            content.up = "z"
            self._files[path] = to_metres(content, 1.0).parts
            loaded = (part for parts in self._files.values() for part in parts)
            check_triangles(sum(len(shapes.as_mesh(part.geometry).faces) for part in loaded))
            self.content.adopt(content)
        return self._files[path]

    def _surface(self, visual: Element, path: Path, what: str) -> Surface | None:
        """Return the material of a visual, or None without one."""
        material = visual.find("material")
        if material is None:
            return None
        script = (material.findtext("script/name") or "").strip()
        named = [
            (element.tag, element.text.strip())
            for element in material.iter()
            if element.tag.endswith("_map") and element.text and element.text.strip()
        ]
        textures = {
            tag: self.content.texture(name, path.parent, self._folders, f"{what}: texture")
            for tag, name in named
        }
        color = _color(material, what)
        words = tuple(Path(name).stem for _, name in named)
        if float(_number(material, "pbr/metal/metalness", 0.0, what)) >= 0.5 and not words:
            words = ("metal",)
        material.findall(".//albedo_map")  # counts it as read
        name = script.rpartition("/")[2] or None
        albedo = textures.get("albedo_map")
        opacity = None if albedo is None else partial(self._cut_out, albedo, what)
        whole = partial(_source, visual, color, textures, opacity, what)
        source = cache(partial(self.content.attempt, f"{what}: material", whole))
        color = None if named else color
        return Surface(name, color, words, albedo, source, opacity)

    def _cut_out(self, albedo: Texture, what: str) -> Opacity | None:
        """Return the opacity of an albedo map; Gazebo cuts its alpha (gz-sim, SceneManager.cc)."""
        if albedo.source not in self._cut_outs:
            read = partial(read_channels, albedo, 3)
            alpha = self.content.attempt(f"{what}: opacity", read)
            self._cut_outs[albedo.source] = None if alpha is None else cut(alpha[0], ALPHA_CUTOFF)
        return self._cut_outs[albedo.source]


def _thinner(surface: Surface, factor: float) -> Surface:
    return replace(surface, opacity=cache(partial(times, factor, surface.opacity)))


def _source(
    visual: Element,
    color: tuple[float, float, float] | None,
    textures: dict[str, Texture | None],
    opacity: Callable[[], Opacity | None] | None,
    what: str,
) -> SourceMaterial | None:
    surface = _metallic(visual, color, textures, opacity, what)
    return None if surface is None else surface.source_material()


def _metallic(
    visual: Element,
    color: tuple[float, float, float] | None,
    textures: dict[str, Texture | None],
    opacity: Callable[[], Opacity | None] | None,
    what: str,
) -> Metallic | None:
    """Return the material by metalness and roughness, if a visual has them."""
    metal = visual.find("material/pbr/metal")
    read = {name: textures[tag] for tag, name in MAPS.items() if tag in textures}
    for tag in (*MAPS, *MORE_MAPS):
        visual.findall(f"material/pbr/metal/{tag}")  # counts them as read
    if metal is None or None in read.values():
        return None
    # a texture alone replaces the number; without either, SDFormat's default
    fraction, roughness = (
        _number(metal, tag, 1.0 if f"{tag}_map" in textures else 0.5, what)
        for tag in ("metalness", "roughness")
    )
    odd = tuple(f"its {title} left out" for tag, title in MORE_MAPS.items() if tag in textures)
    return Metallic(
        1.0 if color is None else color[0],
        fraction,
        roughness,
        opacity=times(1 - max(_number(visual, "transparency", 0.0, what), 0.0), opacity),
        pictures={name: (texture, 0) for name, texture in read.items() if texture is not None},
        odd=odd,
    )


def _only(parts: list[Part], submesh: Element, what: str) -> list[Part]:
    """Return the parts of one name, centred if asked for."""
    name = (submesh.findtext("name") or "").strip()
    # trimesh names groups of OBJ by their names and their materials
    chosen = [part for part in parts if part.name in (name, f"{name}_{part.surface.name}")]
    if not chosen:
        candidate = nearest(name, dict.fromkeys(part.name for part in parts))
        raise InputError(f"{what}: no submesh {name[:80]!r}: {candidate}")
    if (submesh.findtext("center") or "").strip().lower() not in ("true", "1"):
        return chosen
    corners = [
        shapes.as_mesh(part.geometry).copy().apply_transform(part.to_world).bounds
        for part in chosen
    ]
    middle = np.eye(4)
    middle[:3, 3] = -(np.min(corners, axis=(0, 1)) + np.max(corners, axis=(0, 1))) / 2
    return [Part(p.name, p.geometry, middle @ p.to_world, p.surface) for p in chosen]


def _facing(plane: Element, what: str) -> np.ndarray:
    """Return the pose (4, 4) that turns z to the normal of a plane."""
    normal = np.array(numbers(plane.findtext("normal") or "0 0 1", 3, f"{what}: normal"))
    if not np.linalg.norm(normal) > 0:
        raise InputError(f"{what}: the normal of the plane is zero")
    return np.asarray(trimesh.geometry.align_vectors([0, 0, 1], normal / np.linalg.norm(normal)))


def _color(material: Element, what: str) -> tuple[float, float, float] | None:
    for tag in ("diffuse", "ambient"):
        text = material.findtext(tag)
        if text is not None and text.strip():
            count = len(text.split())
            red, green, blue = numbers(text, max(3, min(count, 4)), f"{what}: {tag}")[:3]
            return red, green, blue
    return None


def _number(element: Element, tag: str, default: float, what: str) -> float:
    text = element.findtext(tag)
    return default if text is None else numbers(text, 1, f"{what}: {tag}")[0]


def _lengths(element: Element, tag: str, default: str, what: str) -> list[float]:
    """Return numbers of an element, or SDFormat's default if it is missing."""
    text = default if element.find(tag) is None else element.findtext(tag)
    return numbers(text, len(default.split()), f"{what}: {element.tag}: {tag}")


def _radius_and_length(element: Element, radius: str, what: str) -> tuple[float, float]:
    return _lengths(element, "radius", radius, what)[0], _lengths(element, "length", "1", what)[0]


SHAPES: dict[str, Callable[[Element, str], trimesh.Trimesh | Shape]] = {
    "box": lambda row, what: shapes.box(_lengths(row, "size", "1 1 1", what), what),
    "sphere": lambda row, what: shapes.sphere(_lengths(row, "radius", "1", what)[0], what),
    "cylinder": lambda row, what: shapes.cylinder(*_radius_and_length(row, "1", what), what),
    "plane": lambda row, what: shapes.rectangle(_lengths(row, "size", "1 1", what), what),
    "ellipsoid": lambda row, what: shapes.ellipsoid(_lengths(row, "radii", "1 1 1", what), what),
    "capsule": lambda row, what: shapes.capsule(*_radius_and_length(row, "0.5", what), what),
    "cone": lambda row, what: shapes.cone(*_radius_and_length(row, "0.5", what), what),
}
FROM_FILES = {"mesh": Visuals._mesh, "heightmap": Visuals._heightmap}
AVAILABLE = (*SHAPES, *FROM_FILES, *LEFT_OUT)


#: Maximum vertices along each edge.
MAX_VERTICES = 1025


def heightmap(path: Path, size: Sequence[float]) -> trimesh.Trimesh:
    """Return a surface over a rectangle about the origin, `size` metres in x, y, z, from a PNG.

    https://gazebosim.org/api/sim/8/, "Heightmaps": black is lowest, white is the size's z above it,
    and the top of the image is north (+y). Raises InputError for an invalid size or image.
    """
    if not min(size[:2]) > 0 or not size[2] != 0:
        raise InputError(f"size should be positive; found {', '.join(map(str, size))}")
    heights = grey_picture(path)
    if min(heights.shape) < 2:
        raise InputError(f"{path.name!r} has one row or column of heights")
    rows, columns = (
        np.unique(np.linspace(0, count - 1, min(count, MAX_VERTICES)).round().astype(int))
        for count in heights.shape
    )
    x = (columns / (heights.shape[1] - 1) - 0.5) * size[0]
    y = (0.5 - rows / (heights.shape[0] - 1)) * size[1]
    points = np.stack([*np.meshgrid(x, y), heights[np.ix_(rows, columns)] * size[2]], axis=-1)
    number = np.arange(len(rows) * len(columns)).reshape(len(rows), len(columns))
    a, b, c, d = number[:-1, :-1], number[:-1, 1:], number[1:, :-1], number[1:, 1:]
    faces = np.concatenate([np.stack([a, c, b], axis=-1), np.stack([b, c, d], axis=-1)])
    return trimesh.Trimesh(points.reshape(-1, 3), faces.reshape(-1, 3), process=False)
