"""Import a file of another program as a scene file, with notes on what was decided."""

from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from dataclasses import dataclass, replace
from functools import cache
from pathlib import Path
from typing import Literal

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats, usual_float_errors
from reconstruction.base.errors import InputError, naming, nearest
from spisim.scene.placing import MAX_COORDINATE_M
from spisim.scene.pose import Vector3
from spisim.scene.shapes import check_triangles
from spisim.scene.write import Written, check_free, write_scene
from spisim_formats.format import Reader, readers
from spisim_formats.library import drone as drones
from spisim_formats.library.content import Content, Part
from spisim_formats.library.drone import DronePose, Surroundings
from spisim_formats.library.files import Folders, quoted, shown
from spisim_formats.library.materials import Match, check_map, match, read_map
from spisim_formats.library.opacity import CutOuts
from spisim_formats.library.origin import Origin, to_origin
from spisim_formats.library.shapes import as_mesh
from spisim_formats.library.source_material import SourceMaterials
from spisim_formats.library.surround import ground, ground_material
from spisim_formats.library.textures import Pictured, Use, has_holes
from spisim_formats.library.units import choose_unit, choose_up, odd_sizes, to_metres
from spisim_formats.library.writing import scene_fields

#: A smaller model is probably in another unit.
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
OPAQUE = "such counts only if the file says so (map_d, alphaMode, transparent, opacity, mask)"
ARCHIVES = (".zip", ".zae", ".3mf", ".gz", ".tgz", ".tar", ".7z", ".rar", ".bz2", ".xz")


