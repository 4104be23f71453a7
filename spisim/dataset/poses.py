"""Several drone poses in one scene, whose surfaces are built once for all of them."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import dataclass, replace
from typing import Annotated, Any

import numpy as np
from pydantic import BeforeValidator, Field
from scipy.spatial.transform import Rotation

from reconstruction import Capture
from reconstruction.base.errors import InputError
from reconstruction.capture import CaptureFile
from reconstruction.exports import TimestampedPose
from spisim.base.config import Count, NonNegative, Positive, Section, dump_yaml, load_yaml
from spisim.scene import Drone, Scene, Trajectory, at_drone_state
from spisim.scene.assemble import OPTICAL_FROM_BODY
from spisim.scene.layout import OFFERED, Needs, layout_problem
from spisim.scene.load_context import SceneCache
from spisim.scene.pose import pose_matrix
from spisim.scene.rays import first_hits

#: Poses to try before a scene counts as too narrow to move in.
MAX_ATTEMPTS = 40
#: Evenly spaced poses at which a flight is checked.
WAY_POINTS = 6

Angle = Annotated[NonNegative, Field(le=180)]

_cache = SceneCache()


def placed(capture: Capture | CaptureFile | None, frame: int) -> TimestampedPose | None:
    """Return the time in a flight and the pose at the middle of a simulated frame.

    The pose of a recorded flight is that which it states. Returns None for results and for
    recordings of a real camera without poses. Raises InputError for a capture whose scene is
    invalid.
    """
    if capture is None:
        return None
    if (poses := capture.frame(frame).poses) is not None:
        if not poses.known[0]:
            return None
        stated = np.eye(4)
        stated[:3, :3] = Rotation.from_quat(poses.orientation[0]).as_matrix()
        stated[:3, 3] = poses.position_m[0]
        return TimestampedPose(float(poses.time_s[0]), stated)
    if not capture.provenance.scene:
        return None
    drone = Drone.of(capture.provenance.scene, "scene", _cache)
    buckets = capture.setup.buckets
    middle_s = (frame + 0.5) * buckets.pattern_period_s * capture.setup.plan.exposures
    time_s = None if drone.time_s is None else drone.time_s + middle_s
    return TimestampedPose(time_s, drone.after(middle_s))


class Poses(Section):
    """How many poses each scene is seen from, and how far they lie from the scene's own.

    The first is the scene's own. The others add an offset and a turn in the drone's body frame,
    uniform within plus and minus `offset_m` (forward, left, up) and `turn_deg` (roll, pitch, yaw).
    A pose where the drone cannot fly, hidden from the scene's own, or with no laser spot near by
    (if the scene's own has one), is drawn again from a narrower range.

    With `flight_s` the poses lie at equal steps of time along a straight flight of that duration,
    from the scene's own pose to one drawn like this; moving objects keep moving.
    """

    count: Annotated[Count, Field(le=10_000)] = 1
    """Number of poses; the first is the scene's own."""
    flight_s: Positive | None = None
    """Duration of a flight along which the poses lie, at equal steps of time."""
    offset_m: tuple[NonNegative, NonNegative, NonNegative] = (1.0, 1.0, 0.5)
    """Maximum offset forward, left and up, either way."""
    turn_deg: tuple[Angle, Angle, Angle] = (5.0, 10.0, 25.0)
    """Maximum roll, pitch and yaw, either way."""


def _section(value: Any) -> Any:
    return value if isinstance(value, Mapping | Poses) else {"count": value}


#: A section, or the number of poses alone.
AnyPoses = Annotated[Poses, BeforeValidator(_section, json_schema_input_type=int | Poses)]


@dataclass(frozen=True)
class View:
    """One pose of a scene by its number, 0 for the scene's own, and the seed that it is drawn with.

    All poses of a flight have one seed.
    """

    number: int
    around: Poses
    seed: int

    def of(self, scene: Scene) -> Scene:
        """Return the scene from this pose, with the pose in its text.

        Raises InputError if no pose to fly in is drawn, or if the scene file has a `moment`, which
        fixes the pose.
        """
        flight_s = self.around.flight_s
        if self.number == 0 and flight_s is None:
            return scene
        fields = load_yaml(scene.text, scene.name)
        if fields.get("moment") is not None:
            raise InputError(f"scene {scene.name!r}: a scene with `moment` has a single pose")
        if flight_s is not None:
            time_s = flight_s * self.number / max(self.around.count - 1, 1)
            return at_drone_state(scene, self.flight(scene).drone_state(time_s))
        needs = _needs(scene)
        for offset_m, turn_deg, view in self._drawn(scene):
            problem = _behind(scene, view) or layout_problem(view, needs)
            if problem is None:
                drone = _moved(fields.get("drone") or {}, offset_m, turn_deg)
                return replace(view, text=dump_yaml({**fields, "drone": drone}))
        raise InputError(
            f"scene {scene.name!r}: the drone cannot fly in any of {MAX_ATTEMPTS} poses; in the "
            f"last, {problem}"
        )

    def _drawn(self, scene: Scene) -> Iterator[tuple[list[float], list[float], Scene]]:
        """Yield offset, turn and the scene from there, from ever narrower ranges."""
        rng = np.random.default_rng(self.seed)
        for attempt in range(MAX_ATTEMPTS):
            width = (1 - attempt / MAX_ATTEMPTS) * rng.uniform(-1, 1, (2, 3))
            offset_m, turn_deg = np.round(width * (self.around.offset_m, self.around.turn_deg), 4)
            drawn = pose_matrix(turn_deg, offset_m)
            moved = scene.drone_pose @ OPTICAL_FROM_BODY @ drawn @ OPTICAL_FROM_BODY.T
            yield offset_m.tolist(), turn_deg.tolist(), replace(scene, drone_pose=np.asarray(moved))

    def flight(self, scene: Scene) -> Trajectory:
        """Draw a flight from the scene's own pose to another, along which the drone can fly."""
        flight_s = self.around.flight_s
        assert flight_s is not None
        needs = _needs(scene)
        times = np.linspace(0, flight_s, WAY_POINTS + 1)[1:]  # the last exactly
        for _, _, end in self._drawn(scene):
            both = np.stack([scene.drone_pose, end.drone_pose])
            flight = Trajectory.through(
                np.array([0.0, flight_s]), both[:, :3, 3], Rotation.from_matrix(both[:, :3, :3])
            )
            along = (at_drone_state(scene, flight.drone_state(float(time_s))) for time_s in times)
            problems = (layout_problem(view, needs) for view in along)
            problem = _behind(scene, end) or next(filter(None, problems), None)
            if problem is None:
                return flight
        raise InputError(
            f"scene {scene.name!r}: the drone cannot fly any of {MAX_ATTEMPTS} flights; in the "
            f"last, {problem}"
        )


def _needs(scene: Scene) -> Needs:
    """Return what poses need: a spot with a return, if the scene's own pose has one."""
    own = layout_problem(scene, OFFERED) is None
    return OFFERED if own else replace(OFFERED, min_spots=0)


def _behind(scene: Scene, view: Scene) -> str | None:
    """Report a surface between the scene's own pose and another."""
    start, stop = scene.drone_pose[:3, 3], view.drone_pose[:3, 3]
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    (crossed,) = first_hits(start, (stop - start)[None], triangles)
    return "something is between it and the scene's own" if crossed <= 1 else None


def _moved(
    drone: Mapping[str, Any], offset_m: list[float], turn_deg: list[float]
) -> dict[str, Any]:
    """Add an offset and a turn to the fields of the drone."""
    own_turn, own_offset = drone.get("turn_deg", (0, 0, 0)), drone.get("offset_m", (0, 0, 0))
    if any(own_turn) or any(own_offset):
        both = pose_matrix(own_turn, own_offset) @ pose_matrix(turn_deg, offset_m)
        angles = Rotation.from_matrix(both[:3, :3]).as_euler("xyz", degrees=True)
        offset_m, turn_deg = (np.round(each, 6).tolist() for each in (both[:3, 3], angles))
    return {**drone, "offset_m": offset_m, "turn_deg": turn_deg}
