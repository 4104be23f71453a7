"""The output of format readers: parts in a common world, and notes."""

from __future__ import annotations

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field, replace
from json import JSONDecodeError
from pathlib import Path
from typing import Any, Literal, TypeAlias, TypeVar

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, LimitError
from spisim.scene.description import BoxObject, CylinderObject, RectangleObject, SphereObject
from spisim_formats.library.files import Folders
from spisim_formats.library.lattice import Lattice
from spisim_formats.library.opacity import Opacity
from spisim_formats.library.records import Rest, notes_of
from spisim_formats.library.source_material import SourceMaterial
from spisim_formats.library.textures import Texture

Axis = Literal["x", "y", "z"]
Shape: TypeAlias = BoxObject | RectangleObject | SphereObject | CylinderObject

Made = TypeVar("Made")

#: Limit on parts, counting instances.
MAX_PARTS = 100_000
MAX_NOTES = 1000
#: Texture folders of Gazebo's models, relative to a model's folder or that of its meshes.
TEXTURE_FOLDERS = ("materials/textures", "../materials/textures")
#: Prefix of notes on dropped parts, and the length that an error quotes.
LEFT_OUT = "left out: "
MAX_REASONS, MAX_REASON_LETTERS = 3, 400


@dataclass(frozen=True)
class Surface:
    """A material in a file: its name, a colour (RGB from 0 to 1), and other words.

    `words` are names of bsdfs and textures, which may identify it if the name does not. `texture`
    is the image of its colours. `source` returns its full optical properties at the file's own
    wavelength if the file gives enough, and `opacity` what of it is opaque, unless all; both return
    the same object each time.
    """

    name: str | None = None
    color: tuple[float, float, float] | None = None
    words: tuple[str, ...] = ()
    texture: Texture | None = None
    source: Callable[[], SourceMaterial | None] | None = None
    opacity: Callable[[], Opacity | None] | None = None

    @property
    def label(self) -> str:
        """Name in reports and maps of materials."""
        return self.name or "(unnamed)"


@dataclass(frozen=True, eq=False)
class Part:
    """One surface: a mesh or shape in its own coordinates, and its pose in the world (4, 4).

    Parts that share a mesh hold the same object.
    """

    name: str
    geometry: trimesh.Trimesh | Shape
    to_world: Floats
    surface: Surface
    radiance: float = 0.0  # of an area lamp, W/(m² sr)


@dataclass(frozen=True, eq=False)
class Haze:
    """A volume of a scattering medium: `to_world` (4, 4) places a cube of edge 1 about the origin.

    Instead of the cube it may fill a closed `mesh`, or the inside of a visible `part` (its number).
    `extinction` is per unit of the file, multiplied by `density` if given; likewise `albedo` by
    `brightness`.
    """

    name: str
    to_world: Floats
    extinction: float
    albedo: float
    g: float
    mesh: trimesh.Trimesh | None = None
    density: Lattice | None = None
    brightness: Lattice | None = None
    part: int | None = None


@dataclass(frozen=True, eq=False)
class Glow:
    """A lamp without a surface: the `fields` of a scene file for its type and strength.

    It has a position and a direction as its type needs; or a `picture` (h, w) of all around in
    `axes` (3, 3); or a `panel`, which is part of the scene only if it emits.
    """

    name: str
    fields: Mapping[str, Any]
    position: Floats | None = None
    direction: Floats | None = None
    picture: NDArray[np.float32] | None = None
    axes: Floats | None = None
    panel: Part | None = None


@dataclass(frozen=True, eq=False)
class Daylight:
    """Sun and sky in klx, as in scene files; `sun_direction` (3,) is from the sun to the scene."""

    sun_klx: float
    sun_direction: Floats
    sky_klx: float


