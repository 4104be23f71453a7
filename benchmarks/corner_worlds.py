"""Scenes at which an answer is easily confident and wrong: dark, near, thin, off the spots.

A drone 1.5 m above nothing looks along x. The families that draw whole worlds have none of these,
and nothing is fitted to them.
"""

from collections.abc import Iterator, Sequence
from dataclasses import dataclass, replace

import numpy as np
import trimesh

from reconstruction.base.arrays import Floats
from spisim.atmosphere import CLEAR, fog
from spisim.scene import Ambient, Material, Scene, SceneObject, find_material

POSE = np.array([[0, 0, 1, 0], [-1, 0, 0, 0], [0, -1, 0, 1.5], [0, 0, 0, 1]], dtype=np.float64)
"""Optical frame (x right, y down, z forward) in a world whose z is up."""
DARK = ("snow-old", "ice", "water", "abs-black", "rubber-black")
"""Shipped materials that return least."""
LENS, BETWEEN_SPOTS = "against the lens", ("person", "pole")
HARD = ("half wall", "netting", "pane", "mirror")
"""Kinds of corners other than walls."""
PLACES = (("person", 2.2, 5.0, 0.03), ("pole", 1.5, 3.0, 0.08))
"""Kind, least and most distance, and how far it stands to either side of the axis, at most."""
WALL_M = 20.0
SKY_KLX = 5.0
KIND = "moderate-radiation"


@dataclass(frozen=True, eq=False)
class Corner:
    """A scene, what stands in it, and the distance of the nearest obstacle on the optical axis."""

    scene: Scene
    kind: str
    surface: str
    obstacle_m: float
    visibility_m: float | None

    @property
    def air(self) -> str:
        """Clear, or the visibility."""
        return "clear" if self.visibility_m is None else f"{self.visibility_m:g} m"


def wall(surface: str | float, distance_m: float, visibility_m: float | None) -> Corner:
    """A wall square to the optical axis, of a shipped material or a diffuse reflectance."""
    return _corner("wall", surface, distance_m, visibility_m, [_board("wall", surface, distance_m)])


def open_sky(visibility_m: float | None) -> Corner:
    """Nothing but a sky."""
    return _corner("open sky", "none", np.nan, visibility_m, [])


def before_a_wall(
    kind: str,
    surface: str | float,
    distance_m: float,
    aside_m: float,
    behind_m: float,
    visibility_m: float | None,
) -> Corner:
    """One of `BETWEEN_SPOTS` before a wall; between spots at 5 degrees from 1.8 m on."""
    placed = THINGS[kind]().apply_translation([distance_m, aside_m, 1.5])
    objects = [
        SceneObject(kind, placed, _material(surface)),
        _board("wall", 0.35, distance_m + behind_m),
    ]
    return _corner(kind, surface, distance_m, visibility_m, objects)


def _pole() -> trimesh.Trimesh:
    """Upright, 5 cm thick."""
    return trimesh.creation.cylinder(0.025, 3.0)


def _person() -> trimesh.Trimesh:
    """A body 0.3 m wide, with a head."""
    body = trimesh.creation.capsule(height=1.1, radius=0.15)
    body.apply_translation([0, 0, -0.75])
    head = trimesh.creation.icosphere(radius=0.11)
    head.apply_translation([0, 0, 0.12])
    return trimesh.util.concatenate([body, head])


THINGS = {"person": _person, "pole": _pole}


def _corner(
    kind: str,
    surface: str | float,
    obstacle_m: float,
    visibility_m: float | None,
    objects: Sequence[SceneObject],
) -> Corner:
    scene = Scene(
        name=kind,
        objects=tuple(objects),
        atmosphere=CLEAR if visibility_m is None else fog(visibility_m, KIND),
        ambient=Ambient(sky_klx=SKY_KLX),
        drone_pose=POSE,
    )
    return Corner(scene, kind, str(surface), obstacle_m, visibility_m)


