"""A construction scaffold before a wall: tubes, couplers, planks, nets, and a bucket on a rope."""

import itertools
from dataclasses import dataclass

import numpy as np

from spisim.scene.families import Family, Parameters, Pose, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts import props
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.ropes import net
from spisim_worlds.parts.shapes import Mesh, alike, block, grid_mesh, rod, tube, union

#: Tube diameter, EN 39.
TUBE_DIAMETER_M = 0.0483
PLANK_M = (0.22, 0.038)
TOE_BOARD_M = (0.025, 0.15)
GUARD_RAILS_M = (0.5, 1.0)
#: Height of the lowest deck above the ground.
FOOT_M = 0.25
SECTIONS = 10
#: Bays on either side of the middle.
BAYS = 2


class ScaffoldParameters(Parameters):
    """A scaffold of two rows of standards, the nearer one `distance_m` ahead."""

    distance_m: float = drawn_log(2.2, 5.0, "to the nearer row of standards")
    height_m: float = drawn(1.4, 6.0, "of the drone above the ground")
    oblique_deg: float = drawn(-35.0, 35.0, "of the wall, from square to the line of sight")
    tilt_deg: float = drawn(-15.0, 15.0, "of the line of sight above the horizon")
    bay_m: float = drawn(1.4, 2.5, "from standard to standard")
    lift_m: float = drawn(1.8, 2.1, "from deck to deck")
    depth_m: float = drawn(0.7, 1.1, "from row to row")
    gap_m: float = drawn(0.15, 0.4, "from the scaffold to the wall")
    planked: float = drawn(0.5, 1.0, "fraction of planks that are present")
    braces: float = drawn(0.3, 1.0, "fraction of bays with a diagonal brace")
    cover: str = one_of("none", "net", "tarpaulin", text="hung before one of the bays")
    cord_mm: float = drawn_log(3.0, 6.0, "diameter of the cords of the net")
    rope_mm: float = drawn_log(8.0, 20.0, "diameter of the rope with the bucket")
    wall: str = one_of("brick", "concrete", "plasterboard", text="material of the wall")


@dataclass(frozen=True)
class Frame:
    """Geometry of the tubes: the wall is along y, the near row at x = 0, decks at `levels`.

    The rope hangs from `top`.
    """

    columns: list[float]
    levels: list[float]
    depth: float
    top: float

    @property
    def rows(self) -> tuple[float, float]:
        """Both rows of standards."""
        return (0.0, self.depth)


def build(parameters: ScaffoldParameters, rng: np.random.Generator) -> SceneBuilder:
    """Build the scaffold about a point straight ahead, rotated."""
    x, eye_z = parameters.distance_m, parameters.height_m
    aim_z = max(0.3, eye_z + x * float(np.tan(np.radians(parameters.tilt_deg))))
    builder = SceneBuilder(position_m=(0, 0, eye_z), look_at_m=(x, 0, aim_z), **outdoors(rng))
    builder.rectangle("ground", "sand-dry", (60, 60))
    top = max(aim_z, eye_z) + 0.3 * x + 1.0
    offset = rng.uniform(-0.5, 0.5) * parameters.bay_m
    frame = Frame(
        [offset + i * parameters.bay_m for i in range(-BAYS, BAYS + 1)],
        np.arange(FOOT_M, top, parameters.lift_m).tolist(),
        parameters.depth_m,
        top,
    )
    parts = {
        ("tubes", "steel-galvanised"): _tubes(frame, parameters, rng),
        ("couplers", "steel-rusty"): _couplers(frame),
        ("planks", "wood-weathered"): _planks(frame, parameters, rng),
        ("toe boards", "wood-dry"): _toe_boards(frame, rng),
        ("window", "glass-painted-back"): _windows(frame, parameters, aim_z),
        ("rope", "polyester-fabric"): _rope(frame, parameters, aim_z, offset),
        ("bucket", "pvc"): _bucket(aim_z, offset, parameters),
        ("stack of bricks", "brick"): _bricks(frame, aim_z, rng),
    }
    if parameters.cover == "net":
        parts["safety net", "polyester-fabric"] = _net(frame, parameters, aim_z)
    elif parameters.cover == "tarpaulin":
        parts["tarpaulin", "polyethylene-film"] = _tarpaulin(frame, aim_z, rng)
    position: Pose = ((0, 0, parameters.oblique_deg), (x, 0, 0))
    for (name, material), mesh in parts.items():
        builder.mesh(name, material, mesh, copies=[position])
    wall_x = frame.depth + parameters.gap_m
    wall = block((0.3, 24, top + 3), (wall_x + 0.15, 0, (top + 3) / 2))
    builder.mesh("wall", parameters.wall, wall, copies=[position])
    ladder_at = (0.75 * frame.depth, offset + 0.7 * parameters.bay_m, _deck_below(frame, aim_z))
    ladder = props.ladder()
    ladder.apply_translation(ladder_at)
    builder.mesh("ladder", "aluminium-anodised", ladder, copies=[position])
    return builder


