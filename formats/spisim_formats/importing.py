"""From a foreign file to a scene file, and what there is to say about it."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, naming, nearest
from spisim.scene.placing import MAX_COORDINATE_M
from spisim.scene.pose import Vector3
from spisim.scene.shapes import check_triangles
from spisim.scene.write import Written, check_free, write_scene
from spisim_formats.format import Reader, readers
from spisim_formats.library import drone as drones
from spisim_formats.library.content import Content
from spisim_formats.library.drone import DronePose, Surroundings
from spisim_formats.library.files import Folders
from spisim_formats.library.ground import ground, ground_material
from spisim_formats.library.materials import Match, check_map, match, read_map
from spisim_formats.library.shapes import as_mesh
from spisim_formats.library.source_material import SourceMaterials
from spisim_formats.library.textures import Pictured, Use
from spisim_formats.library.units import choose_unit, choose_up, odd_sizes, to_metres
from spisim_formats.library.writing import scene_fields

#: A model smaller than that is in another unit than is thought.
MIN_SIZE_M = 1e-3
HEADER = "# Imported by `spisim scenes import`; docs/importing.md tells what may be changed.\n"
BEWARE = "what eyes see tells little of 1550 nm; give --materials where you know them"
OFF = (
    "all left out: what the file says of them is light for the eye, of which lamps have next to "
    "nothing at 1550 nm; --lamps watts takes the numbers for watts within the instrument's band"
)
WATTS = (
    "their numbers taken for watts within the instrument's band (W/sr, W/m², W/(m² sr)) unless "
    "they have a unit, which is much: most lamps for the eye have next to nothing there; see "
    "`lamps` in the scene file"
)
ARCHIVES = (".zip", ".zae", ".3mf", ".gz", ".tgz", ".tar", ".7z", ".rar", ".bz2", ".xz")


@dataclass(frozen=True)
class Options:
    """How to read a foreign file; the defaults believe the file.

    `units` is a name of `UNITS` or "auto"; `up` a letter of `TO_Z_UP`, or None for the file's own.
    `fuel` is where Gazebo keeps downloads; `ground` the material of a floor under everything;
    `textures` what becomes of pictures: the mean of them, the whole, or nothing; `lamps` what of
    lamps, which have no unit; `surfaces` whether materials are guessed, or as the file has them.
    """

    units: str = "auto"
    up: str | None = None
    scale: float = 1.0
    materials: Path | None = None
    model_path: tuple[Path, ...] = ()
    fuel: Path | None = None
    ground: str | None = None
    textures: Use = "mean"
    lamps: Literal["off", "watts"] = "off"
    surfaces: Literal["guess", "file"] = "guess"
    position_m: Vector3 | None = None
    look_at_m: Vector3 | None = None
    overwrite: bool = False


@dataclass(frozen=True)
class Import:
    """What an import wrote and decided."""

    written: Written
    unit_m: float
    unit_why: str
    up: str
    up_why: str
    triangles: int
    bounds_m: Floats  # (2, 3)
    drone: DronePose
    materials: tuple[tuple[Match, int], ...]  # and how many parts it is on
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


def import_scene(file: Path, output: Path, options: Options | None = None) -> Import:
    """Write a scene file, and its meshes as PLY files beside it, from a file of another program.

    Raises InputError, with nothing written, for a file that is missing, damaged, of an unknown
    format, too large, or that refers to what is missing or may not be read; for options that do not
    fit; and where `output` exists unless it may be overwritten.
    """
    options = options or Options()
    reader = _reader(file)
    inputs = [path for path in (file, options.materials) if path is not None]
    check_free(output, options.overwrite, inputs)
    chosen = {} if options.materials is None else read_map(options.materials)
    folders = Folders.around(file, options.model_path, options.fuel)
    with _naming_once(file):
        content = reader(file, folders)
    content = choose_up(choose_unit(content, options.units), options.up)
    content.check_not_empty(file)
    content = _lit(content, options.lamps)
    with _naming_once(file):
        content, placed = _placed(to_metres(content, options.scale))
    content.check_not_empty(file)
    with _naming_once(file):
        _check_size(placed)
    if options.materials is not None:
        check_map(chosen, content.parts, options.materials)
    pictured = Pictured(options.textures)
    reported = SourceMaterials() if options.surfaces == "file" else None
    matches = [match(part, chosen, pictured, reported) for part in content.parts]
    content.notes += pictured.notes
    if reported is not None:
        _check_stated(reported, file)
        content.notes += reported.notes
    if pictured.rows:
        content.note(
            f"textures taken as reflectances, by a rule of thumb: {len(pictured.rows)}; {BEWARE}"
        )
    if options.ground is not None:
        floor = ground(placed)
        content.parts.append(floor)
        placed.append(as_mesh(floor.geometry).copy().apply_transform(floor.to_world))
        matches.append(ground_material(options.ground))
    around = Surroundings.of(placed)
    bounds_m = np.array([around.bounds_m[:, 0].min(axis=0), around.bounds_m[:, 1].max(axis=0)])
    drone = _drone(around, content, options)
    fields, meshes, arrays = scene_fields(output.stem, content, matches, drone, file.name)
    own = pictured.rows | (reported.rows if reported else {})
    if own:
        fields["materials"] = own
    more = reported.files if reported else {}
    written = write_scene(output, fields, meshes, HEADER, arrays | pictured.files | more)
    odd = odd_sizes(bounds_m)
    near, far = drones.NEAREST_RANGE_M
    if not near <= drone.nearest_m <= far:
        odd.append(f"the surface nearest to the drone is {drone.nearest_m:.3g} m away")
    if content.left_out:
        odd.append(f"{len(content.left_out)} things are left out; the notes say which and why")
    return Import(
        written,
        content.unit_m,
        content.unit_why,
        content.up,
        content.up_why,
        sum(len(mesh.faces) for mesh in placed),
        bounds_m,
        drone,
        _counted(matches),
        tuple(content.notes),
        (*odd, *written.warnings),
    )


def _reader(file: Path) -> Reader:
    suffix = file.suffix.lower()
    if suffix in ARCHIVES:
        raise InputError(f"{file}: archives are not read; unpack it and import the file in it")
    given = readers()
    if suffix not in given:
        raise InputError(f"{file}: unknown format {suffix!r}: {nearest(suffix, given)}")
    if not file.is_file():
        raise InputError(f"{file}: no such file")
    return given[suffix]


def _check_stated(reported: SourceMaterials, file: Path) -> None:
    """InputError where a file tells nothing that could be kept."""
    if not reported.rows:
        raise InputError(
            f"{file}: --surfaces file: nothing in it tells surfaces in a way that is read; so do "
            "Mitsuba's scenes, glTF and Gazebo by metalness, and OpenUSD's preview surfaces"
        )


@contextmanager
def _naming_once(file: Path) -> Iterator[None]:
    """Put the file in front of an InputError's message that does not begin with it."""
    try:
        yield
    except InputError as error:
        if str(error).startswith(str(file)):
            raise
        raise InputError(f"{file}: {error}") from None


