"""Entries by name: those of a folder here, and those that other packages or programs add.

Entries are the modules of a package, by their file names (`zero_filled.py` is "zero-filled"), each
of which holds its entry under the registry's ``attribute``; folders, and modules whose names begin
with an underscore, are none. Other packages add theirs as entry points of the registry's ``group``:
each names an entry itself (``package.module:OBJECT``), or a package of such modules (``package``).
A program adds an entry to its own process by `Registry.register`.
"""

import re
import sys
import warnings
from collections.abc import Callable, Iterator, Mapping
from functools import cached_property, lru_cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from pkgutil import iter_modules
from typing import Any, Generic, NamedTuple, TypeVar, cast

from .errors import InputError, nearest

Entry = TypeVar("Entry")

NAME = re.compile(r"[^\W_][\w.-]*", re.ASCII)
RESERVED = ("default", "usual", "all")
"""Words that stand for several entries."""


class _Source(NamedTuple):
    """Origin of an entry in words, and how to load it."""

    owner: str
    load: Callable[[], Any]


class Registry(Mapping[str, Entry], Generic[Entry]):
    """Entries of one ``kind``, such as "image method", by name; imported when first requested.

    ``package`` contains the registry's own entries, if any; ``hint`` is advice for an empty
    registry.

    Raises InputError for an unknown name, with the nearest one, for a name that several packages
    register, and if another package's entry cannot be loaded.
    """

    def __init__(
        self, kind: str, *, attribute: str, group: str, package: str | None = None, hint: str = ""
    ) -> None:
        self.kind = kind
        self.group = group
        self._package = package
        self._attribute = attribute
        self._hint = hint
        self._loaded: dict[str, Entry] = {}

    def __getitem__(self, name: str) -> Entry:
        """Entry of this name."""
        if name not in self._loaded:
            self._loaded[name] = self._load(name)
        return self._loaded[name]

    def register(self, name: str, entry: Entry) -> None:
        """Add an entry of this process; InputError, naming both, where the name is taken."""
        check_name(self.kind, name)
        if name in self and self._loaded.get(name) is not entry:
            raise InputError(
                f"{self.kind} {name!r} is registered by {self.owners(name)} already: "
                f"give {_place(entry)} another name"
            )
        self._sources[name] = [_Source(_place(entry), lambda: entry)]
        self._loaded[name] = entry

    def owners(self, name: str) -> str:
        """Packages and objects that register a name."""
        return " and by ".join(source.owner for source in self._sources[name])

    def __iter__(self) -> Iterator[str]:
        """Names, those of packages of modules first, in alphabetical order."""
        return iter(self._sources)

    def loadable(self) -> Iterator[tuple[str, Entry]]:
        """Names and entries, with a warning for each foreign entry that cannot be used."""
        for name in self:
            try:
                yield name, self[name]
            except InputError as error:
                warnings.warn(str(error), stacklevel=2)

    def __len__(self) -> int:
        """Number of names."""
        return len(self._sources)

    def __contains__(self, name: object) -> bool:
        """Whether an entry of this name exists; it is not loaded."""
        return name in self._sources

    @cached_property
    def _sources(self) -> dict[str, list[_Source]]:
        """Sources by name: the registry's own package, other packages, single entries."""
        points = sorted(
            _entry_points(tuple(sys.path)).select(group=self.group), key=lambda each: each.name
        )
        sources = {} if self._package is None else self._modules(self._package, self._package)
        for point in points:
            if not point.attr:
                for name, added in self._modules(point.module, _owner(point)).items():
                    sources.setdefault(name, []).extend(added)
        for point in points:
            if point.attr:
                source = _Source(f"{_owner(point)} ({point.value})", point.load)
                sources.setdefault(point.name, []).append(source)
        return sources

    def _modules(self, package: str, owner: str) -> dict[str, list[_Source]]:
        """Sources of a package's modules, with a warning if a foreign one cannot be imported."""
        try:
            home = import_module(package)
        except Exception as error:
            if package == self._package:
                raise
            reason = f"{type(error).__name__}: {error}"
            message = f"{self.kind}s of {owner} ({package}) cannot be loaded: {reason}"
            warnings.warn(message, stacklevel=2)
            return {}

        def source(module: str) -> _Source:
            return _Source(
                owner, lambda: getattr(import_module(f"{package}.{module}"), self._attribute)
            )

        modules = [each.name for each in iter_modules(home.__path__) if not each.ispkg]
        return {
            name.replace("_", "-"): [source(name)] for name in sorted(modules) if name[0] != "_"
        }

    def _load(self, name: str) -> Entry:
        sources = self._sources.get(name, [])
        if not sources:
            hint = nearest(name, self) if self._sources else f"there is none; {self._hint}"
            raise InputError(f"unknown {self.kind} {name!r}: {hint}")
        if len(sources) > 1:
            raise InputError(
                f"{self.kind} {name!r} is registered by {self.owners(name)}: uninstall all but "
                "one, or rename theirs"
            )
        (source,) = sources
        if source.owner == self._package:  # our own faults are not input errors
            return cast(Entry, source.load())
        try:
            return cast(Entry, source.load())
        except Exception as error:  # whatever importing another package raises
            raise InputError(
                f"{self.kind} {name!r} of {source.owner} cannot be loaded: "
                f"{type(error).__name__}: {error}"
            ) from error


def check_name(kind: str, name: object) -> None:
    """Raise InputError unless a name can stand in lists of names, file names and datasets."""
    if not (isinstance(name, str) and NAME.fullmatch(name)) or name in RESERVED:
        raise InputError(
            f"{kind} {name!r}: a name has letters, digits, '-', '_' and '.', begins with a letter "
            f"or digit, and is none of {', '.join(RESERVED)}"
        )


def _place(entry: object) -> str:
    """Where an object of this process comes from."""
    source: Any = entry if hasattr(entry, "__qualname__") else type(entry)
    return f"{source.__module__}.{source.__qualname__}"


@lru_cache(maxsize=1)
def _entry_points(path: tuple[str, ...]) -> Any:
    """Entry points of all packages on the ``path``, cached because the search is slow."""
    return entry_points()


def _owner(point: EntryPoint) -> str:
    """Name of the distribution of an entry point."""
    return "an unnamed package" if point.dist is None else point.dist.name