@dataclass(frozen=True)
class Options:
    """How to read a file of another program; by default as the file says.

    Parameters
    ----------
    units
        A name in `UNITS`, or "auto".
    up
        A key of `TO_Z_UP`, or None for the file's own axis.
    fuel
        Gazebo's folder of downloads.
    ground
        Material of a floor under everything.
    textures
        How to use textures: their mean, the whole image, or not at all.
    lamps
        Whether to use lamps, which have no unit.
    surfaces
        Whether to guess materials, or use them as the file has them.
    scale
        Metres per unit, further to `units`.
    materials
        A file that maps names of materials to those of `spisim materials`.
    model_path
        Folders to search for models.
    position_m, look_at_m
        Pose of the drone, by default chosen from the scene's size.
    overwrite
        Whether to replace existing files.
    origin
        Point of the file that becomes the scene's origin, metres, z up; "auto" is near the content
        where that is far from zero.
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
    origin: Origin = "auto"


@dataclass(frozen=True)
class Import:
    """The result of an import, and what was decided."""

    written: Written
    unit_m: float
    unit_why: str
    up: str
    up_why: str
    origin_m: Floats  # (3,)
    triangles: int
    bounds_m: Floats  # (2, 3)
    drone: DronePose
    materials: tuple[tuple[Match, int], ...]  # with numbers of parts
    notes: tuple[str, ...]
    warnings: tuple[str, ...]


@usual_float_errors
def import_scene(file: Path, output: Path, options: Options | None = None) -> Import:
    """Convert a file of another program to a scene file, and its meshes to PLY files beside it.

    Parameters
    ----------
    file
        The file to read.
    output
        The scene file to write.
    options
        How to read the file.

    Returns
    -------
    Import

    Raises
    ------
    InputError
        With nothing written: if the file is missing, damaged, too large, of unknown format, or
        refers to missing or forbidden files, if options do not fit, or if `output` exists.
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
    content = _visible(_lit(content, options.lamps))
    with _naming_once(file):
        content, origin_m = to_origin(to_metres(content, options.scale), options.origin)
        content, placed = _meshes_of(content)
    content.check_not_empty(file)
    with _naming_once(file):
        _check_size(placed)
    if options.materials is not None:
        check_map(chosen, content.parts, options.materials)
    pictured = Pictured(options.textures)
    sources = SourceMaterials() if options.surfaces == "file" else None
    matches = [match(part, chosen, pictured, sources) for part in content.parts]
    cut_outs = CutOuts(pictured.rows)
    matches = [
        _cut(each, part, cut_outs) for each, part in zip(matches, content.parts, strict=True)
    ]
    content.notes += pictured.notes + cut_outs.notes
    _note_unused_alpha(content)
    if sources is not None:
        _check_stated(sources, file)
        content.notes += sources.notes
    if pictured.rows:
        content.note(
            f"textures taken as reflectances, by a rule of thumb: {len(pictured.rows)}; {BEWARE}"
        )
    content.tell_unread()
    if options.ground is not None:
        floor = ground(placed)
        content.parts.append(floor)
        placed.append(as_mesh(floor.geometry).copy().apply_transform(floor.to_world))
        matches.append(ground_material(options.ground))
    around = Surroundings.of(placed)
    bounds_m = np.array([around.bounds_m[:, 0].min(axis=0), around.bounds_m[:, 1].max(axis=0)])
    drone = _drone(around, content, options)
    source = shown(file.name)
    if origin_m.any():
        source += ", whose {:.12g}, {:.12g}, {:.12g} m is the origin".format(*origin_m)
    fields, meshes, arrays = scene_fields(output.stem, content, matches, drone, source)
    own = pictured.rows | (sources.rows if sources else {}) | cut_outs.rows
    if own:
        fields["materials"] = own
    more = sources.files if sources else {}
    more = more | cut_outs.files
    written = write_scene(output, fields, meshes, HEADER, arrays | pictured.files | more)
    odd = odd_sizes(bounds_m)
    near, far = drones.NEAREST_RANGE_M
    if not near <= drone.nearest_m <= far:
        hint = "; --drone counts from the new origin" if origin_m.any() else ""
        odd.append(f"the surface nearest to the drone is {drone.nearest_m:.3g} m away{hint}")
    if content.left_out:
        odd.append(f"{len(content.left_out)} things are left out; the notes say which and why")
    return Import(
        written,
        content.unit_m,
        content.unit_why,
        content.up,
        content.up_why,
        origin_m,
        sum(len(mesh.faces) for mesh in placed),
        bounds_m,
        drone,
        _counted(matches),
        tuple(content.notes),
        (*odd, *content.warnings, *written.warnings),
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


def _check_stated(sources: SourceMaterials, file: Path) -> None:
    """Raise InputError if no material of the file can be used."""
    if not sources.rows:
        raise InputError(
            f"{file}: --surfaces file: nothing in it tells surfaces in a way that is read; so do "
            "Mitsuba's scenes, glTF and Gazebo by metalness, and OpenUSD's preview surfaces"
        )


@contextmanager
def _naming_once(file: Path) -> Iterator[None]:
    """Prefix an InputError's message with the file unless it begins with it."""
    try:
        yield
    except InputError as error:
        if str(error).startswith(str(file)):
            raise
        raise InputError(f"{file}: {error}") from None


def _meshes_of(content: Content) -> tuple[Content, list[trimesh.Trimesh]]:
    """Return the content without parts that are too far away, and its meshes in the world."""
    meshes = {id(part.geometry): as_mesh(part.geometry) for part in content.parts}
    check_triangles(sum(len(meshes[id(part.geometry)].faces) for part in content.parts))
    placed = [
        meshes[id(part.geometry)].copy().apply_transform(part.to_world) for part in content.parts
    ]
    distances = [float(np.abs(mesh.bounds).max()) for mesh in placed]
    faults = {
        index: f"reaches {far:.3g} m from the origin; at most {MAX_COORDINATE_M:g} m: see "
        "--origin, --units and --scale"
        for index, far in enumerate(distances)
        if not far <= MAX_COORDINATE_M
    }
    near = [mesh for index, mesh in enumerate(placed) if index not in faults]
    return content.without(faults), near


def _check_size(placed: Sequence[trimesh.Trimesh]) -> None:
    corners = np.concatenate([mesh.bounds for mesh in placed])
    if (across := float(np.ptp(corners, axis=0).max())) < MIN_SIZE_M:
        raise InputError(
            f"all of it is {across:.3g} m across; at least {MIN_SIZE_M:g} m: see --units and "
            "--scale"
        )


def _drone(around: Surroundings, content: Content, options: Options) -> DronePose:
    """Return the requested pose, else the first camera in the open, else a proposal."""
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
    """Return the content with or without its lamps, with a note on the assumption."""
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


def _visible(content: Content) -> Content:
    """Return the content without surfaces that let all light pass, with notes."""
    clear = {
        index: "lets all light pass (opacity 0)"
        for index, part in enumerate(content.parts)
        if part.surface.opacity is not None
        and (opacity := part.surface.opacity()) is not None
        and opacity.is_clear
    }
    return content.without(clear)


def _cut(match: Match, part: Part, cut_outs: CutOuts) -> Match:
    """Return the match with what of the surface is opaque; materials of the file have theirs."""
    if match.how == "file" or part.surface.opacity is None:
        return match
    opacity = part.surface.opacity()
    if opacity is None:
        return match
    return replace(match, material=cut_outs.material(match.material, opacity, part.geometry))


def _note_unused_alpha(content: Content) -> None:
    """Note surfaces that stay opaque although their picture is not, as their formats have it."""
    checked = cache(has_holes)
    for surface in dict.fromkeys(part.surface for part in content.parts):
        if (texture := surface.texture) is None or not checked(texture.source):
            continue
        if surface.opacity is None or surface.opacity() is None:
            content.note(
                f"material {quoted(surface.label)}: opaque, although {quoted(texture.name)} has "
                f"alpha below 1: {OPAQUE}"
            )


def _counted(matches: Sequence[Match]) -> tuple[tuple[Match, int], ...]:
    counts: dict[Match, int] = {}
    for each in matches:
        counts[each] = counts.get(each, 0) + 1
    return tuple(counts.items())
