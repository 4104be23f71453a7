"""Files that an import may read: those in given folders, not through links or `..`."""

from __future__ import annotations

import os
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlsplit

from reconstruction.base.errors import InputError, LimitError, nearest

MAX_FILE_BYTES = 2 * 1024**3

#: Characters of a reference that messages quote.
MAX_QUOTED = 200

#: Schemes that begin with the name of a model in one of the folders.
MODEL_SCHEMES = ("model", "package")
#: Hosts of Gazebo's models as named in its download folder, newest first.
FUEL_HOSTS = ("fuel.gazebosim.org", "fuel.ignitionrobotics.org")


@dataclass(frozen=True)
class Folders:
    """The folders that may be read, with symbolic links resolved.

    `fuel` is Gazebo's folder of downloads.
    """

    roots: tuple[Path, ...]
    fuel: Path | None = None

    @classmethod
    def around(cls, file: Path, more: Sequence[Path] = (), fuel: Path | None = None) -> Folders:
        """Return the folder of a file and the search path. Raises InputError if one is missing."""
        for folder in more:
            if not folder.is_dir():
                raise InputError(f"--model-path {folder}: no such folder")
        roots = tuple(folder.resolve() for folder in (file.parent, *more))
        return cls(roots, None if fuel is None else fuel.resolve())

    def find(self, reference: str, beside: Path, referrer: str, more: Sequence[Path] = ()) -> Path:
        """Return the path of the file or folder that a file in folder `beside` refers to.

        `reference` is a path or a URI: relative to `beside` or `more` folders, `model://name/…` in
        one of the roots, `file://…` in either, or `https://fuel…` in Gazebo's downloads. A file of
        another case, or whose name is in Latin-1, will do. Raises InputError, starting with
        `referrer`, if it is missing, outside the roots, or on the network.
        """
        candidates = self._candidates(reference.strip(), (beside, *more), referrer)
        try:
            resolved = [path.resolve() for path in candidates]
            inside = [path for path in resolved if self._holds(path)]
            result = [path for path in inside if path.exists()]
            if not result:
                other = [path.resolve() for each in inside for path in _alike(each)]
                result = [path for path in other if self._holds(path)]
        except (OSError, RuntimeError, ValueError):  # loops of links, names that cannot be
            raise InputError(f"{referrer}: {quoted(reference)} is no usable path") from None
        if result:
            return result[0]
        if not inside:
            raise self._outside(reference, referrer)
        searched = ", ".join(dict.fromkeys(str(path.parent) for path in inside))
        closed = [str(folder) for folder in more if not self._holds(folder.resolve())]
        hint = f"; --model-path allows to read in {', '.join(closed)}, too" if closed else ""
        raise InputError(f"{referrer}: no file {quoted(reference)}; searched {searched}{hint}")

    def check_inside(self, path: Path, reference: str, referrer: str) -> None:
        """Raise InputError for an existing file that may not be read."""
        if not self._holds(path.resolve()):
            raise self._outside(reference, referrer)

    def _outside(self, reference: str, referrer: str) -> InputError:
        return InputError(
            f"{referrer}: {quoted(reference)} lies outside the folders that may be read "
            f"({self._list()}); copy it there or name its folder with --model-path"
        )

    def _candidates(self, reference: str, searched: Sequence[Path], referrer: str) -> list[Path]:
        if not reference:
            raise InputError(f"{referrer}: the reference to a file is empty")
        scheme, rest = _split(reference)
        beside = [folder / rest for folder in searched] if scheme in ("", "file") else []
        if scheme == "" or (scheme == "file" and rest.startswith("/")):
            return beside
        if scheme in (*MODEL_SCHEMES, "file"):
            rest = rest.lstrip("/")
            first = rest.partition("/")[0]
            # A root folder is found by its own name.
            own = [root.parent / rest for root in self.roots if root.name == first]
            return [*beside, *(root / rest for root in self.roots), *own]
        if scheme in ("http", "https", "ftp", "fuel"):
            if copy := self._downloaded(rest):
                return [copy]
            raise InputError(
                f"{referrer}: {quoted(reference)} is on the network, which is never read; "
                "download it and refer to the file"
            )
        candidate = nearest(scheme, ("model", "file"))
        raise InputError(f"{referrer}: {quoted(reference)} has an unknown scheme: {candidate}")

    def _downloaded(self, address: str) -> Path | None:
        """Return the download of `fuel…/1.0/OWNER/models/NAME[/VERSION/files/FILE]`, or None.

        It is stored under the lower-case names and its version number.
        """
        host, _, path = address.partition("/")
        match path.split("/"):
            case [_, owner, kind, name, *rest] if self.fuel is not None and host in FUEL_HOSTS:
                within = Path(owner.lower(), kind, name.lower())
                homes = [self.fuel / given / within for given in FUEL_HOSTS]
                versions = [
                    version
                    for home in homes
                    if ".." not in within.parts and home.is_dir()
                    for version in home.iterdir()
                    if version.name.isdigit()
                ]
                if versions:
                    newest = max(versions, key=lambda version: int(version.name))
                    return newest.joinpath(*rest[2:])
        return None

    def _holds(self, path: Path) -> bool:
        roots = self.roots if self.fuel is None else (*self.roots, self.fuel)
        return any(path.is_relative_to(root) for root in roots)

    def _list(self) -> str:
        return ", ".join(map(str, dict.fromkeys(self.roots)))


def _alike(path: Path) -> list[Path]:
    """Return files of a folder whose names differ in case or encoding alone."""
    folder, name = path.parent, path.name.casefold()
    if not folder.is_dir():
        return []
    return [each for each in sorted(folder.iterdir()) if shown(each.name).casefold() == name]


def read_bytes(path: Path) -> bytes:
    """Read a file. Raises InputError if it is missing, empty, not regular, or larger than 2 GB."""
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    size = path.stat().st_size
    if size == 0:
        raise InputError(f"{path}: the file is empty")
    if size > MAX_FILE_BYTES:
        raise LimitError(f"{path}: {size / 1024**3:.1f} GB; more than 2 GB are not read")
    try:
        return path.read_bytes()
    except OSError as error:
        raise InputError(f"{path}: cannot be read: {error.strerror}") from None


def _split(reference: str) -> tuple[str, str]:
    """Split into scheme and path; that of `model://name/file` is `name/file`."""
    if "://" not in reference:
        return "", reference
    parts = urlsplit(reference)
    return parts.scheme.lower(), unquote(parts.netloc + parts.path)


def shown(name: str) -> str:
    """Name of a file as text; one that is not in UTF-8 is taken for Latin-1."""
    data = os.fsencode(name)
    try:
        return data.decode()
    except UnicodeDecodeError:
        return data.decode("latin-1")


def quoted(reference: str) -> str:
    """Quote a reference or name for messages, truncated if long."""
    return repr(reference if len(reference) <= MAX_QUOTED else f"{reference[:MAX_QUOTED]}…")