def _tubes(frame: Frame, parameters: ScaffoldParameters, rng: np.random.Generator) -> Mesh:
    """Standards, ledgers, transoms, guard rails and braces."""
    radius = TUBE_DIAMETER_M / 2
    first, last = frame.columns[0] - 0.3, frame.columns[-1] + 0.3
    # The top of the braces; the rope's bracket is below it.
    high = frame.levels[-1] + parameters.lift_m + 0.1
    standards = [
        rod((x, y, 0), (x, y, high), radius, SECTIONS) for x in frame.rows for y in frame.columns
    ]
    ledgers = [
        rod((x + beside, first, z), (x + beside, last, z), radius, SECTIONS)
        for z in frame.levels
        for x, beside in ((0.0, -0.05), (frame.depth, 0.05))
    ]
    rails = [
        rod((0.05, first, z + up), (0.05, last, z + up), radius, SECTIONS)
        for z in frame.levels
        for up in GUARD_RAILS_M
    ]
    rails.append(
        rod((0.05, first, frame.top - 0.05), (0.05, last, frame.top - 0.05), radius, SECTIONS)
    )
    transoms = [
        rod((-0.15, y + 0.05, z + 0.05), (frame.depth + 0.12, y + 0.05, z + 0.05), radius, SECTIONS)
        for z in frame.levels
        for y in frame.columns
    ]
    braces = [
        rod((-0.1, y, z), (-0.1, y_next, z + parameters.lift_m), radius, SECTIONS)
        for z in frame.levels
        for y, y_next in zip(frame.columns, frame.columns[1:], strict=False)
        if rng.random() < parameters.braces
    ]
    feet = [block((0.15, 0.15, 0.01), (x, y, 0.005)) for x in frame.rows for y in frame.columns]
    return union(standards + ledgers + rails + transoms + braces + feet)


def _couplers(frame: Frame) -> Mesh:
    """Clamps where tubes meet, each with a bolt of 14 mm."""
    joints = [
        (x, y, z + up)
        for x in frame.rows
        for y in frame.columns
        for z in frame.levels
        for up in (0.0, *(GUARD_RAILS_M if x == 0 else ()))
    ]
    bolt = rod((-0.03, -0.075, 0), (-0.03, 0.075, 0), 0.007, 6)
    coupler = union([block((0.075, 0.07, 0.075), (0, 0, 0)), bolt])
    return alike(coupler.vertices + np.array(joints)[:, None], coupler.faces)


def _planks(frame: Frame, parameters: ScaffoldParameters, rng: np.random.Generator) -> Mesh:
    """Planks along the wall on every deck, some missing, none quite straight."""
    wide, thick = PLANK_M
    planks = []
    for z in frame.levels:
        top = z + 0.05 + TUBE_DIAMETER_M / 2 + thick / 2
        for x in np.arange(wide / 2 + 0.03, frame.depth - wide / 2, wide + 0.015):
            for y, y_next in zip(frame.columns, frame.columns[1:], strict=False):
                start, over = rng.uniform(-0.15, 0.15), rng.uniform(-0.01, 0.01)
                if rng.random() < parameters.planked:
                    size = (wide, y_next - y - 0.01, thick)
                    planks.append(block(size, (x + over, (y + y_next) / 2 + start, top)))
    # This plank is never missing, because a person stands on it.
    spare = block((wide, 1.2, thick), (wide / 2 + 0.03, 0, frame.levels[0] + 0.15))
    return union([*planks, spare])


def _toe_boards(frame: Frame, rng: np.random.Generator) -> Mesh:
    thick, high = TOE_BOARD_M
    return union(
        [
            block(
                (thick, y_next - y + 0.1, high),
                (-0.04, (y + y_next) / 2, z + 0.17 + rng.uniform(-0.01, 0.01)),
            )
            for z in frame.levels
            for y, y_next in zip(frame.columns, frame.columns[1:], strict=False)
        ]
    )


