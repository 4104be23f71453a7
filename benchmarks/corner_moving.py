"""Things that cross the view: what the memory of a flight makes of them, and the single frame.

Into drawn rooms, which nothing was learned from, comes a person who walks across, a door that
swings, or a slab that slides by, before a drone that hovers or flies ahead. Depth and the obstacle
in the corridor are compared with the truth while the thing is in view and after it left.
"""

import sys
import tempfile
from collections.abc import Callable, Iterator, Sequence
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import count, islice
from pathlib import Path

import numpy as np
import trimesh
from flight_judging import Judged, Made, alone, judged, remembered, single_frames
from flight_sets import POSE_ERRORS, SEED, with_error
from intervals import of_figure
from scipy.spatial.transform import Rotation

import spisim
from reconstruction import read_capture
from reconstruction.base.arrays import Floats
from reconstruction.capture import Capture
from reconstruction.depth import Corridor, nearest_obstacle_m, pixel_rays
from spisim.atmosphere import CLEAR
from spisim.scene import Ambient, Scene, SceneObject, Trajectory
from spisim.scene.materials import find_material
from spisim.simulation.flight import record_flight
from spisim.simulation.measurement import recorded_optics
from spisim.transport import ground_truths
from spisim_paper.checks import Check, Table, checks_table
from spisim_worlds.parts import figure
from spisim_worlds.parts.figure import Arm, Leg

PRESET = "fog-steered"
THINGS = ("person", "door", "slab")
MOTIONS = ("hover", "forward")
FLIGHTS, QUICK_FLIGHTS, WORKERS = 24, 2, 2
BEFORE_S, AFTER_S = 0.35, 0.3
"""Time before the thing comes into view, and after it has left."""
TRUTH_EVERY, LIGHT_SPACING_M = 2, 0.08
CLOSE = 1.25
"""Ratio of a reported and the true obstacle."""
BEHIND_M, BOXES = (1.3, 4.0), 6
"""From the thing to what is behind it, and how much of that there is before the wall."""
MATERIALS = ("concrete", "plaster", "brick", "brick-dark", "plywood", "pvc", "asphalt")
RATIO, REPORT_S, GHOST_S = 1.0, 0.2, 0.2
DOOR_M = (0.9, 2.0, 0.04)
Placed = tuple[tuple[SceneObject, ...], float]
"""Things at the start of a flight, and the time that they are in view, s."""


@dataclass(frozen=True)
class Crossing:
    """What memory and single frame make of a thing that crosses the view.

    Mean relative errors are those from when it comes into view until ``AFTER_S`` after it left.
    Times, s, are those from when the corridor's obstacle is the thing until it is reported, and
    for which it is reported after it left the corridor; ``single_*`` are the single frame's.
    """

    name: str
    thing: str
    motion: str
    abs_rel: float
    single_abs_rel: float
    report_s: float
    single_report_s: float
    ghost_s: float
    single_ghost_s: float

    @property
    def ratio(self) -> float:
        """Relative error with memory over that of the single frame."""
        return self.abs_rel / self.single_abs_rel


@dataclass(frozen=True, eq=False)
class Hinged(SceneObject):
    """An object that turns about a point, (3,) of the world; its velocity is that of its middle."""

    hinge_m: tuple[float, float, float] = (0.0, 0.0, 0.0)
    spin_rad_s: tuple[float, float, float] = (0.0, 0.0, 0.0)

    def motion(self, time_s: float) -> Floats:
        """See `SceneObject`."""
        turn, hinge_m = np.eye(4), np.array(self.hinge_m)
        spin = time_s * np.array(self.spin_rad_s)
        turn[:3, :3] = Rotation.from_rotvec(spin).as_matrix()
        turn[:3, 3] = hinge_m - turn[:3, :3] @ hinge_m
        return turn


def crossings(quick: bool) -> list[Crossing]:
    """Fly and judge; equal calls give equal records."""
    drawn = islice(_drawn(quick), QUICK_FLIGHTS if quick else FLIGHTS)
    with ProcessPoolExecutor(WORKERS) as pool:
        return list(pool.map(crossing, drawn))


