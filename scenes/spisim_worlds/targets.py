"""Calibration targets: one known surface square to the line of sight, or among others in a room."""

from collections.abc import Callable

import numpy as np

from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts.charts import CHARTS, chart, stand
from spisim_worlds.parts.shapes import Mesh, block, union
from spisim_worlds.parts.terrain import patchwork, terrain, waves
from spisim_worlds.parts.woods import add_far_woods

EYE_M = (0.0, 0.0, 1.5)
#: Slightly more than the width of a 20° field, per metre of distance.
SIZE_PER_M = 0.4
#: Distance of the pattern in front of the closed board.
RELIEF_M = 0.004
#: Materials of boards around the target.
BRIGHT = ("paint-white", "cardboard", "wood-dry", "pvc", "steel-painted")
DARK = ("rubber-black", "asphalt", "charcoal", "brick", "paint-black")


class TargetParameters(Parameters):
    """A board of `bright` with a pattern of `dark` on it, or a plane of `bright` alone."""

    target: str = one_of(
        "plane", "tilted-plane", "step-wedge", "siemens-star", "resolution-bars", text="which one"
    )
    distance_m: float = drawn_log(1.2, 9.0, "to the middle of the board")
    tilt_deg: float = drawn(20.0, 60.0, "of a tilted plane, about the vertical")
    steps: int = drawn(3, 8, "of a step wedge")
    step_m: float = drawn(0.05, 0.25, "depth of each step")
    spokes: int = drawn(6, 24, "of a Siemens star")
    bright: str = one_of("paint-white", "concrete", "cardboard", "wood-dry", text="of the board")
    dark: str = one_of("rubber-black", "asphalt", "charcoal", text="of the pattern")
    setting: str = one_of(
        "alone",
        "turned",
        "laboratory",
        "range",
        text="nothing else, or other boards, indoors or out",
    )
    azimuth_deg: float = drawn(-55.0, 55.0, "from which it is seen, where it is not alone")
    elevation_deg: float = drawn(-20.0, 30.0, "from which it is seen, where it is not alone")
    aim_deg: float = drawn(-8.0, 8.0, "of the line of sight beside it, where it is not alone")
    others: int = drawn(2, 9, "boards around it, where there are any")


