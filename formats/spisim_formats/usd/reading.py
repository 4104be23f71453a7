"""OpenUSD (.usd, .usda, .usdc, .usdz): meshes, shapes, instances, materials, with Pixar's library.

It needs the extra `usd`. The library finds the layers of a stage; those outside of the allowed
folders are rejected before any prim is read.
"""

from __future__ import annotations

from collections.abc import Callable
from contextlib import suppress
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from numpy.typing import NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, LimitError
from spisim.scene.polygons import triangulate
from spisim.scene.shapes import check_mesh, check_triangles
from spisim_formats.library import shapes
from spisim_formats.library.content import (
    LEFT_OUT,
    MAX_PARTS,
    Axis,
    Content,
    Part,
    Shape,
    Surface,
    readable,
    with_seams,
    with_texture_coordinates,
)
from spisim_formats.library.files import Folders, quoted, read_bytes
from spisim_formats.usd.lamps import read_lamp
from spisim_formats.usd.package import check_package
from spisim_formats.usd.rest import unread_prims
from spisim_formats.usd.samples import settle
from spisim_formats.usd.surfaces import read_surface

MAX_LAYERS = 1000
#: Cameras look along -z, with x to the right.
LOOKING = np.diag([-1.0, 1.0, -1.0, 1.0])
AXES: dict[str, Axis] = {"X": "x", "Y": "y", "Z": "z"}
#: Rotations from a shape about z to one about another axis.
ABOUT = {"X": [0.0, 1.0, 0.0], "Y": [-1.0, 0.0, 0.0], "Z": [0.0, 0.0, 0.0]}


def read_usd(path: Path, folders: Folders) -> Content:
    """Read the parts of a stage as at its earliest time; unreadable ones are left out with a note.

    Raises InputError if it is not a stage, or has layers outside of the folders.
    """
    read_bytes(path)
    try:
        from pxr import Usd, UsdGeom, UsdUtils
    except ImportError:
        raise InputError(f"{path}: OpenUSD needs a library: install `spisim[usd]`") from None
    diagnostics = UsdUtils.CoalescingDiagnosticDelegate()  # captures what it would print
    if path.suffix.lower() == ".usdz":
        check_package(path)
    content = Content()
    layers = _readable_layers(path, folders, content)
    with readable(str(path), "OpenUSD"):
        for layer in layers:
            settle(layer, content)
        stage = Usd.Stage.Open(layers[0])
        for layer in stage.GetUsedLayers():
            if file := layer.realPath.partition("[")[0]:
                folders.check_inside(Path(file), file, f"{path}: layer")
        axis = str(UsdGeom.GetStageUpAxis(stage))
        stated = stage.GetRootLayer().pseudoRoot.GetInfo("metersPerUnit")  # of either precision
        unit_m = float(stated or UsdGeom.GetStageMetersPerUnit(stage))
        if not 0 < unit_m < np.inf:
            raise InputError(f"{path}: metersPerUnit should be a positive number; found {unit_m}")
        content.unit_m, content.unit_why = unit_m, f"metersPerUnit of the stage: {unit_m:g}"
        content.up, content.up_why = AXES[axis], f"upAxis: {axis}"
        _Stage(stage, content, folders).read()
        content.records.append((path.name, unread_prims(stage).copy))
        if diagnostics.TakeUncoalescedDiagnostics():
            content.note(f"{path.name}: OpenUSD doubts some of what it says")
        return content


def _readable_layers(top: Path, folders: Folders, content: Content) -> list[Any]:
    """Return the layers of a stage, its own first, kept open until they are composed.

    References of a layer that are missing or unreadable, such as MaterialX if the library lacks it,
    are removed in memory only. Raises InputError for one outside of the folders.
    """
    from pxr import Ar, Sdf

    layers: list[Any] = []
    waiting, seen = [str(top.resolve())], set()
    while waiting:
        if (name := waiting.pop()) in seen:
            continue
        seen.add(name)
        if len(seen) > MAX_LAYERS:
            raise LimitError(f"{top}: is composed of more than {MAX_LAYERS:,} layers")
        with readable(str(top), "OpenUSD"):
            layer = Sdf.Layer.FindOrOpen(name)
            if not layer:
                raise InputError(f"{top}: cannot be read as OpenUSD")
            names = list(layer.GetCompositionAssetDependencies())
        layers.append(layer)
        for reference in filter(None, names):
            what = f"{name}: layer {quoted(reference)}"
            anchored = Sdf.ComputeAssetPathRelativeToLayer(layer, reference)
            result = str(Ar.GetResolver().Resolve(anchored))
            if result:
                folders.check_inside(Path(result.partition("[")[0]), reference, f"{name}: layer")
            if result and _opens(result):
                waiting.append(result)
                continue
            why = "cannot be read as OpenUSD" if result else "there is no such file"
            content.note(f"{LEFT_OUT}{what}: {why}")
            layer.UpdateCompositionAssetDependency(reference, "")
    return layers


