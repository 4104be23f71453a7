"""The origin of scenes that lie far from their own, as those in coordinates of maps (UTM) do.

Meshes and the light are in single precision, whose steps are 1 mm at 10 km and 0.5 m at 5000 km.
"""

from dataclasses import replace
from typing import Literal, TypeAlias

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.scene.pose import Vector3
from spisim_formats.library.content import Content, Part, Shape, translation
from spisim_formats.library.units import moved_glow, moved_grid

Origin: TypeAlias = Literal["auto"] | Vector3

#: Beyond this single precision has steps over 1 mm.
FAR_M = 1e4


def to_origin(content: Content, origin: Origin) -> tuple[Content, Floats]:
    """Return the content, in metres with z up, relative to an origin (3,), and that origin.

    With "auto" it is that of a part, in whole metres, along the axes where most parts are far.
    Meshes that are far from their own origin get one in their middle.
    """
    middles = {id(part.geometry): _middle(part.geometry) for part in content.parts}
    if origin == "auto":
        placed = [part.to_world @ [*middles[id(part.geometry)], 1] for part in content.parts]
        chosen = _far_middle(np.reshape(placed, (-1, 4))[:, :3])
    else:
        chosen = np.asarray(origin, np.float64)
    if not np.isfinite(chosen).all():
        raise InputError(f"--origin should be three finite numbers; found {chosen.tolist()}")
    move = translation(-chosen)
    centred: dict[int, trimesh.Trimesh | Shape] = {}
    parts = [_moved(part, move, middles[id(part.geometry)], centred) for part in content.parts]
    if not chosen.any():
        return replace(content, parts=parts), chosen
    hazes = [
        replace(
            haze,
            to_world=move @ haze.to_world,
            density=moved_grid(haze.density, move),
            brightness=moved_grid(haze.brightness, move),
        )
        for haze in content.hazes
    ]
    cameras = [move @ camera for camera in content.cameras]
    glows = [moved_glow(glow, move, 1.0) for glow in content.glows]
    return replace(content, parts=parts, hazes=hazes, cameras=cameras, glows=glows), chosen


def _far_middle(places: Floats) -> Floats:
    """Median by distance along each axis of places (n, 3), the lower one, or zero if near."""
    if not len(places):
        return np.zeros(3)
    median = np.argsort(np.abs(places), axis=0)[(len(places) - 1) // 2]
    middle = places[median, range(3)]
    return np.asarray(np.where(np.abs(middle) > FAR_M, np.round(middle), 0.0))


def _middle(geometry: trimesh.Trimesh | Shape) -> Floats:
    if isinstance(geometry, trimesh.Trimesh):
        return np.asarray(geometry.bounds.mean(axis=0))
    return np.zeros(3)


def _moved(
    part: Part, move: Floats, middle: Floats, centred: dict[int, trimesh.Trimesh | Shape]
) -> Part:
    geometry, to_world = part.geometry, part.to_world
    if isinstance(geometry, trimesh.Trimesh) and np.abs(middle).max() > FAR_M:
        if id(geometry) not in centred:
            centred[id(geometry)] = geometry.copy().apply_translation(-middle)
        geometry, to_world = centred[id(geometry)], to_world @ translation(middle)
    return replace(part, geometry=geometry, to_world=move @ to_world)
