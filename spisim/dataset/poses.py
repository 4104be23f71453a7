"""Several poses of the drone in one scene, whose surfaces are made once for all of them."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field
from scipy.spatial.transform import Rotation

from reconstruction.errors import InputError
from spisim.config import Count, NonNegative, Section, dump_yaml, load_yaml
from spisim.scene import Scene
from spisim.scene.assemble import OPTICAL_FROM_BODY
from spisim.scene.layout import OFFERED, layout_problem
from spisim.scene.pose import pose_matrix
from spisim.scene.rays import first_hits

#: Poses that are tried before a scene counts as too narrow to move in.
ATTEMPTS = 40

#: Widest angle of a turn, either way.
Angle = Annotated[NonNegative, Field(le=180)]


class Poses(Section):
    """How many poses each scene is seen from, and how far they lie from the scene's own.

    The first is the scene's own. Of the others, offset and turn are uniform within plus and minus
    `offset_m` (forward, left, up) and `turn_deg` (roll, pitch, yaw), in the drone's body frame; one
    in which a drone cannot fly, behind something, or none of whose lasers meets anything near by,
    is drawn again from a narrower range.
    """

    count: Annotated[Count, Field(le=10_000)] = 1
    offset_m: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 0.5)
    turn_deg: tuple[Angle, Angle, Angle] = (5.0, 10.0, 25.0)


def _section(value: Any) -> Any:
    return value if isinstance(value, Mapping | Poses) else {"count": value}


#: A field of a file that may be their number alone.
AnyPoses = Annotated[Poses, BeforeValidator(_section, json_schema_input_type=int | Poses)]


@dataclass(frozen=True)
class View:
    """One of a scene's poses, by its number, 0 for the scene's own, and what it is drawn from."""

    number: int
    around: Poses
    seed: int

    def of(self, scene: Scene) -> Scene:
        """The scene from this pose; its text says so.

        Raises InputError where no pose of many is one to fly in, and where the file has a `moment`,
        which sets the pose.
        """
        if self.number == 0:
            return scene
        fields = load_yaml(scene.text, scene.name)
        if fields.get("moment") is not None:
            raise InputError(f"scene {scene.name!r}: a scene at a moment of a flight has one pose")
        rng = np.random.default_rng(self.seed)
        problem: str | None = ""
        for attempt in range(ATTEMPTS):
            width = (1 - attempt / ATTEMPTS) * rng.uniform(-1, 1, (2, 3))
            offset_m, turn_deg = np.round(width * (self.around.offset_m, self.around.turn_deg), 4)
            drawn = pose_matrix(turn_deg, offset_m)
            moved = scene.drone_pose @ OPTICAL_FROM_BODY @ drawn @ OPTICAL_FROM_BODY.T
            seen = replace(scene, drone_pose=np.asarray(moved))
            problem = _behind(scene, seen) or layout_problem(seen, OFFERED)
            if problem is None:
                drone = _told(fields.get("drone") or {}, offset_m.tolist(), turn_deg.tolist())
                return replace(seen, text=dump_yaml({**fields, "drone": drone}))
        raise InputError(
            f"scene {scene.name!r}: none of {ATTEMPTS} poses is one to fly in; in the last, "
            f"{problem}"
        )


def _behind(scene: Scene, seen: Scene) -> str | None:
    """Whether something is between the scene's own pose and another, in words."""
    start, stop = scene.drone_pose[:3, 3], seen.drone_pose[:3, 3]
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    (crossed,) = first_hits(start, (stop - start)[None], triangles)
    return "something is between it and the scene's own" if crossed <= 1 else None


def _told(drone: Mapping[str, Any], offset_m: list[float], turn_deg: list[float]) -> dict[str, Any]:
    """Fields of the drone that add an offset and a turn to those it has."""
    own_turn, own_offset = drone.get("turn_deg", (0, 0, 0)), drone.get("offset_m", (0, 0, 0))
    if any(own_turn) or any(own_offset):
        both = pose_matrix(own_turn, own_offset) @ pose_matrix(turn_deg, offset_m)
        angles = Rotation.from_matrix(both[:3, :3]).as_euler("xyz", degrees=True)
        offset_m, turn_deg = (np.round(each, 6).tolist() for each in (both[:3, 3], angles))
    return {**drone, "offset_m": offset_m, "turn_deg": turn_deg}