def _opens(name: str) -> bool:
    """Return whether the library reads a layer."""
    from pxr import Sdf, Tf

    try:
        return Path(name.partition("[")[0]).is_file() and bool(Sdf.Layer.FindOrOpen(name))
    except Tf.ErrorException:
        return False


class _Stage:
    def __init__(self, stage: Any, content: Content, folders: Folders) -> None:
        from pxr import UsdGeom

        self._stage = stage
        self._content = content
        self._folders = folders
        self._poses = UsdGeom.XformCache()
        self._meshes: dict[str, list[tuple[trimesh.Trimesh | Shape, Any]]] = {}
        self._surfaces: dict[str, Surface] = {}

    def read(self) -> None:
        """Add all visible content, instances included."""
        from pxr import Usd, UsdGeom

        walk = iter(Usd.PrimRange(self._stage.GetPseudoRoot(), Usd.TraverseInstanceProxies()))
        for prim in walk:
            if prim.IsA(UsdGeom.Imageable) and self._is_hidden(prim):
                walk.PruneChildren()
            elif prim.IsA(UsdGeom.PointInstancer):
                with self._content.leaving_out(quoted(str(prim.GetPath()))):
                    self._add_instances(prim)
                walk.PruneChildren()
            else:
                with self._content.leaving_out(quoted(str(prim.GetPath()))):
                    self._add(prim, self._pose(prim))

    def _is_hidden(self, prim: Any) -> bool:
        from pxr import UsdGeom

        displayed_as = UsdGeom.Imageable(prim)
        purpose = displayed_as.GetPurposeAttr().Get()
        return displayed_as.GetVisibilityAttr().Get() == "invisible" or purpose in (
            "proxy",
            "guide",
        )

    def _pose(self, prim: Any) -> Floats:
        """Return the pose in the world; USD's vectors are rows."""
        return np.array(self._poses.GetLocalToWorldTransform(prim)).T

    def _add(self, prim: Any, to_world: Floats) -> None:
        kind = str(prim.GetTypeName())
        if kind not in READERS:
            if kind == "Volume":
                self._content.warn(f"{quoted(str(prim.GetPath()))}: {kind} is left out")
            elif "Light" in kind and kind != "LightFilter":
                self._content.glows += read_lamp(prim, to_world, self._content, self._folders)
            elif kind == "Camera":
                self._content.cameras.append(to_world @ LOOKING)
            return
        original = prim.GetPrimInPrototype() if prim.IsInstanceProxy() else prim
        key = str(original.GetPath())
        if key not in self._meshes:
            self._meshes[key] = READERS[kind](prim, self._content)
            every = (mesh for meshes in self._meshes.values() for mesh, _ in meshes)
            check_triangles(sum(len(shapes.as_mesh(mesh).faces) for mesh in every))
        for geometry, bound in self._meshes[key]:
            name = prim.GetName() if prim.GetName() != "mesh" else prim.GetParent().GetName()
            surface = self._surface(bound)
            if bound is None and (color := _display_color(prim)) is not None:
                surface = replace(surface, color=color)
            self._content.add(Part(name, geometry, to_world, surface))

    def _surface(self, material: Any) -> Surface:
        """Return one surface for all that it is bound to."""
        key = "" if material is None else str(material.GetPath())
        if key not in self._surfaces:
            self._surfaces[key] = Surface(material.GetName() if key else None)
            with self._content.leaving_out(f"material {quoted(key)}"):
                self._surfaces[key] = read_surface(material, self._content, self._folders)
        return self._surfaces[key]

    def _add_instances(self, prim: Any) -> None:
        from pxr import Usd, UsdGeom

        instancer = UsdGeom.PointInstancer(prim)
        now = Usd.TimeCode.Default()
        poses = instancer.ComputeInstanceTransformsAtTime(now, now)
        numbers = instancer.GetProtoIndicesAttr().Get() or []
        if len(numbers) > MAX_PARTS:
            raise LimitError(f"more than {MAX_PARTS:,} parts (instances counted)")
        roots = [self._stage.GetPrimAtPath(p) for p in instancer.GetPrototypesRel().GetTargets()]
        own = self._pose(prim)
        # instances include the prototype's own transform, to which its descendants are relative
        for number, matrix in zip(numbers, poses, strict=False):
            root = roots[number]
            undo = np.linalg.inv(self._pose(root))
            for inner in Usd.PrimRange(root):
                pose = own @ np.array(matrix).T @ undo @ self._pose(inner)
                self._add(inner, pose)


