"""Which files an import may read: those in given folders, none through links or `..`."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from urllib.parse import unquote, urlsplit

from reconstruction.base.errors import InputError, LimitError, nearest

MAX_FILE_BYTES = 2 * 1024**3

#: Letters of a reference that messages tell.
MAX_DISPLAYED = 200

#: Schemes whose first part is the name of a model in one of the folders.
MODEL_SCHEMES = ("model", "package")
#: Hosts of Gazebo's models, as a copy of what was downloaded names them: the newest name first.
FUEL_HOSTS = ("fuel.gazebosim.org", "fuel.ignitionrobotics.org")


@dataclass(frozen=True)
class Folders:
    """The folders that may be read, symbolic links resolved.

    `fuel` is where Gazebo keeps what it has downloaded.
    """

    roots: tuple[Path, ...]
    fuel: Path | None = None

    @classmethod
    def around(cls, file: Path, more: Sequence[Path] = (), fuel: Path | None = None) -> Folders:
        """The folder of a file and more, the search path; InputError for what is no folder."""
        for folder in more:
            if not folder.is_dir():
                raise InputError(f"--model-path {folder}: no such folder")
        roots = tuple(folder.resolve() for folder in (file.parent, *more))
        return cls(roots, None if fuel is None else fuel.resolve())

    def find(self, reference: str, beside: Path, referrer: str, more: Sequence[Path] = ()) -> Path:
        """Path of the file or folder that a file in folder `beside` refers to.

        `reference` is a path or a URI: relative to `beside` or `more` folders, `model://name/…` in
        one of the roots, `file://…` in either, or `https://fuel…` in Gazebo's copy. Raises
        InputError, starting with `referrer`, where there is none, for one outside the roots, and
        for one on the network.
        """
        candidates = self._candidates(reference.strip(), (beside, *more), referrer)
        try:
            resolved = [path.resolve() for path in candidates]
            inside = [path for path in resolved if self._holds(path)]
            result = [path for path in inside if path.exists()]
        except (OSError, RuntimeError, ValueError):  # loops of links, names that cannot be
            raise InputError(f"{referrer}: {displayed(reference)} is no usable path") from None
        if result:
            return result[0]
        if not inside:
            raise self._outside(reference, referrer)
        searched = ", ".join(dict.fromkeys(str(path.parent) for path in inside))
        closed = [str(folder) for folder in more if not self._holds(folder.resolve())]
        hint = f"; --model-path allows to read in {', '.join(closed)}, too" if closed else ""
        raise InputError(f"{referrer}: no file {displayed(reference)}; searched {searched}{hint}")

    def check_inside(self, path: Path, reference: str, referrer: str) -> None:
        """InputError for a file that is there and may not be read."""
        if not self._holds(path.resolve()):
            raise self._outside(reference, referrer)

    def _outside(self, reference: str, referrer: str) -> InputError:
        return InputError(
            f"{referrer}: {displayed(reference)} lies outside the folders that may be read "
            f"({self._list()}); copy it there or name its folder with --model-path"
        )

    def _candidates(self, reference: str, positions: Sequence[Path], referrer: str) -> list[Path]:
        if not reference:
            raise InputError(f"{referrer}: the reference to a file is empty")
        scheme, rest = _split(reference)
        beside = [position / rest for position in positions] if scheme in ("", "file") else []
        if scheme == "" or (scheme == "file" and rest.startswith("/")):
            return beside
        if scheme in (*MODEL_SCHEMES, "file"):
            rest = rest.lstrip("/")
            first = rest.partition("/")[0]
            # A folder that is itself one of those that may be read is found by its own name.
            own = [root.parent / rest for root in self.roots if root.name == first]
            return [*beside, *(root / rest for root in self.roots), *own]
        if scheme in ("http", "https", "ftp", "fuel"):
            if copy := self._downloaded(rest):
                return [copy]
            raise InputError(
                f"{referrer}: {displayed(reference)} is on the network, which is never read; "
                "download it and refer to the file"
            )
        candidate = nearest(scheme, ("model", "file"))
        raise InputError(f"{referrer}: {displayed(reference)} has an unknown scheme: {candidate}")

    def _downloaded(self, address: str) -> Path | None:
        """Gazebo's copy of `fuel…/1.0/OWNER/models/NAME[/VERSION/files/FILE]`, if there is one.

        It lies under the names in lower case and the number of its version.
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


def read_bytes(path: Path) -> bytes:
    """All of a file; InputError where it is missing, empty, not regular, or larger than 2 GB."""
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
    """Scheme and path; of `model://name/file` the path is `name/file`."""
    if "://" not in reference:
        return "", reference
    parts = urlsplit(reference)
    return parts.scheme.lower(), unquote(parts.netloc + parts.path)


def displayed(reference: str) -> str:
    """A reference or name in quotes, as messages tell it: cut off where it is long."""
    return repr(reference if len(reference) <= MAX_DISPLAYED else f"{reference[:MAX_DISPLAYED]}…")
