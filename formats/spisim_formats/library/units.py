"""Convert a file's unit and axes to metres with z up, and the attenuation of its lamps."""

import math
from dataclasses import replace

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError, nearest
from spisim.scene.description import BoxObject, CylinderObject, RectangleObject, SphereObject
from spisim_formats.library.content import Axis, Content, Glow, Shape, pose_faults, scaling
from spisim_formats.library.lattice import Lattice
from spisim_formats.library.xml import numbers

UNITS = {"mm": 1e-3, "cm": 1e-2, "m": 1.0, "in": 0.0254, "ft": 0.3048}

#: Rotations from x, y, z of the file to X, Y, Z of the world (rows): the axes COLLADA 1.5 calls
#: right, up and in, turned to right = X, up = Z, in = -Y.
TO_Z_UP: dict[Axis, Floats] = {
    "x": np.array([[0.0, -1, 0], [0, 0, -1], [1, 0, 0]]),
    "y": np.array([[1.0, 0, 0], [0, 0, -1], [0, 1, 0]]),
    "z": np.eye(3),
}

#: A wider or smaller scene is probably in another unit.
PLAUSIBLE_M = (0.05, 300.0)


def choose_unit(content: Content, name: str) -> Content:
    """Return the content in a unit of `UNITS`, or for "auto" in the file's own."""
    if name == "auto":
        return content
    if name not in UNITS:
        raise InputError(f"--units: unknown unit {name!r}: {nearest(name, (*UNITS, 'auto'))}")
    return replace(content, unit_m=UNITS[name], unit_why="--units")


def choose_up(content: Content, axis: str | None) -> Content:
    """Return the content with this axis up, or for None the file's own."""
    if axis is None:
        return content
    for given in TO_Z_UP:
        if axis == given:
            return replace(content, up=given, up_why="--up")
    raise InputError(f"--up: unknown axis {axis!r}: {nearest(axis, TO_Z_UP)}")


@np.errstate(all="ignore")  # poses are checked later to be finite
def to_metres(content: Content, scale: float) -> Content:
    """Return the content in metres, z up, with an additional scale.

    Parts with invalid poses are left out. Raises InputError unless the scale is a positive number.
    """
    if not 0 < scale < math.inf:
        raise InputError(f"--scale should be a positive number; found {scale}")
    factor = content.unit_m * scale
    if not 0 < factor < math.inf:
        raise InputError(f"a unit of {content.unit_m} m cannot be used")
    turn = np.eye(4)
    turn[:3, :3] = TO_Z_UP[content.up]
    grow, shrink = scaling(factor), scaling(1 / factor)
    given = np.reshape([part.to_world for part in content.parts], (-1, 4, 4))
    poses = turn @ grow @ given @ shrink
    faults = pose_faults(poses) | pose_faults(given)
    content, poses = content.without(faults), np.delete(poses, [*faults], axis=0)
    resized: dict[int, trimesh.Trimesh | Shape] = {}
    for part in content.parts:
        if id(part.geometry) not in resized:
            resized[id(part.geometry)] = _resized(part.geometry, factor)
    parts = [
        replace(part, geometry=resized[id(part.geometry)], to_world=pose)
        for part, pose in zip(content.parts, poses, strict=True)
    ]
    hazes = [
        replace(
            haze,
            to_world=turn @ grow @ haze.to_world,
            extinction=haze.extinction / factor,
            density=moved_grid(haze.density, turn @ grow),
            brightness=moved_grid(haze.brightness, turn @ grow),
        )
        for haze in content.hazes
    ]
    fog = content.fog
    if fog is not None:
        powers = {"extinction_per_m": -1, "visibility_m": 1}
        fog = {
            name: float(f"{value * factor ** powers[name]:.9g}") if name in powers else value
            for name, value in fog.items()
        }
    daylight = content.daylight
    if daylight is not None:
        daylight = replace(daylight, sun_direction=turn[:3, :3] @ daylight.sun_direction)
    cameras = [turn @ grow @ camera @ shrink for camera in content.cameras]
    glows = [moved_glow(glow, turn @ grow, factor) for glow in content.glows]
    return replace(
        content, parts=parts, cameras=cameras, hazes=hazes, daylight=daylight, glows=glows, fog=fog
    )


def moved_grid(grid: Lattice | None, move: Floats) -> Lattice | None:
    """Return a grid moved by a matrix (4, 4)."""
    if grid is None:
        return None
    within = None if grid.within is None else move @ grid.within
    return replace(grid, to_world=move @ grid.to_world, within=within)


def moved_glow(glow: Glow, move: Floats, factor: float) -> Glow:
    """Scale a lamp so that it lights things `factor` times as large just as brightly."""
    fields = dict(glow.fields)
    for name in ("intensity_w_per_sr", "luminous_flux_lm"):
        if name in fields:
            fields[name] *= factor**2
    position, direction, axes = glow.position, glow.direction, glow.axes
    if position is not None:
        position = move[:3, :3] @ position + move[:3, 3]
    if direction is not None:
        direction = move[:3, :3] @ direction / factor
    if axes is not None:
        axes = move[:3, :3] @ axes / factor
    return replace(glow, fields=fields, position=position, direction=direction, axes=axes)


def odd_sizes(bounds_m: Floats) -> list[str]:
    """Return warnings about the size of a scene with these bounds (2, 3)."""
    size_m = float((bounds_m[1] - bounds_m[0]).max())
    odd = []
    if not PLAUSIBLE_M[0] <= size_m <= PLAUSIBLE_M[1]:
        odd.append(f"the scene is {size_m:.3g} m wide; if that is wrong, give --units or --scale")
    return odd


def _resized(geometry: trimesh.Trimesh | Shape, factor: float) -> trimesh.Trimesh | Shape:
    match geometry:
        case BoxObject() | RectangleObject():
            return geometry.model_copy(
                update={"size_m": tuple(length * factor for length in geometry.size_m)}
            )
        case SphereObject():
            return geometry.model_copy(update={"radius_m": geometry.radius_m * factor})
        case CylinderObject():
            return geometry.model_copy(
                update={
                    "radius_m": geometry.radius_m * factor,
                    "height_m": geometry.height_m * factor,
                }
            )
    return geometry.copy().apply_scale(factor)


def at_a_metre(constant: float, linear: float, quadratic: float) -> tuple[float, str]:
    """Convert an intensity with attenuation 1 / (c + l d + q d²), with a note if it is approximate.

    Here all light falls with the square of the distance d, which equals q alone. Otherwise the
    intensity is kept, so that both agree at one unit if the three sum to 1.
    """
    if constant == linear == 0 and quadratic > 0:
        return 1 / quadratic, ""
    if (constant, linear, quadratic) == (0, 0, 0):
        return 1.0, ""
    terms = [
        f"{value:.4g}{power}"
        for value, power in ((constant, ""), (linear, " d"), (quadratic, " d²"))
        if value
    ]
    whole = " + ".join(terms)
    return 1.0, f"; it falls off with the distance d as 1 / ({whole}) there, as 1 / d² here"


def number_or(text: str | None, default: float, what: str) -> float:
    """Return a finite number in a text, or the default without one. Raises InputError."""
    return numbers(text, 1, what)[0] if text is not None and text.strip() else default