def _mesh_parts(prim: Any, content: Content) -> list[tuple[trimesh.Trimesh | Shape, Any]]:
    """Return triangles of a mesh; subsets with their own material are separate."""
    from pxr import UsdGeom, UsdShade

    made = UsdGeom.Mesh(prim)
    points = np.array(made.GetPointsAttr().Get() or [], float).reshape(-1, 3)
    counts = np.array(made.GetFaceVertexCountsAttr().Get() or [], np.int64)
    corners = np.array(made.GetFaceVertexIndicesAttr().Get() or [], np.int64)
    check_triangles(int(np.maximum(counts - 2, 0).sum()))
    if counts.sum() != len(corners) or (counts < 0).any():
        raise InputError(f"mesh {prim.GetPath()}: its faces and their corners do not fit")
    triangles = triangulate(points, counts, corners)
    if triangles.fault:
        content.note(f"{quoted(str(prim.GetPath()))}: {triangles.fault}")
    cut, owners = triangles.corners, triangles.polygons
    if str(made.GetOrientationAttr().Get()) == "leftHanded":
        cut = cut[:, ::-1]
    bound = _bound(prim)
    parts = []
    left = np.ones(len(counts), bool)
    left[np.array(made.GetHoleIndicesAttr().Get() or [], np.int64)] = False
    subsets = UsdShade.MaterialBindingAPI(prim).GetMaterialBindSubsets()
    for subset in subsets:
        chosen = np.array(subset.GetIndicesAttr().Get() or [], np.int64)
        here = np.zeros(len(counts), bool)
        here[chosen] = True
        left &= ~here
        parts.append((here, _bound(subset.GetPrim()) or bound))
    parts.append((left, bound))
    result: list[tuple[trimesh.Trimesh | Shape, Any]] = []
    for which, material in parts:
        own = cut[np.asarray(which)[owners]]
        if not len(own):
            continue
        mesh = trimesh.Trimesh(points, corners[own], process=False)
        check_mesh(mesh, str(prim.GetPath()))
        with suppress(ValueError, TypeError, IndexError):
            mesh = _textured(mesh, UsdGeom.PrimvarsAPI(prim).GetPrimvar("st"), own)
        mesh.remove_unreferenced_vertices()
        result.append((mesh, material))
    return result


def _textured(mesh: trimesh.Trimesh, uv: Any, cut: NDArray[np.int64]) -> trimesh.Trimesh:
    """Return the mesh with a primvar's texture coordinates, by vertex or by corner of `cut`."""
    if not uv or (kind := str(uv.GetInterpolation())) not in ("vertex", "varying", "faceVarying"):
        return mesh
    values = np.array(uv.ComputeFlattened(), float)
    if kind != "faceVarying":
        return with_texture_coordinates(mesh, values)
    values, numbers = np.unique(values, axis=0, return_inverse=True)
    return with_seams(mesh.vertices, mesh.faces, values, numbers.ravel()[cut])


def _display_color(prim: Any) -> tuple[float, float, float] | None:
    """Return the mean of the colours that a prim without a material is displayed in."""
    from pxr import UsdGeom

    given = UsdGeom.Gprim(prim).GetDisplayColorAttr().Get()
    if given is None or not len(given):
        return None
    red, green, blue = np.mean(np.array(given, float).reshape(-1, 3), axis=0).tolist()
    return red, green, blue


def _bound(prim: Any) -> Any:
    from pxr import UsdShade

    material, _ = UsdShade.MaterialBindingAPI(prim).ComputeBoundMaterial()
    return material.GetPrim() if material else None


def _simple(
    make: Callable[[Any, str], trimesh.Trimesh | Shape],
) -> Callable[[Any, Content], list[tuple[trimesh.Trimesh | Shape, Any]]]:
    def read(prim: Any, _: Content) -> list[tuple[trimesh.Trimesh | Shape, Any]]:
        return [(make(prim, f"{prim.GetTypeName()} {prim.GetPath()}"), _bound(prim))]

    return read


def _about(prim: Any, geometry: trimesh.Trimesh | Shape) -> trimesh.Trimesh:
    """Rotate a shape about z to the prim's axis."""
    axis = str(prim.GetAttribute("axis").Get())
    turn = trimesh.transformations.euler_matrix(*(np.pi / 2 * np.array(ABOUT[axis])))
    return shapes.as_mesh(geometry).copy().apply_transform(turn)


def _get(prim: Any, name: str) -> float:
    return float(prim.GetAttribute(name).Get())


READERS: dict[str, Callable[[Any, Content], list[tuple[trimesh.Trimesh | Shape, Any]]]] = {
    "Mesh": _mesh_parts,
    "Cube": _simple(lambda prim, what: shapes.box([_get(prim, "size")] * 3, what)),
    "Sphere": _simple(lambda prim, what: shapes.sphere(_get(prim, "radius"), what)),
    "Cylinder": _simple(
        lambda prim, what: _about(
            prim, shapes.cylinder(_get(prim, "radius"), _get(prim, "height"), what)
        )
    ),
    "Cone": _simple(
        lambda prim, what: _about(
            prim, shapes.cone(_get(prim, "radius"), _get(prim, "height"), what)
        )
    ),
    "Capsule": _simple(
        lambda prim, what: _about(
            prim, shapes.capsule(_get(prim, "radius"), _get(prim, "height"), what)
        )
    ),
    "Plane": _simple(
        lambda prim, what: _about(
            prim, shapes.rectangle([_get(prim, "width"), _get(prim, "length")], what)
        )
    ),
}