@dataclass
class Content:
    """All content of a file, in the file's own unit and axes.

    `notes` tell the user what was left out and what is missing, `warnings` what makes ranges wrong.
    `fog` are fields of the scene file's, per unit of the file. `records` count, by file, what was
    not read of it.
    """

    unit_m: float = 1.0
    unit_why: str = "the format has none: metres"
    up: Axis = "z"
    up_why: str = "the format has none: z"
    parts: list[Part] = field(default_factory=list)
    notes: list[str] = field(default_factory=list)
    cameras: list[Floats] = field(default_factory=list)  # (4, 4), look along their z
    hazes: list[Haze] = field(default_factory=list)
    daylight: Daylight | None = None
    glows: list[Glow] = field(default_factory=list)
    fog: Mapping[str, Any] | None = None
    warnings: list[str] = field(default_factory=list)
    records: list[tuple[str, Callable[[], Rest]]] = field(default_factory=list)

    def add(self, part: Part) -> None:
        """Append a part. Raises LimitError for too many."""
        if len(self.parts) >= MAX_PARTS:
            raise LimitError(f"more than {MAX_PARTS:,} parts (instances counted)")
        self.parts.append(part)

    def note(self, text: str) -> None:
        """Add a note once; beyond `MAX_NOTES` they are dropped."""
        if len(self.notes) < MAX_NOTES and text not in self.notes:
            self.notes.append(text if len(self.notes) < MAX_NOTES - 1 else "and more like these")

    def warn(self, text: str) -> None:
        """Add a warning once, as `note`."""
        if len(self.warnings) < MAX_NOTES and text not in self.warnings:
            self.warnings.append(text)

    def adopt(self, other: Content) -> None:
        """Take over the notes of another file's content."""
        for note in other.notes:
            self.note(note)
        for warning in other.warnings:
            self.warn(warning)
        self.records += other.records

    def tell_unread(self) -> None:
        """Add notes and warnings on what was not read of all files, now that all is chosen."""
        for file, count in self.records:
            for note, is_grave in notes_of(file, count()):
                (self.warn if is_grave else self.note)(note)

    @contextmanager
    def leaving_out(self, what: str, forget: Callable[[], None] | None = None) -> Iterator[None]:
        """Leave out what fails to be read within, with a note; LimitError is raised on.

        `forget` then counts it as read, because the note names it.
        """
        try:
            with readable(what):
                yield
        except LimitError:
            raise
        except InputError as error:
            self.note(f"{LEFT_OUT}{error}")
            if forget is not None:
                forget()

    def attempt(self, what: str, make: Callable[[], Made | None]) -> Made | None:
        """Return what is made; None, with a note, if that fails."""
        made = None
        with self.leaving_out(what):
            made = make()
        return made  # noqa: RET504 (the failure is suppressed)

    @property
    def left_out(self) -> list[str]:
        """Reasons for dropped parts."""
        return [note.removeprefix(LEFT_OUT) for note in self.notes if note.startswith(LEFT_OUT)]

    def without(self, faults: Mapping[int, str]) -> Content:
        """Return the content without some parts, by their numbers, with notes on the reasons."""
        if not faults:
            return self
        for index in sorted(faults):
            self.note(f"{LEFT_OUT}object {self.parts[index].name!r:.80}: {faults[index]}")
        retained = [index for index in range(len(self.parts)) if index not in faults]
        numbers = {index: number for number, index in enumerate(retained)}
        hazes = [
            haze if haze.part is None else replace(haze, part=numbers[haze.part])
            for haze in self.hazes
            if haze.part is None or haze.part in numbers
        ]
        return replace(self, parts=[self.parts[index] for index in retained], hazes=hazes)

    def check_not_empty(self, path: Path, lack: str = "holds no triangles") -> None:
        """Raise InputError, with the first reasons, if no part is left."""
        if not self.parts:
            reasons = [reason[:MAX_REASON_LETTERS] for reason in self.left_out[:MAX_REASONS]]
            raise InputError("; ".join([f"{path}: {lack}", *reasons]))

    def texture(
        self, name: str, beside: Path, folders: Folders, referrer: str, more: Sequence[Path] = ()
    ) -> Texture | None:
        """Return the texture that a file refers to; None, with a note, if missing or forbidden.

        It is searched by its path, and by its name alone if the path is of another machine: beside
        the file, in `more` folders, and in the texture folders of Gazebo's models.
        """
        usual = [beside / folder for folder in TEXTURE_FOLDERS]
        searched = [*more, *(folder for folder in usual if folder.is_dir())]
        reference = name.replace("\\", "/")
        try:
            path = folders.find(reference, beside, referrer, searched)
        except InputError as error:
            try:
                path = folders.find(reference.rpartition("/")[2], beside, referrer, searched)
            except InputError:
                self.note(f"{error}; this texture is not used")
                return None
            self.note(f"{error}; {path} is taken, by its name")
        return Texture(name, path)


