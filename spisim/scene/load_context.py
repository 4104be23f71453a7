"""What a scene is loaded with: where its files are, its wavelength, and a cache of its parts."""

from __future__ import annotations

from collections import OrderedDict
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from dataclasses import dataclass, field
from pathlib import Path

from reconstruction.base.errors import InputError
from spisim.scene.content import surface_content
from spisim.scene.families import SceneBuilder
from spisim.scene.model import SceneObject

#: Maximum cached scenes and triangles; the latest scene stays whatever its size.
MAX_SCENES = 32
MAX_TRIANGLES = 250_000


@dataclass(frozen=True, eq=False)
class _Cached:
    objects: tuple[SceneObject, ...]
    content: bytes  # digest when the objects were made

    @property
    def triangles(self) -> int:
        return sum(len(thing.mesh.faces) for thing in self.objects)


class SceneCache:
    """Cache of the objects and draws of the latest scenes, by everything they are made from.

    Scenes share the meshes of their objects; objects that were modified since are made again.
    """

    def __init__(self) -> None:
        self._objects: OrderedDict[bytes, _Cached] = OrderedDict()
        self._builders: OrderedDict[str, SceneBuilder] = OrderedDict()

    def objects(
        self, key: bytes, make: Callable[[], tuple[SceneObject, ...]]
    ) -> tuple[SceneObject, ...]:
        """Objects cached under a key, made if they are missing or have been changed."""
        cached = self._objects.pop(key, None)
        if cached is None or surface_content(cached.objects) != cached.content:
            objects = make()
            cached = _Cached(objects, surface_content(objects))
        self._objects[key] = cached
        while len(self._objects) > 1 and self._is_full:
            self._objects.popitem(last=False)
        return cached.objects

    def builder(self, key: str, make: Callable[[], SceneBuilder]) -> SceneBuilder:
        """The draw of this key, made if it is missing."""
        cached = self._builders.pop(key, None)
        self._builders[key] = make() if cached is None else cached
        if len(self._builders) > MAX_SCENES:
            self._builders.popitem(last=False)
        return self._builders[key]

    @property
    def _is_full(self) -> bool:
        triangles = sum(cached.triangles for cached in self._objects.values())
        return len(self._objects) > MAX_SCENES or triangles > MAX_TRIANGLES


@dataclass(frozen=True)
class LoadContext:
    """Source, folder and wavelength of a description, and the cache of other scenes' parts."""

    folder: Path
    text: str
    source: Path | str
    wavelength_nm: float = 1550.0
    cache: SceneCache = field(default_factory=SceneCache)

    @contextmanager
    def problems_at(self, location: str) -> Iterator[None]:
        """Prefix the message of an InputError with file and field."""
        try:
            yield
        except InputError as error:
            raise InputError(f"{self.source}: {location}: {error}") from None