def build(parameters: TargetParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build one target straight ahead; or from another side, with others around it."""
    x = EYE_M[0] + parameters.distance_m
    builder = SceneBuilder(
        position_m=EYE_M, look_at_m=(x, *EYE_M[1:]), sky_klx=float(rng.uniform(0.1, 1.0))
    )
    _TARGETS[parameters.target](builder, parameters, (x, *EYE_M[1:]))
    if parameters.setting != "alone":
        _seen_from_aside(builder, parameters, rng)
        _SETTINGS[parameters.setting](builder, parameters, rng)
    return builder


def _seen_from_aside(
    builder: SceneBuilder, parameters: TargetParameters, rng: np.random.Generator
) -> None:
    """Move the drone around the target at a constant distance, and look past its middle."""
    azimuth, elevation = np.radians([parameters.azimuth_deg, parameters.elevation_deg])
    level = np.cos(elevation)
    away = np.array([-level * np.cos(azimuth), level * np.sin(azimuth), np.sin(elevation)])
    target = np.asarray(builder.look_at_m, float)
    eye = target + parameters.distance_m * away
    past = parameters.distance_m * np.tan(np.radians(parameters.aim_deg))
    across = np.array([np.sin(azimuth), np.cos(azimuth), 0.0])
    aside = past * across + (0, 0, rng.uniform(-1, 1) * abs(past))
    builder.position_m, builder.look_at_m = tuple(eye), tuple(target + aside)


def _turned(builder: SceneBuilder, parameters: TargetParameters, rng: np.random.Generator) -> None:
    """Add only a wall behind."""
    behind = rng.uniform(0.3, 3.0)
    eye, target = np.asarray(builder.position_m), np.asarray(builder.look_at_m)
    view = (target - eye) / np.linalg.norm(target - eye)
    at = eye + (parameters.distance_m + behind) * view
    # The wall has a random orientation.
    turn = (
        0.0,
        rng.uniform(-20, 20),
        np.degrees(np.arctan2(view[1], view[0])) + rng.uniform(-30, 30),
    )
    wall = str(rng.choice(["plasterboard", "brick", "concrete", "plywood"]))
    builder.box("background", wall, (0.1, 40.0, 40.0), tuple(at), turn)


def _laboratory(
    builder: SceneBuilder, parameters: TargetParameters, rng: np.random.Generator
) -> None:
    """A room with a bench and boards on stands."""
    eye, target = np.asarray(builder.position_m), np.asarray(builder.look_at_m)
    low = min(0.0, eye[2] - 0.8) - rng.uniform(0.0, 0.4)
    half = float(np.clip(parameters.distance_m + rng.uniform(0.8, 2.0), 2.5, 9.0))
    x, y = target[:2]
    materials = rng.permutation(["plasterboard", "brick", "concrete", "plywood", "paint-white"])
    across, along = (0.1, 2 * half, 12.0), (2 * half, 0.1, 12.0)
    walls = [((x + way * half, y), across) for way in (-1, 1)]
    walls += [((x, y + way * half), along) for way in (-1, 1)]
    builder.box("floor", str(materials[0]), (60, 60, 0.1), (x, y, low - 0.05))
    for number, (at, size) in enumerate(walls, 1):
        builder.box(f"wall {number}", str(materials[number]), size, (*at, low + 6.0))
    x, y = target[:2] + rng.uniform(-0.5, 0.5, 2) * half
    builder.box("bench", "wood-dry", (0.8, 2.0, 0.06), (x, y, low + 0.75))
    _boards(builder, parameters, rng, low)


def _range(builder: SceneBuilder, parameters: TargetParameters, rng: np.random.Generator) -> None:
    """Build an outdoor test range: boards at all distances, land to the horizon."""
    low = min(0.0, float(builder.position_m[2]) - 1.0)
    rolling = waves(rng, (30, 200))
    land = terrain(lambda x, y: low - 0.3 + 0.3 * rolling(x, y), ((-20, 20), (-20, 20)), 2.0)
    land.add(builder, ["grass", "gravel", "asphalt"], patchwork(rng, land, 3, 6.0))
    heading = np.subtract(builder.look_at_m, builder.position_m)
    add_far_woods(
        builder, rng, land, 6, 60.0, float(np.degrees(np.arctan2(heading[1], heading[0])))
    )
    _boards(builder, parameters, rng, low)


def _boards(
    builder: SceneBuilder, parameters: TargetParameters, rng: np.random.Generator, low: float
) -> None:
    """Add charts on stands in view, before and behind the target, at random orientations."""
    eye = np.asarray(builder.position_m)
    view = np.subtract(builder.look_at_m, eye)
    view = view / np.linalg.norm(view)
    left = np.array([-view[1], view[0], 0.0]) / np.hypot(*view[:2])
    up = np.cross(view, left)
    for number in range(1, parameters.others + 1):
        away = parameters.distance_m * rng.uniform(0.55, 2.2)
        y, z = rng.uniform(-0.2, 0.2, 2) * away
        at = eye + away * view + y * left + z * up
        if at[2] - low < 0.2 or away < 1.1:
            continue
        width, height = rng.uniform(0.08, 0.3, 2) * away
        heading = float(np.degrees(np.arctan2(view[1], view[0])))
        turn = (0.0, rng.uniform(-25, 25), heading + rng.uniform(-50, 50))
        board, pattern = chart(rng, str(rng.choice(CHARTS)), width, height)
        bright, dark = str(rng.choice(BRIGHT)), str(rng.choice(DARK))
        if rng.random() < 0.3:
            bright, dark = dark, bright
        builder.mesh(f"chart {number}", bright, board, tuple(at), turn)
        builder.mesh(f"pattern of chart {number}", dark, pattern, tuple(at), turn)
        builder.mesh(
            f"stand {number}", "steel-painted", stand(at[2] - low), tuple(at), (0, 0, turn[2])
        )


def _plane(
    builder: SceneBuilder, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    _board(builder, parameters, at)


def _tilted_plane(
    builder: SceneBuilder, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    # Wide enough to fill the field on the far side.
    size = SIZE_PER_M * parameters.distance_m * 4
    turn = (0.0, 0.0, parameters.tilt_deg)
    builder.box("board", parameters.bright, (0.02, size, size), at, turn)


def _step_wedge(
    builder: SceneBuilder, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    """Upright strips, each a step farther than the one to its left."""
    size = SIZE_PER_M * parameters.distance_m
    width = size / parameters.steps
    for i in range(parameters.steps):
        behind = (i - (parameters.steps - 1) / 2) * parameters.step_m
        # Overlapping strips leave no gap between two steps.
        middle_x = at[0] + behind + parameters.step_m
        position = (middle_x, at[1] + size / 2 - (i + 0.5) * width, at[2])
        builder.box(
            f"step {i + 1}", parameters.bright, (2 * parameters.step_m, width, size), position
        )
    wall = (at[0] + parameters.steps * parameters.step_m + 1.0, *at[1:])
    builder.box("wall behind", parameters.dark, (0.02, 3 * size + 2, 3 * size + 2), wall)


def _siemens_star(
    builder: SceneBuilder, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    _board(builder, parameters, at)
    radius = 0.4 * SIZE_PER_M * parameters.distance_m
    edges = np.linspace(0, 2 * np.pi, 2 * parameters.spokes, endpoint=False)
    wedge = np.pi / parameters.spokes
    turn = 0.3 * wedge  # avoids edges along rows, columns or diagonals of pixels
    spokes = union([_spoke(radius, turn + edge, wedge) for edge in edges[::2]])
    builder.mesh("star", parameters.dark, spokes, (at[0] - RELIEF_M, *at[1:]))


def _resolution_bars(
    builder: SceneBuilder, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    """Groups of three bars, upright and level, each group of bars 1/√2 as wide as the last."""
    _board(builder, parameters, at)
    size = SIZE_PER_M * parameters.distance_m
    width, top = 0.04 * size, 0.44 * size
    bars = []
    while width > 0.005 * size:
        for i in range(3):
            offset = (2 * i + 0.5) * width
            upright = (0.0, 0.42 * size - offset, top - 2.5 * width)
            level = (0.0, -0.08 * size - 2.5 * width, top - offset)
            bars.append(block((RELIEF_M, width, 5 * width), upright))
            bars.append(block((RELIEF_M, 5 * width, width), level))
        top -= 6.5 * width
        width /= np.sqrt(2)
    builder.mesh("bars", parameters.dark, union(bars), (at[0] - RELIEF_M, *at[1:]))


def _board(
    builder: SceneBuilder, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    size = 1.1 * SIZE_PER_M * parameters.distance_m
    # Its front is at the target, so that distances are as described.
    builder.box("board", parameters.bright, (0.02, size, size), (at[0] + 0.01, *at[1:]))


def _spoke(radius: float, start: float, angle: float) -> Mesh:
    """Wedge of a thin disc about x, closed."""
    angles = np.linspace(start, start + angle, 9)
    rim = np.stack([np.zeros(9), radius * np.cos(angles), radius * np.sin(angles)], axis=1)
    front = np.vstack([np.zeros((1, 3)), rim])
    back = front + np.array([RELIEF_M / 2, 0, 0])
    n = len(front)
    fan = np.stack([np.zeros(8, int), np.arange(2, 10), np.arange(1, 9)], axis=1)
    loop = np.arange(n)
    following = (loop + 1) % n
    sides = np.vstack(
        [
            np.stack([loop, following, following + n], axis=1),
            np.stack([loop, following + n, loop + n], axis=1),
        ]
    )
    return Mesh(np.vstack([front, back]), np.vstack([fan, fan[:, ::-1] + n, sides]), process=False)


_TARGETS: dict[
    str, Callable[[SceneBuilder, TargetParameters, tuple[float, float, float]], None]
] = {
    "plane": _plane,
    "tilted-plane": _tilted_plane,
    "step-wedge": _step_wedge,
    "siemens-star": _siemens_star,
    "resolution-bars": _resolution_bars,
}

_SETTINGS: dict[str, Callable[[SceneBuilder, TargetParameters, np.random.Generator], None]] = {
    "turned": _turned,
    "laboratory": _laboratory,
    "range": _range,
}

FAMILY = Family(
    "Calibration targets: one dead ahead, or several on stands, indoors or in the open",
    TargetParameters,
    build,
    min_spots=2,
)
