"""What is out there: geometry, materials, atmosphere, daylight, and where the drone is."""

from spisim.scene.load import list_scenes, load_scene, scenes_folder
from spisim.scene.materials import Material, find_material, material_table
from spisim.scene.model import Ambient, Scene, SceneObject
from spisim.scene.pose import look_at, pose_matrix
from spisim.scene.rays import enclosing_object, spot_ranges
from spisim.scene.sun import in_band_irradiance

__all__ = [
    "Ambient",
    "Material",
    "Scene",
    "SceneObject",
    "enclosing_object",
    "find_material",
    "in_band_irradiance",
    "list_scenes",
    "load_scene",
    "look_at",
    "material_table",
    "pose_matrix",
    "scenes_folder",
    "spot_ranges",
]
