"""Bare calibration targets: one known surface square to the line of sight, and nothing else."""

from collections.abc import Callable

import numpy as np

from spisim.scene.families.parts.draft import Draft, Family
from spisim.scene.families.parts.parameters import Parameters, drawn, drawn_log, one_of
from spisim.scene.families.parts.shapes import Mesh, block, union

EYE_M = (0.0, 0.0, 1.5)
#: A little more than what a field of 20° covers, per metre of distance.
SIZE_PER_M = 0.4
#: In front of the board, so that the drawn pattern stands out from it and leaves it closed.
RELIEF_M = 0.004


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


def build(parameters: TargetParameters, rng: np.random.Generator) -> Draft:
    """One target, dead ahead."""
    x = EYE_M[0] + parameters.distance_m
    draft = Draft(position_m=EYE_M, look_at_m=(x, *EYE_M[1:]), sky_klx=float(rng.uniform(0.1, 1.0)))
    _TARGETS[parameters.target](draft, parameters, (x, *EYE_M[1:]))
    return draft


def _plane(draft: Draft, parameters: TargetParameters, at: tuple[float, float, float]) -> None:
    _board(draft, parameters, at)


def _tilted_plane(
    draft: Draft, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    # Far enough across for the field still to be filled on the far side.
    size = SIZE_PER_M * parameters.distance_m * 4
    turn = (0.0, 0.0, parameters.tilt_deg)
    draft.box("board", parameters.bright, (0.02, size, size), at, turn)


def _step_wedge(draft: Draft, parameters: TargetParameters, at: tuple[float, float, float]) -> None:
    """Upright strips, each a step farther than the one to its left."""
    size = SIZE_PER_M * parameters.distance_m
    width = size / parameters.steps
    for i in range(parameters.steps):
        behind = (i - (parameters.steps - 1) / 2) * parameters.step_m
        # Overlapping strips leave no gap to look through between two steps.
        middle_x = at[0] + behind + parameters.step_m
        place = (middle_x, at[1] + size / 2 - (i + 0.5) * width, at[2])
        draft.box(f"step {i + 1}", parameters.bright, (2 * parameters.step_m, width, size), place)
    wall = (at[0] + parameters.steps * parameters.step_m + 1.0, *at[1:])
    draft.box("wall behind", parameters.dark, (0.02, 3 * size + 2, 3 * size + 2), wall)


def _siemens_star(
    draft: Draft, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    _board(draft, parameters, at)
    radius = 0.4 * SIZE_PER_M * parameters.distance_m
    edges = np.linspace(0, 2 * np.pi, 2 * parameters.spokes, endpoint=False)
    wedge = np.pi / parameters.spokes
    turn = 0.3 * wedge  # no edge along rows, columns or diagonals of pixels
    spokes = union([_spoke(radius, turn + edge, wedge) for edge in edges[::2]])
    draft.mesh("star", parameters.dark, spokes, (at[0] - RELIEF_M, *at[1:]))


def _resolution_bars(
    draft: Draft, parameters: TargetParameters, at: tuple[float, float, float]
) -> None:
    """Groups of three bars, upright and level, each group of bars 1/√2 as wide as the last."""
    _board(draft, parameters, at)
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
    draft.mesh("bars", parameters.dark, union(bars), (at[0] - RELIEF_M, *at[1:]))


def _board(draft: Draft, parameters: TargetParameters, at: tuple[float, float, float]) -> None:
    size = 1.1 * SIZE_PER_M * parameters.distance_m
    # Its front is where the target is, so that distances are those of its description.
    draft.box("board", parameters.bright, (0.02, size, size), (at[0] + 0.01, *at[1:]))


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


_TARGETS: dict[str, Callable[[Draft, TargetParameters, tuple[float, float, float]], None]] = {
    "plane": _plane,
    "tilted-plane": _tilted_plane,
    "step-wedge": _step_wedge,
    "siemens-star": _siemens_star,
    "resolution-bars": _resolution_bars,
}

FAMILY = Family("A calibration target dead ahead", TargetParameters, build)
