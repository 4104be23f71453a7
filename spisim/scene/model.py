"""A scene in memory: meshes in world coordinates, materials, atmosphere, daylight, drone pose."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray

from spisim.atmosphere import Atmosphere
from spisim.scene.materials import Material


@dataclass(frozen=True, eq=False)
class SceneObject:
    """One named surface."""

    name: str
    mesh: trimesh.Trimesh  # world coordinates, metres
    material: Material


@dataclass(frozen=True)
class Ambient:
    """Daylight outside the scene; what reaches a surface is up to the scene's openings."""

    sun_klx: float = 0.0  # illuminance of a surface normal to the sun
    sun_direction: tuple[float, float, float] = (0.0, 0.0, -1.0)  # unit, from the sun, world
    sky_klx: float = 0.0  # horizontal illuminance under a uniform sky


@dataclass(frozen=True, eq=False)
class Scene:
    """Everything that light meets, and where the instrument is.

    `drone_pose` (4, 4) takes points of the instrument's optical frame (x right, y down, z forward,
    metres) to the world (z up). `text` is the YAML that the scene was made from, or "".
    """

    name: str
    objects: tuple[SceneObject, ...]
    atmosphere: Atmosphere
    ambient: Ambient
    drone_pose: NDArray[np.float64]
    text: str = ""