def _windows(frame: Frame, parameters: ScaffoldParameters, aim_z: float) -> Mesh:
    """A pane in every bay, a little out of the wall."""
    x = frame.depth + parameters.gap_m
    low = max(0.8, aim_z - 0.5)
    panes = []
    for y, y_next in zip(frame.columns, frame.columns[1:], strict=False):
        middle = (y + y_next) / 2
        panes += [
            block((0.03, 0.42, 1.2), (x - 0.005, middle + side * 0.23, low + 0.6))
            for side in (-1, 1)
        ]
    return union(panes)


def _deck_below(frame: Frame, z: float) -> float:
    """Top of the planks of the deck below a height, or of the lowest."""
    below = [level for level in frame.levels if level < z - 0.2]
    return (below[-1] if below else frame.levels[0]) + 0.05 + TUBE_DIAMETER_M / 2 + PLANK_M[1]


def _hook(parameters: ScaffoldParameters, offset: float) -> tuple[float, float]:
    """Return the upper end of the rope, before the scaffold and inside the field of view."""
    return -0.35, float(np.clip(offset + 0.35 * parameters.bay_m, -0.35, 0.35))


def _rope(frame: Frame, parameters: ScaffoldParameters, aim_z: float, offset: float) -> Mesh:
    """Rope from a bracket on the topmost rail down to the handle of the bucket."""
    x, y = _hook(parameters, offset)
    knot = aim_z + 0.05
    bow = np.linspace(0, np.pi, 9)
    handle = np.stack([0 * bow + x, y + 0.14 * np.cos(bow), knot - 0.15 + 0.15 * np.sin(bow)], 1)
    bracket = rod((0.15, y, frame.top), (x - 0.1, y, frame.top), TUBE_DIAMETER_M / 2, SECTIONS)
    rope = rod((x, y, knot), (x, y, frame.top), parameters.rope_mm / 2000, 8)
    return union([rope, bracket, tube(handle, 0.003, 6)])


def _bucket(aim_z: float, offset: float, parameters: ScaffoldParameters) -> Mesh:
    x, y = _hook(parameters, offset)
    return props.bucket().apply_translation((x, y, aim_z - 0.37))


def _bricks(frame: Frame, aim_z: float, rng: np.random.Generator) -> Mesh:
    """Bricks on the deck in view, in three piles."""
    low = _deck_below(frame, aim_z)
    bricks, high = [], np.zeros(3, int)
    for j, i in itertools.product(range(4), range(3)):
        if j < 2 or rng.random() < 0.6:
            x, z = 0.25 + rng.uniform(-0.01, 0.01), low + 0.0325 + 0.066 * high[i]
            bricks.append(block((0.102, 0.215, 0.065), (x, -0.4 + 0.23 * i, z)))
            high[i] += 1
    return union(bricks)


def _bay_in_view(frame: Frame, aim_z: float) -> tuple[float, float, float, float]:
    """Sides and heights of the bay left of the middle, at the lift in view."""
    middle = int(np.searchsorted(frame.columns, 0.0))
    low = _deck_below(frame, aim_z) - 0.1
    return frame.columns[middle - 1], frame.columns[middle], low, low + 1.9


def _net(frame: Frame, parameters: ScaffoldParameters, aim_z: float) -> Mesh:
    """Knotted net of 100 mm meshes before the near row."""
    left, right, low, high = _bay_in_view(frame, aim_z)
    corners = [(-0.13, left, low), (-0.13, left, high), (-0.13, right, high), (-0.13, right, low)]
    return net(corners, 0.1, parameters.cord_mm / 1000, 0.04)


def _tarpaulin(frame: Frame, aim_z: float, rng: np.random.Generator) -> Mesh:
    """Sheet over half of a bay, in folds, its lower corner blown out."""
    left, right, low, high = _bay_in_view(frame, aim_z)
    right = left + rng.uniform(0.45, 0.7) * (right - left)
    across, up = np.meshgrid(np.linspace(0, 1, 40), np.linspace(0, 1, 24), indexing="ij")
    folds = np.sin(2 * np.pi * (rng.uniform(3, 6) * across + 0.6 * up) + rng.uniform(0, 6))
    out = 0.14 + 0.03 * folds + 0.3 * (across * (1 - up)) ** 2
    points = np.stack([-out, left + across * (right - left), low + up * (high - low)], axis=-1)
    return grid_mesh(points)


FAMILY = Family(
    "A scaffold of thin tubes before a wall, with planks, net or tarpaulin, bucket and rope",
    ScaffoldParameters,
    build,
)
