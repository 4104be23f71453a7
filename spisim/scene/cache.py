"""What scenes have in common, made once: draws of families, and objects in their places."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from dataclasses import dataclass
from hashlib import blake2b, file_digest
from pathlib import Path
from typing import TYPE_CHECKING, Any

from spisim.scene.content import mesh_content, surface_content
from spisim.scene.description import MeshObject, SceneDescription
from spisim.scene.model import SceneObject
from spisim.scene.placing import Meshes, placed

if TYPE_CHECKING:
    from spisim.scene.families import SceneBuilder
    from spisim.scene.load_context import LoadContext

#: Scenes whose objects and draws are kept, and triangles of all of them; the last one stays,
#: however many it has.
MAX_SCENES = 32
MAX_TRIANGLES = 250_000


@dataclass(frozen=True, eq=False)
class _Cached:
    objects: tuple[SceneObject, ...]
    content: bytes  # of the objects when they were made

    @property
    def triangles(self) -> int:
        return sum(len(thing.mesh.faces) for thing in self.objects)


class SceneCache:
    """Objects and draws of the scenes made last.

    They are found by all that they are made from, the content of files included. Scenes that are
    made from one stock share the meshes of their objects; where somebody has changed one of these,
    they are made anew.
    """

    def __init__(self) -> None:
        self._objects: OrderedDict[bytes, _Cached] = OrderedDict()
        self._builders: OrderedDict[str, SceneBuilder] = OrderedDict()

    def objects(
        self, described: SceneDescription, context: LoadContext, meshes: Meshes
    ) -> tuple[SceneObject, ...]:
        """Objects of a description; see `placed`."""
        try:
            key = _key(described, context, meshes)
        except OSError:  # of a file that is missing, which `placed` tells of
            return placed(described, context, meshes)
        retained = self._objects.pop(key, None)
        if retained is None or surface_content(retained.objects) != retained.content:
            objects = placed(described, context, meshes)
            retained = _Cached(objects, surface_content(objects))
        self._objects[key] = retained
        while len(self._objects) > 1 and self._is_full:
            self._objects.popitem(last=False)
        return retained.objects

    def builder(self, key: str, make: Callable[[], SceneBuilder]) -> SceneBuilder:
        """The draw of this key, made if it is not there."""
        result = self._builders.pop(key, None)
        self._builders[key] = make() if result is None else result
        if len(self._builders) > MAX_SCENES:
            self._builders.popitem(last=False)
        return self._builders[key]

    @property
    def _is_full(self) -> bool:
        triangles = sum(retained.triangles for retained in self._objects.values())
        return len(self._objects) > MAX_SCENES or triangles > MAX_TRIANGLES


def _key(described: SceneDescription, context: LoadContext, meshes: Meshes) -> bytes:
    """Of all that objects are made from."""
    given = [sorted(own.model_fields_set) for own in described.materials.values()]
    sections = described.objects, described.materials, described.material_swaps
    result = blake2b(repr((*sections, given, context.wavelength_nm)).encode())
    for name, mesh in meshes.items():
        result.update(name.encode() + mesh_content(mesh))
    for path in _files(described, context.folder, meshes):
        if not path.is_file():  # there are pipes and devices without an end
            raise FileNotFoundError(path)
        with path.open("rb") as file:
            result.update(file_digest(file, "blake2b").digest())
    return result.digest()


def _files(described: SceneDescription, folder: Path, meshes: Meshes) -> Iterator[Path]:
    names: list[Any] = [row.mesh for row in described.objects if isinstance(row, MeshObject)]
    yield from (folder / name for name in dict.fromkeys(names) if name not in meshes)
    for own in described.materials.values():
        yield from (folder / name for name in (own.texture, own.opacity) if isinstance(name, str))
