"""A drone that looks a tenth of a second ahead: what it hits, by what it knows of its depth.

A world is flown through by a simple reactive planner: of the headings in view it takes that with a
free corridor which lies nearest to its goal, as fast as the corridor is long, and turns on the spot
where none is free. Goals are drawn in the world's free air; one that is not reached in time is
given up. What touches a surface begins again where the flight began, with another goal.

The rig's frames are taken at `FRAMES_PER_S`, a quarter of its rate: a memory gets a quarter of its
points. Light is the surrogate's, poses are off as an autopilot's.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, field, replace

import numpy as np
from depth_sets import JUDGED_BY
from flight_sets import POSE_ERRORS, SEED
from scipy.spatial.transform import Rotation

import spisim
from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from reconstruction.capture import Poses
from reconstruction.depth import Corridor, nearest_obstacle_m, pixel_rays
from spisim.instrument import Instrument
from spisim.scene import Scene, draw_scene
from spisim.simulation.flight.camera import Camera, solver
from spisim.simulation.flight.motion import Motion, scene_at
from spisim.simulation.flight.pose_error import StatedPoses
from spisim.transport import ground_truth
from spisim_serving.obstacles import CLEARANCE_M, Obstacles

FRAMES_PER_S = 117.2 / 4
DECIDE_EVERY = 3
"""Frames between two decisions."""
WAY_M, MAX_S = 60.0, 45.0
TOP_M_S, ACCELERATION_M_S2, TURN_RAD_S = 2.0, 5.0, np.radians(90)
STOP_M, SLOW_S = 0.8, 1.5
"""It stands where the way ahead is that short, and flies so long a way in so many seconds."""
FREE_M = 2.0
"""A heading is free if its corridor is free so far."""
GOAL_M, REACHED_M, GOAL_S = (6.0, 14.0), 1.0, 12.0
COMMIT_S = 1.0
"""After turning on the spot it keeps to what was free so long."""
REMEMBERS = "flight"
SENSES = {
    "single frame": ("fog", "learned"),
    "memory": ("fog", REMEMBERS),
    "memory, steered": ("fog-steered", REMEMBERS),
    "true depth": ("fog", None),
}
FAMILIES = tuple(each for each in JUDGED_BY if each != "targets")
WEATHERS = {"clear": None, "fog 70 m": 70.0}

FreeWay = Callable[[Floats], float]
"""Distance of the nearest obstacle along a direction (3,) of the optical frame."""


@dataclass(frozen=True)
class Flown:
    """What a flight came to: metres, seconds, goals reached, and positions (n, 3) of collisions."""

    family: str
    seed: int
    weather: str
    sense: str
    way_m: float
    seconds: float
    goals: int
    hits: int
    path_m: Floats
    hits_m: Floats


class Eyes:
    """What a drone knows of the free way: from its own frames, or the truth."""

    def __init__(self, scene: Scene, sense: str, seed: int) -> None:
        preset, self._method = SENSES[sense]
        self._scene, self._instrument = scene, spisim.load_instrument(preset)
        self._rays = _rays(self._instrument)
        self.frame_s = self._instrument.frame_time_s
        self.max_rad = float(np.arctan(np.abs(self._rays[..., 0]).max()))

        if self._method is None:
            return
        light = solver(self._instrument, "surrogate", seed=seed)
        self._camera = Camera(scene, self._instrument, self, light, seed=seed, cached=2)
        self._now = Motion.at_rest(scene, self._instrument.frame_time_s)
        self._errors = _pose_errors(seed)
        setup = replace(self._camera.setup(self._now), poses=self._stated(0, self._now))
        self._reconstruct = Reconstructor(setup, depth=self._method)

    def positions(self, motion: Motion, fractions: Floats) -> Floats:
        """The image's light is that of the frame of the last decision; see `Keys`."""
        return np.full((len(fractions), 1), float(self._number // DECIDE_EVERY))

    def scene(self, node: tuple[int, ...]) -> Scene:
        """See `Keys`."""
        return self._now.scene(self._scene, 0.5)

    _number = 0

    def see(self, number: int, motion: Motion, *, decide: bool) -> FreeWay | None:
        """Take a frame; the free way if it is time to decide. Others are for the memory alone."""
        if not decide and self._method != REMEMBERS:
            return None
        self._number, self._now = number, motion
        if self._method is None:
            return self._true_way(motion)
        (shot,) = self._camera.shoot([motion], number)
        frame = replace(shot.frame, poses=self._stated(number, motion))
        try:
            result = self._reconstruct(frame)
        except InputError:  # all readings are saturated, next to a wall
            return _blocked if decide else None
        if not decide:
            return None
        if not result.corridors:
            return _blocked
        return lambda direction: _unless_nan(nearest_obstacle_m(result.free_towards(direction)))

    def _true_way(self, motion: Motion) -> FreeWay:
        truth = ground_truth(motion.scene(self._scene, 0.5), self._instrument, subpixels=1)
        return lambda direction: _unless_nan(
            Corridor(self._rays, direction).nearest_m(truth.depth_m)
        )

    def _stated(self, number: int, motion: Motion) -> Poses:
        error = self._errors.errors[number]
        turn = motion.turns(np.array([0.5])) * Rotation.from_rotvec(error[None, 3:])
        return Poses(
            time_s=np.array([motion.time_s + 0.5 * motion.duration_s]),
            position_m=motion.positions_m(np.array([0.5])) + error[:3],
            orientation=turn.as_quat(),
            covariance=(self._errors.variances[number, :, None] * np.eye(6))[None],
        )


def _rays(instrument: Instrument) -> Floats:
    from spisim.simulation.measurement import recorded_optics

    optics = recorded_optics(instrument)
    assert optics is not None
    return pixel_rays(optics, instrument.projector.shape)


def _pose_errors(seed: int) -> StatedPoses:
    times_s = np.arange(int(MAX_S * FRAMES_PER_S) + 2) / FRAMES_PER_S
    stream = np.random.SeedSequence([SEED, seed])
    return StatedPoses.drawn(None, times_s, POSE_ERRORS["correlated"], stream)  # type: ignore[arg-type]


def _blocked(direction: Floats) -> float:
    return 0.0


def _unless_nan(distance_m: float) -> float:
    return np.inf if np.isnan(distance_m) else distance_m


@dataclass
class Drone:
    """Position (3,), heading about the vertical, and velocity (3,); level flight."""

    position_m: Floats
    heading_rad: float
    velocity_m_s: Floats = field(default_factory=lambda: np.zeros(3))

    def axes(self) -> Rotation:
        """World from optical frame."""
        c, s = np.cos(self.heading_rad), np.sin(self.heading_rad)
        return Rotation.from_matrix(np.array([[s, 0, c], [-c, 0, s], [0, -1, 0]]))

    def fly(self, speed_m_s: float, course_rad: float, turn_rad: float, step_s: float) -> None:
        """Accelerate towards a speed along a course, and turn, for a step."""
        wanted = speed_m_s * np.array([np.cos(course_rad), np.sin(course_rad), 0.0])
        change = wanted - self.velocity_m_s
        size = float(np.linalg.norm(change))
        self.velocity_m_s += change * min(1.0, ACCELERATION_M_S2 * step_s / max(size, 1e-9))
        self.position_m = self.position_m + self.velocity_m_s * step_s
        self.heading_rad += float(np.clip(turn_rad, -TURN_RAD_S * step_s, TURN_RAD_S * step_s))


@dataclass
class Planner:
    """Takes the free heading nearest to the goal; turns on the spot where none is."""

    max_rad: float
    turning: float = 0.0
    committed_s: float = 0.0
    speed_m_s: float = 0.0
    offset_rad: float = 0.0

    def decide(self, free_m: FreeWay, bearing_rad: float, step_s: float) -> None:
        """Choose speed and heading; `bearing_rad` is the goal's, left of the heading."""
        offsets = np.linspace(-0.85, 0.85, 7) * self.max_rad
        ways_m = np.array([free_m(np.array([-np.sin(o), 0.0, np.cos(o)])) for o in offsets])
        self.committed_s = max(0.0, self.committed_s - step_s)
        free = ways_m > FREE_M
        if not free.any():
            self.speed_m_s = 0.0
            self.turning = self.turning or (1.0 if bearing_rad > 0 else -1.0)
            self.offset_rad = self.turning * np.pi / 2
            self.committed_s = COMMIT_S
            return
        wanted = 0.0 if self.committed_s > 0 else bearing_rad
        if self.committed_s == 0:
            self.turning = 0.0
        best = int(np.argmin(np.where(free, np.abs(offsets - wanted), np.inf)))
        self.offset_rad = float(offsets[best])
        away = abs(bearing_rad) > self.max_rad and self.committed_s == 0
        if away:
            self.offset_rad = bearing_rad
        room_m = ways_m[best if not away else len(offsets) // 2]
        self.speed_m_s = float(np.clip((room_m - STOP_M) / SLOW_S, 0, 0.5 if away else TOP_M_S))


def world(family: str, seed: int, weather: str) -> Scene:
    """A drawn world in its weather."""
    visibility_m = WEATHERS[weather]
    fog = visibility_m and {"kind": "moderate-radiation", "visibility_m": visibility_m}
    return draw_scene(family, SEED + seed, changes={"fog": fog, "rain": None})


def fly(family: str, seed: int, weather: str, sense: str) -> Flown:
    """One flight through a drawn world."""
    scene = world(family, seed, weather)
    obstacles, rng = Obstacles(scene), np.random.default_rng([SEED, seed])
    ahead = scene.drone_pose[:3, 2]
    drone = Drone(scene.drone_pose[:3, 3].copy(), float(np.arctan2(ahead[1], ahead[0])))
    start = np.eye(4)
    start[:3, :3], start[:3, 3] = drone.axes().as_matrix(), drone.position_m
    eyes = Eyes(scene_at(scene, 0.0, start), sense, seed)
    planner, step_s = Planner(eyes.max_rad), 1 / FRAMES_PER_S
    goals = _goals(drone.position_m, obstacles, rng)
    goal, since_s, reached, way_m = next(goals), 0.0, 0, 0.0
    path, hits = [drone.position_m], []
    number = 0
    while way_m < WAY_M and number * step_s < MAX_S:
        time_s = number * step_s
        to_goal = goal - drone.position_m
        if np.linalg.norm(to_goal[:2]) < REACHED_M or time_s - since_s > GOAL_S:
            reached += bool(np.linalg.norm(to_goal[:2]) < REACHED_M)
            goal, since_s = next(goals), time_s
            continue
        turns = drone.axes()
        stop_m = drone.position_m + drone.velocity_m_s * eyes.frame_s
        motion = Motion(time_s, eyes.frame_s, drone.position_m, stop_m, turns, turns)
        way = eyes.see(number, motion, decide=number % DECIDE_EVERY == 0)
        if way is not None:
            bearing = np.arctan2(to_goal[1], to_goal[0]) - drone.heading_rad
            planner.decide(
                way, float((bearing + np.pi) % (2 * np.pi) - np.pi), DECIDE_EVERY * step_s
            )
        before_m = drone.position_m
        course = drone.heading_rad + (planner.offset_rad if planner.speed_m_s else 0.0)
        if abs(planner.offset_rad) > eyes.max_rad:
            course = drone.heading_rad
        drone.fly(planner.speed_m_s, course, planner.offset_rad / DECIDE_EVERY, step_s)
        way_m += float(np.linalg.norm(drone.position_m - before_m))
        if obstacles.nearest(drone.position_m, time_s)[0] < CLEARANCE_M:
            hits.append(drone.position_m)
            drone.position_m = start[:3, 3].copy()
            drone.velocity_m_s = np.zeros(3)
            planner = Planner(eyes.max_rad)
            goal, since_s = next(goals), time_s
            to_goal = goal - drone.position_m
            drone.heading_rad = float(np.arctan2(to_goal[1], to_goal[0]))
        path.append(drone.position_m)
        number += 1
    return Flown(
        family, seed, weather, sense, way_m, number * step_s, reached, len(hits),
        np.array(path), np.array(hits).reshape(-1, 3),
    )  # fmt: skip


def _goals(start_m: Floats, obstacles: Obstacles, rng: np.random.Generator) -> Iterator[Floats]:
    """Places in free air, at the start's height, each some metres from the one before."""
    here = start_m
    while True:
        for _ in range(200):
            angle, far = rng.uniform(-np.pi, np.pi), rng.uniform(*GOAL_M)
            there = here + far * np.array([np.cos(angle), np.sin(angle), 0.0])
            if obstacles.problem(there, 0.0) is None:
                break
        yield there
        here = there