def crossing_checks(records: Sequence[Crossing]) -> Iterator[Check]:
    """What is promised of things that move."""
    logs = np.log([each.ratio for each in records])
    flights = np.arange(len(records))

    def ratio(some: Floats) -> float:
        return float(np.exp(logs[some].mean()))

    yield Check("things that cross: AbsRel over the single frame", ratio(flights), RATIO,
                interval=of_figure(ratio, flights, positive=True))  # fmt: skip
    for what, field, limit in (
        ("until they are reported", "report_s", REPORT_S),
        ("reported after they left", "ghost_s", GHOST_S),
    ):
        times_s = np.array([getattr(each, field) for each in records])
        times_s = times_s[np.isfinite(times_s)]
        mean = _mean_of(times_s)
        some = np.arange(len(times_s))
        yield Check(f"things that cross: s {what}", mean(some), limit,
                    interval=of_figure(mean, some))  # fmt: skip


def _mean_of(values: Floats) -> Callable[[Floats], float]:
    return lambda some: float(values[some].mean())


@dataclass(frozen=True, eq=False)
class Drawn:
    """A world with a thing in it, the drone's path, and when the thing is in view."""

    name: str
    thing: str
    motion: str
    world: Scene
    things: tuple[SceneObject, ...]
    path: Trajectory
    gone_s: float
    seed: int


