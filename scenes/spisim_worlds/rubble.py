"""A collapsed building: tilted slabs, bent reinforcement, dangling cables, and a victim."""

from dataclasses import dataclass

import numpy as np
from trimesh.creation import box
from trimesh.transformations import euler_matrix

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts import figure
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.figure import Arm, Leg
from spisim_worlds.parts.natural import scattered_rocks
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import Mesh, alike, block, grid_mesh, limb, tube, union

BRICK_M = (0.215, 0.102, 0.065)


class RubbleParameters(Parameters):
    """A heap whose foot is `distance_m` ahead, before a broken wall."""

    distance_m: float = drawn_log(2.0, 4.5, "to the foot of the heap")
    height_m: float = drawn(1.2, 3.0, "of the drone above the ground")
    heap_m: float = drawn(0.7, 1.8, "height of the heap")
    slabs: int = drawn(3, 8, "broken floor slabs on it")
    slab_m: float = drawn(0.6, 1.4, "their mean length")
    tilt_deg: float = drawn(15.0, 55.0, "their mean tilt")
    rebar_mm: float = drawn_log(8.0, 20.0, "diameter of the reinforcement that sticks out")
    bricks: int = drawn(40, 200, "loose bricks")
    stones: int = drawn(80, 300, "lumps of concrete")
    cables: int = drawn(1, 5, "cables that hang down from the wall")
    cable_mm: float = drawn_log(4.0, 15.0, "their diameter")
    victim: str = one_of("none", "arm", "upper-body", text="what is to be seen of someone")
    sleeve: str = one_of("cotton-white", "polyester-fabric", "leather", text="cloth of the victim")
    wall: str = one_of("brick", "concrete", "plasterboard", text="material of the wall behind")


@dataclass(frozen=True)
class Heap:
    """A mound with bumps: half an ellipsoid about (`x`, 0), `high` above the ground."""

    x: float
    high: float
    numbers: Floats
    phases: Floats

    #: Half its depth and width.
    EXTENT_M = (2.2, 4.0)

    def height(self, x: Floats | float, y: Floats | float) -> Floats:
        """Height at places."""
        u = (np.asarray(x) - self.x) / self.EXTENT_M[0]
        v = np.asarray(y) / self.EXTENT_M[1]
        bumps = np.cos(
            np.multiply.outer(x, self.numbers[:, 0])
            + np.multiply.outer(y, self.numbers[:, 1])
            + self.phases
        ).mean(axis=-1)
        mound = np.sqrt(np.clip(1 - u**2 - v**2, 0, None))
        return np.asarray(self.high * mound * (1 + 0.25 * bumps))

    def mesh(self) -> Mesh:
        """Its surface as a sheet, a little below the ground at the edge."""
        reach_x, reach_y = self.EXTENT_M
        x, y = np.meshgrid(
            self.x + np.linspace(-reach_x, reach_x, 45),
            np.linspace(-reach_y, reach_y, 61),
            indexing="ij",
        )
        return grid_mesh(np.stack([x, y, self.height(x, y) - 0.03], axis=-1))