def pose_faults(matrices: Floats) -> dict[int, str]:
    """Return faults of (n, 4, 4) matrices that are not finite, not affine, or flat."""
    finite = np.asarray(np.isfinite(matrices).all(axis=(1, 2)))
    safe = np.where(finite[:, None, None], matrices, np.eye(4))
    last = safe[:, 3]
    affine = np.asarray(np.abs(last - [0, 0, 0, 1]).max(axis=1) <= 1e-8)
    stretches = np.linalg.svd(safe[:, :3, :3], compute_uv=False)
    flat = np.asarray(stretches[:, 2] <= 1e-15 * stretches[:, 0])
    faults = dict.fromkeys(np.flatnonzero(flat).tolist(), "its pose flattens it; a scale is zero")
    for index in np.flatnonzero(~affine).tolist():
        row = ", ".join(f"{value:g}" for value in last[index])
        faults[index] = f"its pose is no affine matrix; the last row is {row}"
    lost = np.flatnonzero(~finite).tolist()
    return faults | dict.fromkeys(lost, "its pose is not made of finite numbers")


def with_texture_coordinates(mesh: trimesh.Trimesh, uv: ArrayLike) -> trimesh.Trimesh:
    """Return the mesh with texture coordinates (vertices, 2), v up, if they fit."""
    coordinates = np.asarray(uv, dtype=np.float64)
    if coordinates.shape == (len(mesh.vertices), 2) and np.isfinite(coordinates).all():
        mesh.visual = trimesh.visual.TextureVisuals(uv=coordinates)
    return mesh


def with_seams(
    points: ArrayLike, faces: ArrayLike, uv: ArrayLike, numbers: ArrayLike
) -> trimesh.Trimesh:
    """Return a mesh whose corners have the coordinates uv[numbers], v up.

    Vertices are split where these differ. `faces` and `numbers` are (triangles, 3).
    """
    coordinates = np.asarray(uv, dtype=np.float64)
    key = np.asarray(faces, np.int64) * len(coordinates) + np.asarray(numbers, np.int64)
    each, corners = np.unique(key, return_inverse=True)
    vertices, places = np.divmod(each, len(coordinates))
    whole = trimesh.Trimesh(np.asarray(points)[vertices], corners.reshape(-1, 3), process=False)
    return with_texture_coordinates(whole, coordinates[places, :2])


def translation(offset: ArrayLike) -> Floats:
    """Return a (4, 4) translation."""
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def scaling(factors: ArrayLike) -> Floats:
    """Return a (4, 4) scaling by one factor or three."""
    return np.diag([*np.broadcast_to(np.asarray(factors, float), 3), 1.0])


@contextmanager
def readable(what: str, kind: str = "") -> Iterator[None]:
    """Turn errors of a parser into an InputError that names the file or part.

    The parser's own message is dropped, because it is about its internals. Warnings on numbers that
    are not finite are suppressed, because they are checked later, and so is trimesh's log.
    """
    logged = trimesh.util.log.disabled
    trimesh.util.log.disabled = True
    try:
        with np.errstate(all="ignore"):
            yield
    except InputError:
        raise
    except MemoryError:
        raise LimitError(f"{what}: needs more memory than there is") from None
    except Exception as error:
        as_kind = f" as {kind}" if kind else ""
        raise InputError(f"{what}: cannot be read{as_kind}: {_reason(error)}") from None
    finally:
        trimesh.util.log.disabled = logged


def _reason(error: Exception) -> str:
    match error:
        case RecursionError():
            return "nested too deeply"
        case JSONDecodeError():
            return f"no valid JSON in line {error.lineno}"
        case UnicodeDecodeError():
            return "it is not text in UTF-8"
        case AttributeError() | TypeError():
            return "something in it is of another kind than the format says"
    return "it is damaged, or holds what is not supported"
