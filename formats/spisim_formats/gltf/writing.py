"""Scenes as binary glTF: one node and mesh for each object, metres, y up."""

from collections.abc import Sequence
from xml.etree.ElementTree import Element

import numpy as np
import trimesh

from spisim.scene.bsdf import Conductor, Mirror, RoughConductor
from spisim.scene.model import Scene, SceneObject
from spisim.scene.shapes import texture_coordinates

#: The world's z up to glTF's y up.
FROM_Z_UP = np.array([[1.0, 0, 0, 0], [0, 0, 1, 0], [0, -1, 0, 0], [0, 0, 0, 1]])


def glb_files(
    scene: Scene, folder: str, further: Sequence[Element] = ()
) -> tuple[bytes, dict[str, bytes]]:
    """The GLB file of a scene, with nothing beside it nor `further` in it.

    Materials are grey by their reflectance at the scene's wavelength and have their names; textures
    stay behind, texture coordinates go along.
    """
    made = trimesh.Scene()
    for thing in scene.objects:
        made.add_geometry(_mesh(thing), thing.name, thing.name, transform=FROM_Z_UP)
    return bytes(made.export(file_type="glb")), {}


def _mesh(thing: SceneObject) -> trimesh.Trimesh:
    grey = float(thing.material.reflectance)
    metal = isinstance(thing.material.bsdf, Conductor | RoughConductor | Mirror)
    look = trimesh.visual.material.PBRMaterial(
        name=thing.material.name,
        baseColorFactor=[grey, grey, grey, 1.0],
        metallicFactor=float(metal),
        roughnessFactor=float(getattr(thing.material.bsdf, "roughness", 1.0)),
        doubleSided=True,
    )
    uv = texture_coordinates(thing.mesh)
    visual = trimesh.visual.TextureVisuals(uv=uv, material=look)
    return trimesh.Trimesh(thing.mesh.vertices, thing.mesh.faces, process=False, visual=visual)