def build(parameters: RubbleParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the heap, the objects on it, and the wall that it fell from."""
    middle = parameters.distance_m + Heap.EXTENT_M[0]
    heap = Heap(
        middle, parameters.heap_m, rng.normal(scale=4.0, size=(7, 2)), rng.uniform(0, 2 * np.pi, 7)
    )
    aim = (parameters.distance_m + 1.2, 0.0, 0.75 * parameters.heap_m + 0.15)
    builder = SceneBuilder(position_m=(0, 0, parameters.height_m), look_at_m=aim, **outdoors(rng))
    builder.rectangle("ground", "soil-dry", (60, 60))
    builder.mesh("heap", "concrete-weathered", heap.mesh())
    _add_slabs(builder, parameters, heap, rng)
    _add_loose(builder, parameters, heap, rng)
    _add_wall(builder, parameters, middle + 1.6, rng)
    _add_cables(builder, parameters, heap, rng)
    if parameters.victim != "none":
        _add_victim(builder, parameters, heap, rng)
    return builder


def _add_slabs(
    builder: SceneBuilder, parameters: RubbleParameters, heap: Heap, rng: np.random.Generator
) -> None:
    """Slabs strewn over the near side of the heap, bars out of their upper edges."""
    slabs, bars = [], []
    for y in np.linspace(-1.3, 1.3, parameters.slabs) + rng.uniform(-0.2, 0.2, parameters.slabs):
        x = heap.x - rng.uniform(0.2, 1.6)
        long = parameters.slab_m * rng.uniform(0.7, 1.3)
        wide, thick = rng.uniform(0.4, 0.9), rng.uniform(0.1, 0.18)
        tilt = np.radians(parameters.tilt_deg * rng.uniform(0.5, 1.4))
        pose = euler_matrix(rng.normal(0, 0.25), -tilt, rng.normal(0, 0.6))
        pose[:3, 3] = x, y, float(heap.height(x, y)) + 0.1
        slabs.append(block((long, wide, thick), (0, 0, 0)).apply_transform(pose))
        for side in np.arange(-0.5 * wide + 0.06, 0.5 * wide - 0.05, 0.15):
            bar = _bar((long / 2 - 0.1, side, rng.uniform(-0.2, 0.2) * thick), parameters, rng)
            bars.append(bar.apply_transform(pose))
    builder.mesh("slabs", "concrete", union(slabs))
    builder.mesh("reinforcement", "steel-rusty", union(bars))


def _bar(
    start: tuple[float, float, float], parameters: RubbleParameters, rng: np.random.Generator
) -> Mesh:
    """Bar out of a slab along x, bent ever more to one side."""
    along = np.linspace(0, rng.uniform(0.25, 0.7), 7)
    bend, way = rng.uniform(0.1, 1.2), rng.uniform(0, 2 * np.pi)
    aside = bend * np.clip(along - 0.1, 0, None) ** 2
    path = np.stack([along, aside * np.cos(way), aside * np.sin(way)], axis=1) + start
    return tube(path, parameters.rebar_mm / 2000, sections=6)


def _add_loose(
    builder: SceneBuilder, parameters: RubbleParameters, heap: Heap, rng: np.random.Generator
) -> None:
    """Bricks and lumps on the heap and at its foot."""
    brick = box((1, 1, 1))
    positions = _strewn(parameters.bricks, heap, rng)
    angles = rng.uniform((-0.6, -0.6, 0), (0.6, 0.6, 2 * np.pi), positions.shape)
    turns = np.array([euler_matrix(*row)[:3, :3] for row in angles])
    sizes = np.full(positions.shape, BRICK_M)
    sizes[rng.random(len(positions)) < 0.3, 0] /= 2
    corners = brick.vertices * sizes[:, None]
    corners = np.einsum("nij,nvj->nvi", turns, corners) + positions[:, None] + (0, 0, 0.03)
    builder.mesh("bricks", "brick", alike(corners, brick.faces))
    thick = rng.lognormal(np.log(0.1), 0.45, parameters.stones)
    lumps = scattered_rocks(rng, _strewn(parameters.stones, heap, rng), thick)
    builder.mesh("lumps of concrete", "concrete-weathered", lumps)


def _strewn(count: int, heap: Heap, rng: np.random.Generator) -> Floats:
    """Return positions (n, 3) on the near side of the heap and before it."""
    x = heap.x + rng.uniform(-1.15, 0.2, count) * heap.EXTENT_M[0]
    y = rng.normal(0, 0.9, count)
    return np.stack([x, y, heap.height(x, y)], axis=1)


def _add_wall(
    builder: SceneBuilder, parameters: RubbleParameters, x: float, rng: np.random.Generator
) -> None:
    """Add the remains of a wall with a stepped top, and a hanging slab of the next floor."""
    wide = 0.3
    columns = np.arange(-4.8, 4.9, wide)
    heights = 2.6 + np.cumsum(rng.normal(0, 0.12, len(columns)))
    floor = parameters.height_m + 0.3
    heights = np.clip(heights, floor + 0.4, floor + 3.0)
    parts = [
        block((0.24, wide, high), (x, y, high / 2))
        for y, high in zip(columns, heights, strict=True)
    ]
    builder.mesh("broken wall", parameters.wall, union(parts))
    # A far wall, visible over the top of the broken one.
    builder.box("next house", "concrete", (0.3, 24, 12), (x + 4, 0, 6))
    pose = (0, rng.uniform(15, 45), rng.uniform(-15, 15))
    side = float(rng.choice((-1, 1))) * rng.uniform(0.8, 1.4)
    builder.box("hanging slab", "concrete", (1.1, 1.3, 0.16), (x - 0.5, side, floor), pose)


def _add_cables(
    builder: SceneBuilder, parameters: RubbleParameters, heap: Heap, rng: np.random.Generator
) -> None:
    """Cables from the wall to the heap before it, crossing the view."""
    cables = []
    for _ in range(parameters.cables):
        x, y = heap.x - rng.uniform(0.6, 1.9), rng.uniform(-0.6, 0.6)
        foot = (x, y, float(heap.height(x, y)))
        top = (heap.x + 1.5, y + rng.uniform(-1.5, 1.5), parameters.height_m + rng.uniform(0, 0.6))
        path = hanging(top, foot, sag=rng.uniform(0.05, 0.5), points=20)
        cables.append(tube(path, parameters.cable_mm / 2000, sections=6))
    builder.mesh("cables", "rubber-black", union(cables))


def _add_victim(
    builder: SceneBuilder, parameters: RubbleParameters, heap: Heap, rng: np.random.Generator
) -> None:
    """Add an arm held up out of the rubble, or a body above the belt, leaning back."""
    x, y = heap.x - rng.uniform(0.9, 1.4), rng.uniform(-0.3, 0.3)
    at = (x, y, float(heap.height(x, y)))
    if parameters.victim == "arm":
        lean = rng.uniform(-0.25, 0.25, 2)
        elbow, wrist = (0.4 * lean[0], 0.4 * lean[1], 0.2), (*(0.8 * lean), 0.45)
        tip = (*lean, 0.56)
        builder.mesh("sleeve", parameters.sleeve, _bent_limb((0, 0, -0.1), elbow, wrist), at)
        builder.mesh("hand", "skin", limb(wrist, tip, 0.036), at)
        return
    raised = Arm(rng.uniform(110, 165), rng.uniform(20, 70), rng.uniform(0, 30))
    hanging_arm = Arm(rng.uniform(15, 60), 40)
    sides = (figure.posed(-1, raised, Leg()), figure.posed(1, hanging_arm, Leg()))
    parts = {
        ("jacket", parameters.sleeve): figure.jacket(sides),
        ("head and hands", "skin"): union([figure.skin(sides), figure.nose()]),
        ("hair", "leather"): figure.hair(),
    }
    turn = (0, rng.uniform(10, 35), rng.uniform(-40, 40))
    for (name, material), mesh in parts.items():
        # The belt is at the surface of the heap.
        mesh.apply_translation((0, 0, -1.08))
        builder.mesh(name, material, mesh, at, turn)


def _bent_limb(start: tuple[float, ...], joint: tuple[float, ...], end: tuple[float, ...]) -> Mesh:
    return union([limb(start, joint, 0.055), limb(joint, end, 0.046)])


FAMILY = Family(
    "A collapsed building: slabs, bent bars, cables, loose bricks, and someone buried",
    RubbleParameters,
    build,
)
