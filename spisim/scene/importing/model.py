"""What the readers of foreign formats hand over: parts in a common world, and what was odd."""

from collections.abc import Callable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, field
from json import JSONDecodeError
from pathlib import Path
from typing import Any, Literal, TypeAlias

import numpy as np
import trimesh
from numpy.typing import ArrayLike, NDArray

from reconstruction.arrays import Floats
from reconstruction.errors import InputError
from spisim.scene.description import BoxObject, CylinderObject, RectangleObject, SphereObject
from spisim.scene.importing.files import Folders
from spisim.scene.importing.lattice import Lattice
from spisim.scene.importing.textures import Texture
from spisim.scene.importing.told import Told

Axis = Literal["x", "y", "z"]
Shape: TypeAlias = BoxObject | RectangleObject | SphereObject | CylinderObject

#: Instances counted.
MAX_PARTS = 100_000


@dataclass(frozen=True)
class Surface:
    """What a file says about a material: its name, a colour (RGB from 0 to 1), and other words.

    `words` are names of bsdfs and textures, which may tell what it is where the name does not;
    `texture` is the picture of its colours, `told` makes all that it says, in its own light, where
    it says enough; the same each time.
    """

    name: str | None = None
    color: tuple[float, float, float] | None = None
    words: tuple[str, ...] = ()
    texture: Texture | None = None
    told: Callable[[], Told | None] | None = None

    @property
    def label(self) -> str:
        """What reports and maps of materials call it."""
        return self.name or "(unnamed)"


@dataclass(frozen=True, eq=False)
class Part:
    """One surface: a mesh or shape in its own coordinates and where that is in the world (4, 4).

    Parts that share a mesh hold the same object.
    """

    name: str
    geometry: trimesh.Trimesh | Shape
    to_world: Floats
    surface: Surface
    radiance: float = 0.0  # of an area lamp, W/(m² sr)


@dataclass(frozen=True, eq=False)
class Haze:
    """A body of a scattering medium: `to_world` (4, 4) places a cube of edge 1 about the origin.

    Or a closed `mesh`, or what a `part` (its number) encloses that is seen. `extinction` is per
    unit of the file, times `density` where that is given; then `albedo` is times `brightness`
    where that is given.
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
    """A lamp that is no surface: the `fields` of a scene file that tell its type and strength.

    And where it is and shines to, as far as it has a place and a direction; or a `picture` (h, w)
    of all around in `axes` (3, 3); or a `panel`, which is in the scene only where it shines.
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
    """Sun and sky, klx, as in scene files; `sun_direction` (3,) goes from the sun to the scene."""

    sun_klx: float
    sun_direction: Floats
    sky_klx: float


@dataclass
class Content:
    """Everything that a file holds, in the file's own unit and axes.

    `notes` are what the user should know: what was left out, and what is missing.
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

    def add(self, part: Part) -> None:
        """Append a part; InputError for too many of them."""
        if len(self.parts) >= MAX_PARTS:
            raise InputError(f"more than {MAX_PARTS:,} parts (instances counted)")
        self.parts.append(part)

    def note(self, text: str) -> None:
        """Keep something to tell, once."""
        if text not in self.notes:
            self.notes.append(text)

    def texture(
        self,
        name: str,
        beside: Path,
        folders: Folders,
        referrer: str,
        more: Sequence[Path] = (),
    ) -> Texture | None:
        """The texture that a file refers to; a note where it is missing, or may not be read."""
        try:
            path = folders.find(name.replace("\\", "/"), beside, referrer, more)
        except InputError as error:
            self.note(f"{error}; this texture is not used")
            return None
        return Texture(name, path)


#: Parts of a file, which may refer to others in the folders.
Reader: TypeAlias = Callable[[Path, Folders], Content]


def check_poses(matrices: Floats, what: Sequence[str]) -> None:
    """InputError unless (n, 4, 4) matrices place things: finite, affine, and flatten nothing.

    `what` (n,) they place is told.
    """
    finite = np.isfinite(matrices).all(axis=(1, 2))
    for place in np.flatnonzero(~finite).tolist():
        raise InputError(f"{what[place]}: its pose is not made of finite numbers")
    affine = np.abs(matrices[:, 3] - [0, 0, 0, 1]).max(axis=1) <= 1e-8
    for place in np.flatnonzero(~affine).tolist():
        last = ", ".join(f"{value:g}" for value in matrices[place, 3])
        raise InputError(f"{what[place]}: its pose is no affine matrix; the last row is {last}")
    stretches = np.linalg.svd(matrices[:, :3, :3], compute_uv=False)
    for place in np.flatnonzero(stretches[:, 2] <= 1e-15 * stretches[:, 0]).tolist():
        raise InputError(f"{what[place]}: its pose flattens it; a scale is zero")


def with_texture_coordinates(mesh: trimesh.Trimesh, uv: ArrayLike) -> trimesh.Trimesh:
    """The mesh with texture coordinates (vertices, 2), v up; without where they do not fit."""
    coordinates = np.asarray(uv, dtype=np.float64)
    if coordinates.shape == (len(mesh.vertices), 2) and np.isfinite(coordinates).all():
        mesh.visual = trimesh.visual.TextureVisuals(uv=coordinates)
    return mesh


def translation(offset: ArrayLike) -> Floats:
    """(4, 4) matrix that moves."""
    matrix = np.eye(4)
    matrix[:3, 3] = offset
    return matrix


def scaling(factors: ArrayLike) -> Floats:
    """(4, 4) matrix that scales by one factor or three."""
    return np.diag([*np.broadcast_to(np.asarray(factors, float), 3), 1.0])


@contextmanager
def readable(what: str, kind: str) -> Iterator[None]:
    """Turn whatever a parser runs into within into an InputError that names the file.

    What the parser says is about itself, so it is not told. Numbers that are not finite raise no
    warnings within; they are looked for afterwards. What trimesh logs of damaged files is not for
    users.
    """
    logged = trimesh.util.log.disabled
    trimesh.util.log.disabled = True
    try:
        with np.errstate(all="ignore"):
            yield
    except InputError:
        raise
    except Exception as error:
        raise InputError(f"{what}: cannot be read as {kind}: {_reason(error)}") from None
    finally:
        trimesh.util.log.disabled = logged


def _reason(error: Exception) -> str:
    match error:
        case RecursionError():
            return "nested too deeply"
        case MemoryError():
            return "it needs more memory than there is"
        case JSONDecodeError():
            return f"no valid JSON in line {error.lineno}"
        case UnicodeDecodeError():
            return "it is not text in UTF-8"
        case AttributeError() | TypeError():
            return "something in it is of another kind than the format says"
    return "it is damaged, or holds what is not supported"
