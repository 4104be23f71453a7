"""Things found by name: those of a folder here, and those that other packages add.

A registry's own entries are the modules of one package, by their file names (`zero_filled.py` is
"zero-filled"), each of which holds its entry under the registry's ``attribute``; folders, and
modules whose names begin with an underscore, are none. Other packages add theirs as entry points
of the registry's ``group``, by name, each of which points to an entry itself.
"""

import sys
import warnings
from collections.abc import Iterator, Mapping
from functools import cached_property, lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from typing import Any, Generic, TypeVar, cast

from .errors import InputError, nearest

Entry = TypeVar("Entry")


class Registry(Mapping[str, Entry], Generic[Entry]):
    """Entries of one ``kind``, as "image method", by name; imported when first asked for.

    Raises InputError for an unknown name, telling the nearest, for one that several packages
    register, and where another package's entry cannot be loaded.
    """

    def __init__(self, kind: str, *, package: str, attribute: str, group: str) -> None:
        self.kind = kind
        self.group = group
        self._package = package
        self._attribute = attribute
        self._loaded: dict[str, Entry] = {}

    def __getitem__(self, name: str) -> Entry:
        """The entry of this name."""
        if name not in self._loaded:
            self._loaded[name] = self._load(name)
        return self._loaded[name]

    def __iter__(self) -> Iterator[str]:
        """Names, own ones first, in alphabetical order."""
        yield from self._own
        yield from (name for name in self._others if name not in self._own)

    def loadable(self) -> Iterator[tuple[str, Entry]]:
        """Names and entries; those of other packages that cannot be used are warned of."""
        for name in self:
            try:
                yield name, self[name]
            except InputError as error:
                warnings.warn(str(error), stacklevel=2)

    def __len__(self) -> int:
        """Number of names."""
        return len(list(iter(self)))

    def __contains__(self, name: object) -> bool:
        """Whether there is an entry of this name; it is not loaded."""
        return name in self._own or name in self._others

    @cached_property
    def _own(self) -> dict[str, str]:
        """Modules by name of entry."""
        home = import_module(self._package)
        modules = [module.name for module in iter_modules(home.__path__) if not module.ispkg]
        return {name.replace("_", "-"): name for name in sorted(modules) if name[0] != "_"}

    @cached_property
    def _others(self) -> dict[str, list[EntryPoint]]:
        found: dict[str, list[EntryPoint]] = {}
        points = _entry_points(tuple(sys.path)).select(group=self.group)
        for point in sorted(points, key=lambda point: point.name):
            found.setdefault(point.name, []).append(point)
        return found

    def _load(self, name: str) -> Entry:
        if name not in self:
            raise InputError(f"unknown {self.kind} {name!r}: {nearest(name, self)}")
        owners = [self._package] if name in self._own else []
        points = self._others.get(name, [])
        owners += [f"{_owner(point)} ({point.value})" for point in points]
        if len(owners) > 1:
            raise InputError(
                f"{self.kind} {name!r} is registered by {' and by '.join(owners)}: uninstall all "
                "but one, or rename theirs"
            )
        if not points:
            module = import_module(f"{self._package}.{self._own[name]}")
            return cast(Entry, getattr(module, self._attribute))
        try:
            return cast(Entry, points[0].load())
        except Exception as error:  # whatever another package does when it is imported
            raise InputError(
                f"{self.kind} {name!r} of {owners[0]} cannot be loaded: "
                f"{type(error).__name__}: {error}"
            ) from error


@lru_cache(maxsize=1)
def _entry_points(path: tuple[str, ...]) -> Any:
    """Those of all packages on the ``path``, which takes a while to search."""
    return entry_points()


def _owner(point: EntryPoint) -> str:
    """Name of the distribution that has an entry point."""
    return "an unnamed package" if point.dist is None else point.dist.name