def _board(
    name: str,
    surface: str | float,
    distance_m: float,
    *,
    from_m: float = -WALL_M / 2,
    turned_rad: float = 0.0,
    opacity: float | None = None,
) -> SceneObject:
    """A board from a place across the view to the right, turned about the upright."""
    half = WALL_M / 2
    corners: Floats = np.array(
        [[x, y, 0.0] for x, y in ((from_m, -half), (half, -half), (half, half), (from_m, half))]
    )
    turn = trimesh.transformations.rotation_matrix(turned_rad, [0, 1, 0])
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]]).apply_transform(turn)
    mesh.apply_translation([0, 0, distance_m]).apply_transform(POSE)
    return SceneObject(name, mesh, replace(_material(surface), opacity=opacity))


def _material(surface: str | float) -> Material:
    if isinstance(surface, str):
        return find_material(surface)
    return Material(f"diffuse {surface:.3g}", float(surface), "drawn")


def dark_walls() -> Iterator[Corner]:
    """Walls of the darkest shipped materials in clear air."""
    for surface in DARK:
        for distance_m in (2.0, 3.0, 4.0):
            yield wall(surface, distance_m, None)


def walls(count: int, seed: int) -> Iterator[Corner]:
    """Walls of R .01 to .9 at .3 to 6 m, in clear air and fog of 100, 50 and 20 m."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        reflectance, distance_m = (
            np.exp(rng.uniform(*np.log(ends))) for ends in ((0.01, 0.9), (0.3, 6.0))
        )
        yield wall(float(reflectance), float(distance_m), (None, 100.0, 50.0, 20.0)[number % 4])


def near_walls(count: int, seed: int) -> Iterator[Corner]:
    """Walls against the lens, at .05 to .3 m."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        reflectance = float(np.exp(rng.uniform(np.log(0.03), np.log(0.9))))
        corner = wall(reflectance, float(rng.uniform(0.05, 0.3)), (None, 50.0)[number % 2])
        yield replace(corner, kind=LENS)


def between_spots(count: int, seed: int) -> Iterator[Corner]:
    """People and poles that no spot of four at five degrees meets."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        reflectance = float(np.exp(rng.uniform(np.log(0.05), np.log(0.8))))
        behind_m = float(rng.uniform(1.0, 4.0))
        kind, nearest_m, farthest_m, aside_m = PLACES[number % 2]
        yield before_a_wall(
            kind,
            reflectance,
            float(rng.uniform(nearest_m, farthest_m)),
            float(rng.uniform(-aside_m, aside_m)),
            behind_m,
            None,
        )


def hard_views(count: int, seed: int) -> Iterator[Corner]:
    """Views half filled by a wall, nets, panes of glass and metal that looks away."""
    rng = np.random.default_rng(seed)
    for number in range(count):
        kind = HARD[number % len(HARD)]
        distance_m, behind_m = float(rng.uniform(1.0, 4.0)), float(rng.uniform(1.0, 5.0))
        reflectance = float(np.exp(rng.uniform(np.log(0.05), np.log(0.8))))
        behind = _board("behind", 0.35, distance_m + behind_m)
        if kind == "half wall":
            surface: str | float = reflectance
            board = _board(kind, surface, distance_m, from_m=float(rng.uniform(-0.25, 0.2)))
        elif kind == "netting":
            surface = reflectance
            board = _board(kind, surface, distance_m, opacity=float(rng.uniform(0.15, 0.5)))
        elif kind == "pane":
            surface = "glass-pane"
            board = _board(kind, surface, distance_m)
        else:
            surface = str(rng.choice(["aluminium-brushed", "steel", "paint-gloss-black"]))
            turned_rad = float(np.radians(rng.uniform(10, 35)))
            board = _board(kind, surface, distance_m, turned_rad=turned_rad)
        yield _corner(kind, surface, distance_m, (None, 50.0)[number // 4 % 2], [board, behind])
