"""The drone's pose and velocity from a scene's text alone, without reading meshes."""

from __future__ import annotations

from dataclasses import dataclass, replace
from pathlib import Path

import numpy as np

from reconstruction.base.arrays import Floats
from spisim.base.config import check_fields, dump_yaml, load_yaml, read_mapping
from spisim.scene.assemble import drone_pose
from spisim.scene.description import DroneDescription, DroneState, SceneDescription
from spisim.scene.drawn import builder_of, whole_file
from spisim.scene.load_context import LoadContext, SceneCache
from spisim.scene.model import Scene
from spisim.scene.pose import look_at, moved_pose


@dataclass(frozen=True, eq=False)
class Drone:
    """The drone's `pose` (4, 4), world from optical frame, and its velocities.

    `time_s` is the time of a timestamped pose of a flight, else None.
    """

    pose: Floats
    velocity_m_s: tuple[float, float, float]
    angular_velocity_rad_s: Floats
    time_s: float | None

    @classmethod
    def of(cls, text: str, source: Path | str, cache: SceneCache | None = None) -> Drone:
        """The drone of a scene file's text.

        Parameters
        ----------
        text : str
            YAML of the scene file.
        source : Path or str
            What messages call the file.
        cache : SceneCache, optional
            Shares the draws of families with other scenes.

        Raises
        ------
        InputError
            For text that is not a valid scene file.
        """
        fields = read_mapping(text, SceneDescription, source)
        time_s: float | None = None
        if (state := fields.get("moment")) is not None:
            described: DroneDescription = check_fields(state, DroneState, source)
            pose = look_at(described.position_m, described.look_at_m, described.up)
            time_s = float(state["time_s"])
        else:
            if "family" in fields:
                context = LoadContext(Path(), text, source, cache=cache or SceneCache())
                fields = whole_file(fields, builder_of(fields, context))
            described = check_fields(fields, SceneDescription, source).drone
            pose = drone_pose(described)
        turn = np.radians(described.angular_velocity_deg_s)
        return cls(pose, described.velocity_m_s, turn, time_s)

    def after(self, seconds: float) -> Floats:
        """The pose (4, 4) after some seconds."""
        motion = moved_pose(
            self.pose[:3, 3], self.velocity_m_s, self.angular_velocity_rad_s, seconds
        )
        return motion @ self.pose


def at_drone_state(scene: Scene, state: DroneState) -> Scene:
    """Advance a scene's objects and fog to a timestamped pose, and put the drone there.

    Parameters
    ----------
    scene : Scene
        The scene at time 0.
    state : DroneState
        Time, pose and velocities of the drone.

    Returns
    -------
    Scene
        Its text has a section `moment`, so that it loads as this very scene.

    Raises
    ------
    InputError
        If there is no line of sight.
    """
    x, y, z = np.radians(state.angular_velocity_deg_s).tolist()
    fields = load_yaml(scene.text, scene.name) | {"moment": state.model_dump(mode="json")}
    return replace(
        scene,
        objects=tuple(thing.at(state.time_s) for thing in scene.objects),
        volumes=tuple(volume.at(state.time_s) for volume in scene.volumes),
        drone_pose=look_at(state.position_m, state.look_at_m, state.up),
        drone_velocity_m_s=state.velocity_m_s,
        drone_angular_velocity_rad_s=(x, y, z),
        text=dump_yaml(fields),
    )
