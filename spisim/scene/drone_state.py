"""A scene at a moment of a flight."""

from dataclasses import replace

import numpy as np

from spisim.base.config import dump_yaml, load_yaml
from spisim.scene.description import DroneState
from spisim.scene.model import Scene
from spisim.scene.pose import look_at


def at_drone_state(scene: Scene, moment: DroneState) -> Scene:
    """The scene with objects and fog moved on by the moment's time, and the drone as it is then.

    The scene's text gets a section `moment`, so that it loads as this very scene. Raises InputError
    for a line of sight that is none.
    """
    x, y, z = np.radians(moment.angular_velocity_deg_s).tolist()
    fields = load_yaml(scene.text, scene.name) | {"moment": moment.model_dump(mode="json")}
    return replace(
        scene,
        objects=tuple(thing.at(moment.time_s) for thing in scene.objects),
        volumes=tuple(volume.at(moment.time_s) for volume in scene.volumes),
        drone_pose=look_at(moment.position_m, moment.look_at_m, moment.up),
        drone_velocity_m_s=moment.velocity_m_s,
        drone_angular_velocity_rad_s=(x, y, z),
        text=dump_yaml(fields),
    )