def _placed(content: Content) -> tuple[Content, list[trimesh.Trimesh]]:
    """The content less what is too far away, and the meshes of its parts in the world."""
    meshes = {id(part.geometry): as_mesh(part.geometry) for part in content.parts}
    check_triangles(sum(len(meshes[id(part.geometry)].faces) for part in content.parts))
    placed = [
        meshes[id(part.geometry)].copy().apply_transform(part.to_world) for part in content.parts
    ]
    max_ranges = [float(np.abs(mesh.bounds).max()) for mesh in placed]
    faults = {
        index: f"reaches {far:.3g} m from the origin; at most {MAX_COORDINATE_M:g} m: see --units "
        "and --scale"
        for index, far in enumerate(max_ranges)
        if not far <= MAX_COORDINATE_M
    }
    retained = [mesh for index, mesh in enumerate(placed) if index not in faults]
    return content.without(faults), retained


def _check_size(placed: Sequence[trimesh.Trimesh]) -> None:
    corners = np.concatenate([mesh.bounds for mesh in placed])
    if (across := float(np.ptp(corners, axis=0).max())) < MIN_SIZE_M:
        raise InputError(
            f"all of it is {across:.3g} m across; at least {MIN_SIZE_M:g} m: see --units and "
            "--scale"
        )


def _drone(around: Surroundings, content: Content, options: Options) -> DronePose:
    """The pose that is asked for, else the camera's where that is in the open, else a proposal."""
    if options.position_m is not None:
        given, target = options.position_m, options.look_at_m
        with naming("--drone"):
            goal = drones.aim(around, given) if target is None else np.array(target)
            return drones.pose_at(around, given, goal, "--drone")
    if options.look_at_m is not None:
        raise InputError("--look-at goes with --drone")
    for number, camera in enumerate(content.cameras, 1):
        position, forward = camera[:3, 3], camera[:3, 2]
        if not (np.isfinite(camera).all() and forward.any()):
            continue
        forward = forward / np.linalg.norm(forward)
        if np.linalg.norm(forward[:2]) > 1e-3 and around.is_open(position):
            why = "the file's camera" if number == 1 else f"camera {number} of the file"
            return drones.pose_at(around, position, position + forward, why)
    if content.cameras:
        content.note("the file's cameras are inside objects or look straight up or down")
    return drones.propose(around)


def _lit(content: Content, lamps: Literal["off", "watts"]) -> Content:
    """The content with its lamps, or without; a note tells what was assumed."""
    count = len(content.glows) + sum(part.radiance > 0 for part in content.parts)
    if count == 0:
        return content
    if lamps == "watts":
        content.note(f"lamps: {count}, {WATTS}")
        panels = [glow.panel for glow in content.glows if glow.panel is not None]
        others = [glow for glow in content.glows if glow.panel is None]
        return replace(content, parts=[*content.parts, *panels], glows=others)
    content.note(f"lamps: {count}, {OFF}")
    dark = [replace(part, radiance=0.0) if part.radiance else part for part in content.parts]
    return replace(content, parts=dark, glows=[])


def _counted(matches: Sequence[Match]) -> tuple[tuple[Match, int], ...]:
    counts: dict[Match, int] = {}
    for result in matches:
        counts[result] = counts.get(result, 0) + 1
    return tuple(counts.items())
