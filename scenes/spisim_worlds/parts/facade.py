"""Fronts of houses: a wall with windows of glass, rooms behind, doors.

A front lies in the plane y = 0 and is seen from negative y; it stands on z = 0. Lengths in metres.
"""

from dataclasses import dataclass

import numpy as np

from spisim.scene.families import Pose, SceneBuilder
from spisim_worlds.parts.shapes import Mesh, block, grid_mesh, rod, union

WALL_M, ROOM_M, STOREY_M = 0.3, 2.2, 3.0
DOOR_M = (1.0, 2.15)


@dataclass(frozen=True)
class Front:
    """Bays side by side, each with one window per storey, or a door on the ground floor.

    `start_m` is where the first bay begins along x, and `door_bays` are those with a door.
    """

    start_m: float
    bays: int
    storeys: int
    bay_m: float
    window_m: tuple[float, float]
    sill_m: float
    door_bays: tuple[int, ...]

    def middle(self, bay: int) -> float:
        """x of the middle of a bay."""
        return self.start_m + (bay + 0.5) * self.bay_m

    def windows(self) -> list[tuple[float, float]]:
        """(x, z) of the middle of every window."""
        return [
            (self.middle(bay), storey * STOREY_M + self.sill_m + self.window_m[1] / 2)
            for storey in range(self.storeys)
            for bay in range(self.bays)
            if storey or bay not in self.door_bays
        ]


def add_front(
    builder: SceneBuilder, front: Front, y: float, wall: str, frame: str, rng: np.random.Generator
) -> None:
    """Add a front at `y` in materials of wall and frames, with some windows curtained or open."""
    at = (0.0, y, 0.0)
    builder.mesh("front", wall, _wall(front), at)
    builder.mesh("rooms", "plasterboard", _rooms(front), at)
    windows = front.windows()
    positions: list[Pose] = [((0, 0, 0), (x, y, z)) for x, z in windows]
    width, height = front.window_m
    builder.mesh("window frame", frame, _frame(width, height), copies=positions)
    builder.mesh("sill", "concrete", block((width + 0.16, 0.42, 0.05), (0, 0.02, -height / 2)),
               copies=positions)  # fmt: skip
    panes: list[Pose] = [((90, 0, 0), (x, y + 0.14, z)) for x, z in windows]
    builder.rectangle("pane", "glass-pane", front.window_m, copies=panes)
    curtained = [position for position in positions if rng.random() < 0.5]
    if curtained:
        curtain = _curtain(width * rng.uniform(0.3, 0.6), height, -width / 2)
        builder.mesh("curtain", "cotton-white", curtain, copies=curtained)
    for bay in front.door_bays:
        builder.mesh(f"door {bay + 1}", "wood-dry", _door(), (front.middle(bay), y, 0))


def _wall(front: Front) -> Mesh:
    """Bands below and above the windows, piers between; doors take the place of both below."""
    length = front.bays * front.bay_m
    centre = front.start_m + length / 2
    width, height = front.window_m
    parts = []
    for storey in range(front.storeys):
        low = storey * STOREY_M
        head = low + front.sill_m + height
        parts.append(_upright(centre, length, head, low + STOREY_M))
        piers = np.linspace(front.start_m, front.start_m + length, front.bays + 1)
        parts += [_upright(float(x), front.bay_m - width, low, head) for x in piers]
        for bay in range(front.bays):
            if storey == 0 and bay in front.door_bays:
                parts += _around_door(front.middle(bay), width, head)
            else:
                parts.append(_upright(front.middle(bay), width, low, low + front.sill_m))
    top = front.storeys * STOREY_M
    parts.append(block((length + 0.2, WALL_M + 0.3, 0.2), (centre, WALL_M / 2 - 0.1, top)))
    return union(parts)


def _around_door(x: float, width: float, head: float) -> list[Mesh]:
    """Close the opening of a floor-length window around a door."""
    side = (width - DOOR_M[0]) / 2
    parts = [_upright(x, DOOR_M[0], DOOR_M[1], head)] if head > DOOR_M[1] else []
    if side > 0:
        parts += [_upright(x + s * (width - side) / 2, side, 0, head) for s in (-1, 1)]
    return parts


def _upright(x: float, width: float, low: float, high: float) -> Mesh:
    """Return a piece of wall around x."""
    return block((width, WALL_M, high - low), (x, WALL_M / 2, (low + high) / 2))


def _rooms(front: Front) -> Mesh:
    """Add floors, a back wall, and walls between the rooms in every second bay."""
    length = front.bays * front.bay_m
    centre = front.start_m + length / 2
    height = front.storeys * STOREY_M
    middle = WALL_M + ROOM_M / 2
    parts = [block((length, 0.1, height), (centre, WALL_M + ROOM_M + 0.05, height / 2))]
    for storey in range(front.storeys + 1):
        parts.append(block((length, ROOM_M, 0.2), (centre, middle, storey * STOREY_M - 0.1)))
    for x in np.linspace(front.start_m, front.start_m + length, front.bays // 2 + 1):
        parts.append(block((0.1, ROOM_M, height), (float(x), middle, height / 2)))
    return union(parts)


def _frame(width: float, height: float) -> Mesh:
    """Window frame with a mullion and a transom, centred, 0.14 m behind the front."""
    bar = 0.06
    uprights = [
        block((bar, 0.07, height), (x, 0.14, 0)) for x in (-(width - bar) / 2, 0, (width - bar) / 2)
    ]
    levels = [
        block((width, 0.06, bar), (0, 0.14, z))
        for z in (-(height - bar) / 2, height / 5, (height - bar) / 2)
    ]
    return union(uprights + levels)


def _curtain(width: float, height: float, start: float) -> Mesh:
    """Wavy sheet behind a window, from `start` to the right."""
    x = np.linspace(start, start + width, 25)
    y = 0.4 + 0.04 * np.sin(2 * np.pi * (x - start) / 0.18)
    lines = [np.column_stack([x, y, np.full(25, z)]) for z in (-height / 2, height / 2)]
    return grid_mesh(np.stack(lines, axis=1))


def _door() -> Mesh:
    """Panelled door with a handle and a step, its middle at x = 0."""
    width, height = DOOR_M
    leaf = block((width, 0.06, height), (0, 0.15, height / 2))
    panels = [block((0.34, 0.03, 0.75), (x, 0.12, z)) for x in (-0.22, 0.22) for z in (0.55, 1.55)]
    handle = rod((0.38, 0.08, 1.05), (0.26, 0.08, 1.05), 0.012, sections=8)
    step = block((width + 0.2, 0.4, 0.1), (0, -0.05, 0.05))
    return union([leaf, *panels, handle, step])
