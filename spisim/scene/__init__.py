"""Scenes: geometry, materials, media, daylight, the drone, and their motion."""

from spisim.scene.drone import Drone, at_drone_state
from spisim.scene.load import (
    catalogue,
    draw_scene,
    list_scenes,
    load_scene,
    make_scene,
    scenes_folder,
)
from spisim.scene.materials import Material, find_material, material_table
from spisim.scene.model import Ambient, Scene, SceneObject, SceneWarning, Volume
from spisim.scene.motion import check_clear_of_sensor
from spisim.scene.pose import look_at, pose_matrix
from spisim.scene.rays import enclosing_object
from spisim.scene.shapes import texture_coordinates
from spisim.scene.sun import daylight_spectrum, in_band_irradiance
from spisim.scene.trajectory import Trajectory, check_clear_path, load_trajectory

__all__ = [
    "Ambient",
    "Drone",
    "Material",
    "Scene",
    "SceneObject",
    "SceneWarning",
    "Trajectory",
    "Volume",
    "at_drone_state",
    "catalogue",
    "check_clear_of_sensor",
    "check_clear_path",
    "daylight_spectrum",
    "draw_scene",
    "enclosing_object",
    "find_material",
    "in_band_irradiance",
    "list_scenes",
    "load_scene",
    "load_trajectory",
    "look_at",
    "make_scene",
    "material_table",
    "pose_matrix",
    "scenes_folder",
    "texture_coordinates",
]
