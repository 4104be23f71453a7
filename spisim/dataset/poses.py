"""Several poses of the drone in one scene, whose surfaces are made once for all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any, Self

import numpy as np
from pydantic import BeforeValidator, Field, model_validator
from scipy.spatial.transform import Rotation

from reconstruction.base.errors import InputError
from spisim.base.config import Count, NonNegative, Positive, Section, dump_yaml, load_yaml
from spisim.scene import Scene, Trajectory, at_drone_state
from spisim.scene.assemble import OPTICAL_FROM_BODY
from spisim.scene.layout import OFFERED, Needs, layout_problem
from spisim.scene.pose import pose_matrix
from spisim.scene.rays import first_hits

#: Poses that are tried before a scene counts as too narrow to move in.
ATTEMPTS = 40
#: Poses at which a flight is looked at, evenly along it.
WAY_POINTS = 6

#: Widest angle of a turn, either way.
Angle = Annotated[NonNegative, Field(le=180)]


class Poses(Section):
    """How many poses each scene is seen from, and how far they lie from the scene's own.

    The first is the scene's own. Of the others, offset and turn are uniform within plus and minus
    `offset_m` (forward, left, up) and `turn_deg` (roll, pitch, yaw), in the drone's body frame; one
    in which a drone cannot fly, behind something, or none of whose lasers meets anything near by
    (where one does in the scene's own), is drawn again from a narrower range.

    With `flight_s` they are those of a flight of so many seconds, at equal steps of time, straight
    from the scene's own to one drawn like this; what moves in the scene moves on.
    """

    count: Annotated[Count, Field(le=10_000)] = 1
    """How many, the first of which is the scene's own."""
    flight_s: Positive | None = None
    """They are those of a flight of so long, at equal steps of time."""
    offset_m: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 0.5)
    """Farthest forward, left and up, either way."""
    turn_deg: tuple[Angle, Angle, Angle] = (5.0, 10.0, 25.0)
    """Widest roll, pitch and yaw, either way."""

    @model_validator(mode="after")
    def _fly_somewhere(self) -> Self:
        if self.flight_s is not None and self.count < 2:
            raise ValueError(f"count: {self.count}; a flight has 2 poses at least")
        return self


def _section(value: Any) -> Any:
    return value if isinstance(value, Mapping | Poses) else {"count": value}


#: A field of a file that may be their number alone.
AnyPoses = Annotated[Poses, BeforeValidator(_section, json_schema_input_type=int | Poses)]


@dataclass(frozen=True)
class View:
    """One of a scene's poses, by its number, 0 for the scene's own, and what it is drawn from.

    All poses of a flight have one seed.
    """

    number: int
    around: Poses
    seed: int

    def of(self, scene: Scene) -> Scene:
        """The scene from this pose; its text says so.

        Raises InputError where no pose of many is one to fly in, and where the file has a `moment`,
        which sets the pose.
        """
        flight_s = self.around.flight_s
        if self.number == 0 and flight_s is None:
            return scene
        fields = load_yaml(scene.text, scene.name)
        if fields.get("moment") is not None:
            raise InputError(f"scene {scene.name!r}: a scene at a moment of a flight has one pose")
        if flight_s is not None:
            time_s = flight_s * self.number / (self.around.count - 1)
            return at_drone_state(scene, self._flight(scene, flight_s).drone_state(time_s))
        needs = _needs(scene)
        for offset_m, turn_deg, seen in self._drawn(scene):
            problem = _behind(scene, seen) or layout_problem(seen, needs)
            if problem is None:
                drone = _reported(fields.get("drone") or {}, offset_m, turn_deg)
                return replace(seen, text=dump_yaml({**fields, "drone": drone}))
        raise InputError(
            f"scene {scene.name!r}: none of {ATTEMPTS} poses is one to fly in; in the last, "
            f"{problem}"
        )

    def _drawn(self, scene: Scene) -> Iterator[tuple[list[float], list[float], Scene]]:
        """Offset, turn and the scene from there, from ever narrower ranges."""
        rng = np.random.default_rng(self.seed)
        for attempt in range(ATTEMPTS):
            width = (1 - attempt / ATTEMPTS) * rng.uniform(-1, 1, (2, 3))
            offset_m, turn_deg = np.round(width * (self.around.offset_m, self.around.turn_deg), 4)
            drawn = pose_matrix(turn_deg, offset_m)
            moved = scene.drone_pose @ OPTICAL_FROM_BODY @ drawn @ OPTICAL_FROM_BODY.T
            yield offset_m.tolist(), turn_deg.tolist(), replace(scene, drone_pose=np.asarray(moved))

    def _flight(self, scene: Scene, flight_s: float) -> Trajectory:
        """From the scene's own pose to one to fly in, on a way on which all are."""
        needs = _needs(scene)
        times = flight_s * np.arange(1, WAY_POINTS + 1) / WAY_POINTS
        for _, _, end in self._drawn(scene):
            both = np.stack([scene.drone_pose, end.drone_pose])
            flight = Trajectory.through(
                np.array([0.0, flight_s]), both[:, :3, 3], Rotation.from_matrix(both[:, :3, :3])
            )
            along = (at_drone_state(scene, flight.drone_state(float(time_s))) for time_s in times)
            problems = (layout_problem(seen, needs) for seen in along)
            problem = _behind(scene, end) or next(filter(None, problems), None)
            if problem is None:
                return flight
        raise InputError(
            f"scene {scene.name!r}: none of {ATTEMPTS} flights leads through poses to fly in; in "
            f"the last, {problem}"
        )


def _needs(scene: Scene) -> Needs:
    """Of its poses: a spot that returns, unless none does in the scene's own."""
    own = layout_problem(scene, OFFERED) is None
    return OFFERED if own else replace(OFFERED, min_spots=0)


def _behind(scene: Scene, seen: Scene) -> str | None:
    """Whether something is between the scene's own pose and another, in words."""
    start, stop = scene.drone_pose[:3, 3], seen.drone_pose[:3, 3]
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    (crossed,) = first_hits(start, (stop - start)[None], triangles)
    return "something is between it and the scene's own" if crossed <= 1 else None


def _reported(
    drone: Mapping[str, Any], offset_m: list[float], turn_deg: list[float]
) -> dict[str, Any]:
    """Fields of the drone that add an offset and a turn to those it has."""
    own_turn, own_offset = drone.get("turn_deg", (0, 0, 0)), drone.get("offset_m", (0, 0, 0))
    if any(own_turn) or any(own_offset):
        both = pose_matrix(own_turn, own_offset) @ pose_matrix(turn_deg, offset_m)
        angles = Rotation.from_matrix(both[:3, :3]).as_euler("xyz", degrees=True)
        offset_m, turn_deg = (np.round(each, 6).tolist() for each in (both[:3, 3], angles))
    return {**drone, "offset_m": offset_m, "turn_deg": turn_deg}
