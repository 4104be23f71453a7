"""A scene as Mitsuba holds it: meshes with their reflectance, and the fog around them."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from typing import Any

import mitsuba as mi
import numpy as np
import trimesh
from numpy.typing import NDArray

from spisim.atmosphere import Atmosphere
from spisim.scene import Material, Scene, SceneObject
from spisim.transport.backend import with_backend
from spisim.transport.fog import Fog

#: The fog reaches this far beyond the scene: light scattered further out does not come back.
FOG_MARGIN_M = 15.0


@dataclass(frozen=True, eq=False)
class World:
    """Surfaces and fog, ready to be traced."""

    geometry: Any  # mi.Scene of surfaces alone
    fog: Fog
    centre_m: NDArray[np.float64]  # of the ball that the fog fills
    radius_m: float
    names: tuple[str, ...]  # object names, in the order of geometry.shapes()


@with_backend
def build_world(scene: Scene) -> World:
    """Hand a scene to Mitsuba."""
    centre, radius = fog_ball(scene)
    return World(
        geometry=mi.load_dict({"type": "scene", **shapes(scene.objects)}),
        fog=Fog.of(scene.atmosphere, centre.tolist(), radius),
        centre_m=centre,
        radius_m=radius,
        names=tuple(thing.name for thing in scene.objects),
    )


def fog_ball(scene: Scene) -> tuple[NDArray[np.float64], float]:
    """Centre (3,) and radius of a ball around every surface and the instrument, in metres."""
    corners = [thing.mesh.bounds for thing in scene.objects] + [scene.drone_pose[None, :3, 3]]
    points = np.concatenate(corners)
    low, high = points.min(axis=0), points.max(axis=0)
    return (low + high) / 2, float(np.linalg.norm(high - low) / 2 + FOG_MARGIN_M)


def shapes(objects: Sequence[SceneObject]) -> dict[str, Any]:
    """Mitsuba meshes by name, in the order of `objects`."""
    return {f"object_{i}": _mesh(thing) for i, thing in enumerate(objects)}


def medium(atmosphere: Atmosphere) -> dict[str, Any]:
    """The same fog as a Mitsuba medium, for Mitsuba's own integrators."""
    return {
        "type": "homogeneous",
        "sigma_t": _spectrum(atmosphere.extinction_per_m),
        "albedo": _spectrum(atmosphere.albedo),
        "phase": {"type": "hg", "g": atmosphere.g},
        "has_spectral_extinction": False,
    }


def _mesh(thing: SceneObject) -> Any:
    properties = mi.Properties()
    properties["bsdf"] = mi.load_dict(_bsdf(thing.material))
    source: trimesh.Trimesh = thing.mesh
    mesh = mi.Mesh(thing.name, len(source.vertices), len(source.faces), props=properties)
    parameters = mi.traverse(mesh)
    parameters["vertex_positions"] = np.asarray(source.vertices, dtype=np.float32).ravel()
    parameters["faces"] = np.asarray(source.faces, dtype=np.uint32).ravel()
    parameters.update()
    return mesh


def _bsdf(material: Material) -> dict[str, Any]:
    """Lambertian on both sides: drone-scale meshes are often sheets without thickness."""
    return {
        "type": "twosided",
        "bsdf": {"type": "diffuse", "reflectance": _spectrum(material.reflectance)},
    }


def _spectrum(value: float) -> dict[str, Any]:
    return {"type": "rgb", "value": [float(value)] * 3}