def _drawn(quick: bool) -> Iterator[Drawn]:
    """Flights without end; each in a room of its own."""
    for number in count():
        rng = np.random.default_rng([SEED, 7, number])
        thing, motion = THINGS[number % 3], MOTIONS[number // 3 % 2]
        distance_m = rng.uniform(2.2, 3.8)
        world = _room(rng, distance_m + rng.uniform(*BEHIND_M))
        speed_m_s = rng.uniform(1.4, 1.8) if quick else rng.uniform(0.7, 1.7)
        side = rng.choice([-1.0, 1.0])
        things, in_view_s = PLACED[thing](rng, world.drone_pose, distance_m, side * speed_m_s)
        gone_s = BEFORE_S + in_view_s
        path = _path(world, motion, rng.uniform(0.4, 1.0), gone_s + AFTER_S, gone_s / 2)
        name = f"{number} {thing} {motion} {distance_m:.1f} m {speed_m_s:.1f} m/s"
        yield Drawn(name, thing, motion, world, things, path, gone_s, number)


def _room(rng: np.random.Generator, wall_m: float) -> Scene:
    """A room with things before its far wall, seen along x."""
    sides = {
        "far": ([0.1, 12, 6], [wall_m + 0.6, 0, 1]),
        "floor": ([16, 12, 0.1], [5, 0, -1.4]),
        "left": ([16, 0.1, 6], [5, rng.uniform(1, 3), 1]),
    }
    for number in range(BOXES):
        size_m = rng.uniform([0.1, 0.1, 0.2], [0.6, 0.8, 2.5])
        at_m = [wall_m + rng.uniform(0, 0.3), rng.uniform(-1, 1), rng.uniform(-1.2, 1)]
        sides[f"box {number}"] = (size_m, [at_m[0] + size_m[0] / 2, *at_m[1:]])
    objects = tuple(
        SceneObject(name, trimesh.creation.box(size_m).apply_translation(at_m),
                    find_material(str(rng.choice(MATERIALS))))
        for name, (size_m, at_m) in sides.items()
    )  # fmt: skip
    pose = np.eye(4)
    pose[:3, :3] = [[0, 0, 1], [-1, 0, 0], [0, -1, 0]]
    return Scene("room", objects, CLEAR, Ambient(), drone_pose=pose)


def _obstacles_m(world: Scene, poses: Sequence[Floats]) -> Floats:
    """Distances of the corridor's nearest obstacle in poses (4, 4); inf for none."""
    instrument = spisim.load_instrument(PRESET)
    optics = recorded_optics(instrument)
    assert optics is not None
    truths = ground_truths(
        [(replace(world, drone_pose=pose), instrument) for pose in poses], subpixels=1
    )
    depths_m = [truth.depth_m.astype(np.float64) for truth in truths]
    corridor = Corridor(pixel_rays(optics, depths_m[0].shape))
    return np.nan_to_num([corridor.nearest_m(each) for each in depths_m], nan=np.inf)


def _path(
    world: Scene, motion: str, speed_m_s: float, duration_s: float, middle_s: float
) -> Trajectory:
    """Hovering or straight ahead, through the world's pose in the middle."""
    times_s = np.linspace(0, duration_s + 0.02, 41)
    pose, since_s = world.drone_pose, times_s - middle_s
    if motion == "forward":
        way_m = np.outer(speed_m_s * since_s, pose[:3, 2])
    else:
        way_m = np.outer(0.02 * np.sin(3 * since_s), pose[:3, 0])
    turn = np.zeros((len(times_s), 3))
    turn[:, 1] = np.radians(0.5) * np.sin(2.5 * since_s)
    turns = Rotation.from_matrix(pose[:3, :3]) * Rotation.from_rotvec(turn)
    return Trajectory.through(times_s, pose[:3, 3] + way_m, turns)


def _walking(rng: np.random.Generator, pose: Floats, distance_m: float, speed_m_s: float) -> Placed:
    """A person who walks across, the chest on the axis."""
    legs = (Leg(24, 6), Leg(-14, 22))
    sides = tuple(
        figure.posed(side, Arm(float(rng.uniform(5, 60)), 60, 20), leg)
        for side, leg in zip((-1, 1), legs, strict=True)
    )
    parts = {
        rng.choice(["polyester-fabric", "cotton-white"]): figure.jacket(sides),
        rng.choice(["leather", "concrete"]): figure.trousers(sides),
        "skin": figure.skin(sides),
        "polypropylene": figure.hard_hat(),
    }
    heading = np.radians(90 if speed_m_s > 0 else -90)
    around = trimesh.transformations.rotation_matrix(heading, (0, 0, 1))
    meshes = {}
    for material, mesh in parts.items():
        mesh.apply_translation((0, 0, -1.2))
        mesh.apply_transform(around)
        meshes[str(material)] = mesh
    return _sliding(meshes, pose, distance_m, speed_m_s)


def _slab(rng: np.random.Generator, pose: Floats, distance_m: float, speed_m_s: float) -> Placed:
    """A slab or a post that slides by."""
    size_m = (rng.uniform(0.1, 0.5), rng.uniform(0.25, 0.7), rng.uniform(0.5, 1.8))
    turn = trimesh.transformations.rotation_matrix(rng.uniform(-0.6, 0.6), (0, 0, 1))
    material = str(rng.choice(["concrete", "pvc", "plaster", "brick"]))
    mesh = trimesh.creation.box(size_m).apply_transform(turn)
    return _sliding({material: mesh}, pose, distance_m, speed_m_s)


def _sliding(
    meshes: dict[str, trimesh.Trimesh], pose: Floats, distance_m: float, speed_m_s: float
) -> Placed:
    """Meshes about the origin, x ahead, y to the left and z up, that slide across the view."""
    half_m = max(float(np.abs(mesh.bounds[:, 1]).max()) for mesh in meshes.values())
    reach_m = half_m + (distance_m + half_m) * np.tan(np.radians(10))
    in_view_s = 2 * reach_m / abs(speed_m_s)
    right = np.sign(speed_m_s)
    start_m = pose[:3, 3] + distance_m * pose[:3, 2]
    start_m = start_m - right * (reach_m + BEFORE_S * abs(speed_m_s)) * pose[:3, 0]
    velocity = speed_m_s * pose[:3, 0]
    return tuple(
        SceneObject(material, _turned(mesh, pose, start_m), find_material(material),
                    tuple(velocity.tolist()))  # type: ignore[arg-type]
        for material, mesh in meshes.items()
    ), in_view_s  # fmt: skip


def _door(rng: np.random.Generator, pose: Floats, distance_m: float, speed_m_s: float) -> Placed:
    """A door that swings through the view, about a hinge out of view; its middle has the speed."""
    wide_m, high_m, thick_m = DOOR_M
    side = np.sign(speed_m_s)
    hinge_m = pose[:3, 3] + distance_m * pose[:3, 2]
    hinge_m = hinge_m + side * (0.22 * distance_m) * pose[:3, 0]
    mesh = trimesh.creation.box((thick_m, wide_m, high_m))
    mesh.apply_translation((0, wide_m / 2, 0))
    spin = abs(speed_m_s) * 2 / wide_m
    towards = rng.choice([-1.0, 1.0])
    # Across the view it points to the other side of its hinge; in view it is within 1.2 rad of it.
    start = -1.2 - BEFORE_S * spin
    across = 0.0 if side > 0 else np.pi
    mesh.apply_transform(
        trimesh.transformations.rotation_matrix(across + towards * start, (0, 0, 1))
    )
    up = -pose[:3, 1]
    made = Hinged(
        "door",
        _turned(mesh, pose, hinge_m),
        find_material(str(rng.choice(["pvc", "plywood", "paint-white"]))),
        tuple((speed_m_s * pose[:3, 0]).tolist()),  # type: ignore[arg-type]
        spin_rad_s=tuple((towards * spin * up).tolist()),  # type: ignore[arg-type]
        hinge_m=tuple(hinge_m.tolist()),
    )
    return (made,), 2.4 / spin


PLACED = {"person": _walking, "door": _door, "slab": _slab}


def _turned(mesh: trimesh.Trimesh, pose: Floats, at_m: Floats) -> trimesh.Trimesh:
    """A mesh of x ahead, y left, z up, about a point of the world."""
    into = np.eye(4)
    into[:3, :3] = np.stack([pose[:3, 2], -pose[:3, 0], -pose[:3, 1]], axis=1)
    into[:3, 3] = at_m
    return mesh.apply_transform(into)


def crossing(drawn: Drawn) -> Crossing:
    """Record a flight, and judge it."""
    scene = replace(drawn.world, objects=(*drawn.world.objects, *drawn.things))
    with tempfile.TemporaryDirectory() as folder:
        file = Path(folder) / "flight.h5"
        record_flight(file, scene, drawn.path, spisim.load_instrument(PRESET), light="surrogate",
                      seed=drawn.seed, truths=TRUTH_EVERY, spacing_m=LIGHT_SPACING_M)  # fmt: skip
        capture = read_capture(file)
    return judge(drawn, capture, single_frames(capture))


def judge(drawn: Drawn, capture: Capture, made: Made) -> Crossing:
    """Figures of a recorded flight and of the maps of its single frames."""
    assert capture.poses is not None
    stated = with_error(capture, POSE_ERRORS["correlated"], drawn.seed)
    figures = []
    for maps in (list(remembered(stated, made)), alone(made)):
        frames = list(judged(capture, maps, made))
        times_s = capture.poses.time_s[0] + np.array([each.time_s for each in frames])
        world_m = _obstacles_m(drawn.world, [drawn.path.pose(float(each)) for each in times_s])
        since = [each.abs_rel for each in frames if each.time_s >= BEFORE_S]
        figures.append((float(np.mean(since)), *_times_s(frames, world_m)))
    pairs = [value for pair in zip(*figures, strict=True) for value in pair]
    return Crossing(drawn.name, drawn.thing, drawn.motion, *pairs)


def _times_s(frames: Sequence[Judged], world_m: Floats) -> tuple[float, float]:
    """Time until a thing is reported, and for which it is after it has left, s.

    ``world_m`` (frames,) is where the corridor's obstacle is without the thing. Nan where the thing
    never is the obstacle.
    """
    true_m = np.array([each.obstacle_m for each in frames])
    stated_m = np.array([nearest_obstacle_m(each.free) for each in frames])
    step_s = frames[1].time_s - frames[0].time_s
    there = np.flatnonzero(true_m < world_m / CLOSE)
    if not len(there):
        return np.nan, np.nan
    first, last = there[[0, -1]]
    reported = stated_m[first:] < CLOSE * true_m[first:]
    until = int(np.argmax(reported)) if reported.any() else len(reported)
    limit_m = np.minimum(CLOSE * true_m[last], world_m[last + 1 :] / CLOSE)
    return until * step_s, int(np.sum(stated_m[last + 1 :] < limit_m)) * step_s


def crossings_table(records: Sequence[Crossing]) -> Table:
    """Every flight, memory / single frame."""
    rows = [
        (
            each.name,
            f"{each.abs_rel:.3f} / {each.single_abs_rel:.3f}",
            f"{each.ratio:.2f}",
            f"{each.report_s:.2f} / {each.single_report_s:.2f}",
            f"{each.ghost_s:.2f} / {each.single_ghost_s:.2f}",
        )
        for each in records
    ]
    title = "Things that cross the view, with memory / single frame."
    return Table(title, ("flight", "AbsRel", "ratio", "reported after, s", "ghost, s"), rows)


if __name__ == "__main__":
    RECORDS = crossings(quick="--quick" in sys.argv)
    print(crossings_table(RECORDS).text())
    print(checks_table(list(crossing_checks(RECORDS))).text())
