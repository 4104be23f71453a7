"""The closed room of the benchmarks of light."""

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from spisim.atmosphere import CLEAR, Atmosphere, fog
from spisim.scene import Ambient, Material, Scene, SceneObject

FOG_KIND = "moderate-radiation"


def air(visibility_m: float | None) -> Atmosphere:
    """Fog of this visibility; clear air for None."""
    return CLEAR if visibility_m is None else fog(visibility_m, FOG_KIND, phase="hg")


def room(atmosphere: Atmosphere) -> Scene:
    """Walls all round, 8 m ahead, 4 m behind, 3 m to the sides; a box at 5 m, a ball at 4 m."""
    walls = trimesh.creation.box((6, 6, 12)).apply_translation((0, 0, 2))
    block = trimesh.creation.box((1, 1, 1)).apply_translation((0.6, 0.3, 5))
    ball = trimesh.creation.icosphere(3, 0.5).apply_translation((-0.5, -0.3, 4))
    surfaces = (("walls", walls, 0.5), ("block", block, 0.8), ("ball", ball, 0.3))
    objects = tuple(
        SceneObject(name, mesh, Material(name, reflectance, "chosen"))
        for name, mesh, reflectance in surfaces
    )
    return Scene("room", objects, atmosphere, Ambient(), np.eye(4))


def box_pose(size_m: tuple[float, ...], centre_m: tuple[float, ...]) -> Floats:
    """Matrix (4, 4) that takes the unit cube [0, 1]³ to a box."""
    pose = np.diag([*size_m, 1.0])
    pose[:3, 3] = np.subtract(centre_m, np.divide(size_m, 2))
    return pose
