"""The interface of scene file formats, and their registry."""

from __future__ import annotations

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, field
from importlib import import_module
from pathlib import Path
from typing import TYPE_CHECKING, Any, TypeAlias
from xml.etree.ElementTree import Element

from reconstruction.base.errors import InputError
from reconstruction.base.registry import Registry

if TYPE_CHECKING:
    from spisim.scene import Scene
    from spisim_formats.library.content import Content
    from spisim_formats.library.files import Folders

Reader: TypeAlias = "Callable[[Path, Folders], Content]"
"""Reads a file within the allowed folders."""
Writer: TypeAlias = "Callable[[Scene, str, Sequence[Element]], tuple[bytes, dict[str, bytes]]]"
"""From a scene, the name of its folder of meshes, and further elements of an XML format to the
bytes of the scene's file, and those of the folder's files by name."""


@dataclass(frozen=True)
class SceneFormat:
    """A format of scene files of other programs.

    Parameters
    ----------
    title
        str
        Its name for users.
    readers, writers
        mapping of str to callable
        By suffix, in lower case with its dot.
    meshes
        bool
        Whether scenes of other formats may refer to such files as meshes.
    """

    title: str
    readers: Mapping[str, Reader] = field(default_factory=dict)
    writers: Mapping[str, Writer] = field(default_factory=dict)
    meshes: bool = False


SCENE_FORMATS: Registry[SceneFormat] = Registry(
    "scene format",
    attribute="FORMAT",
    group="spisim.scene_formats",
    hint="the formats that come with spisim are missing; reinstall it: pip install spisim",
)
"""The formats by name."""


def readers(*, meshes_alone: bool = False) -> dict[str, Reader]:
    """Return readers by suffix, of all or of mesh formats. Raises InputError as `_by_suffix`."""
    chosen = {n: each for n, each in _formats().items() if each.meshes or not meshes_alone}
    return _by_suffix({name: each.readers for name, each in chosen.items()})


def writers() -> dict[str, Writer]:
    """Return writers by suffix. Raises InputError as `_by_suffix`."""
    return _by_suffix({name: each.writers for name, each in _formats().items()})


def lazily(target: str) -> Callable[..., Any]:
    """Return a function that imports ``module:name`` on its first call; formats load slowly."""
    module, _, name = target.partition(":")

    def call(*args: Any) -> Any:
        return getattr(import_module(module), name)(*args)

    return call


def _formats() -> dict[str, SceneFormat]:
    return dict(SCENE_FORMATS.loadable())


def _by_suffix(tables: Mapping[str, Mapping[str, Any]]) -> dict[str, Any]:
    """Merge all tables. Raises InputError if two formats have the same suffix."""
    owners: dict[str, str] = {}
    for name, table in tables.items():
        for suffix in table:
            if suffix in owners:
                raise InputError(
                    f"scene formats {owners[suffix]!r} and {name!r} both have the suffix {suffix}: "
                    "uninstall one of them"
                )
            owners[suffix] = name
    return {suffix: value for table in tables.values() for suffix, value in table.items()}
