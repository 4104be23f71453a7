"""A person with a raised arm: a marshaller, someone lost, or someone who waves the drone off."""

import numpy as np
from trimesh.geometry import align_vectors

from reconstruction.base.arrays import Floats
from spisim.scene.families import Family, Parameters, SceneBuilder, drawn, drawn_log, one_of
from spisim_worlds.parts import figure, props
from spisim_worlds.parts.backdrops import BACKDROPS, add_backdrop, outdoors
from spisim_worlds.parts.figure import Arm, Leg, Side
from spisim_worlds.parts.ropes import hanging
from spisim_worlds.parts.shapes import Mesh, lathe, rod, tube, union

#: Height of the figure before scaling.
FIGURE_M = 1.77
#: Legs of every stance, right and left.
STANCES = {
    "standing": (Leg(), Leg()),
    "astride": (Leg(apart_deg=14), Leg(apart_deg=14)),
    "walking": (Leg(24, 6), Leg(-14, 22)),
    "kneeling": (Leg(84, 84), Leg(-8, 84)),
}


class PersonParameters(Parameters):
    """A person `distance_m` ahead, the right arm raised; angles of arms are from hanging down."""

    distance_m: float = drawn_log(2.8, 6.5, "to the person")
    person_m: float = drawn(1.5, 1.95, "how tall the person is")
    height_m: float = drawn(1.2, 2.6, "of the drone above the ground")
    facing_deg: float = drawn(-60.0, 60.0, "away from facing us")
    right_arm_deg: float = drawn(80.0, 175.0, "raised, 180 is straight up")
    left_arm_deg: float = drawn(10.0, 150.0, "raised")
    elbow_deg: float = drawn(0.0, 60.0, "bend of the right elbow, upwards")
    forward_deg: float = drawn(0.0, 70.0, "right arm forward of sideways")
    stance: str = one_of(*STANCES, text="what the legs do")
    jacket: str = one_of(
        "polyester-fabric", "cotton-white", "leather", "rubber-black", text="cloth"
    )
    trousers: str = one_of("polyester-fabric", "leather", "paint-black", text="cloth")
    headwear: str = one_of("hair", "hard-hat", text="on the head")
    vest: str = one_of("none", "safety-vest", text="over the jacket")
    holds: str = one_of("nothing", "paddle", "stick", text="in the raised hand")
    rope_mm: float = drawn_log(6.0, 25.0, "diameter of the rope in front")
    backdrop: str = one_of(*BACKDROPS, text="what is behind")
    backdrop_m: float = drawn(1.2, 4.0, "from the person to the backdrop")


def build(parameters: PersonParameters, rng: np.random.Generator) -> SceneBuilder:
    """The person, a rope between posts in front, cones beside, a backdrop behind."""
    at = (parameters.distance_m, float(rng.uniform(-0.06, 0.06)) * parameters.distance_m)
    aim_z = parameters.person_m * (0.55 if parameters.stance == "kneeling" else 0.78)
    eye = (0.0, 0.0, parameters.height_m)
    builder = SceneBuilder(position_m=eye, look_at_m=(at[0], 0.0, aim_z), **outdoors(rng))
    _add_person(builder, parameters, at)
    slope = (aim_z - eye[2]) / at[0]
    _add_rope(builder, parameters, slope, rng)
    far = at[0] + parameters.backdrop_m
    cones = [
        ((0, 0, rng.uniform(0, 90)), (at[0] + along, side * rng.uniform(0.55, 1.1), 0))
        for side, along in ((-1, rng.uniform(-0.3, 0.8)), (1, rng.uniform(-0.3, 0.8)))
    ]
    builder.mesh("cone", "pvc", props.cone(), copies=cones)
    add_backdrop(builder, parameters.backdrop, far, eye[2] + slope * far, rng)
    return builder


def _add_person(
    builder: SceneBuilder, parameters: PersonParameters, at: tuple[float, float]
) -> None:
    right_leg, left_leg = STANCES[parameters.stance]
    right_arm = Arm(parameters.right_arm_deg, parameters.forward_deg, parameters.elbow_deg)
    sides = (
        figure.posed(-1, right_arm, right_leg),
        figure.posed(1, Arm(parameters.left_arm_deg), left_leg),
    )
    parts = {
        ("jacket", parameters.jacket): figure.jacket(sides),
        ("trousers", parameters.trousers): figure.trousers(sides),
        ("skin", "skin"): union([figure.skin(sides), figure.nose()]),
    }
    if parameters.headwear == "hair":
        parts["hair", "leather"] = figure.hair()
    else:
        parts["hard hat", "polypropylene"] = figure.hard_hat()
    if parameters.vest == "safety-vest":
        parts["safety vest", "polyester-fabric"] = figure.vest()
        parts["bands of the vest", "retroreflective-tape"] = figure.vest_bands()
    if parameters.holds != "nothing":
        parts[parameters.holds, "paint-white"] = _HELD[parameters.holds](sides[0])
    lowest = parts["trousers", parameters.trousers].bounds[0, 2]
    scale = parameters.person_m / FIGURE_M
    for (name, material), mesh in parts.items():
        mesh.apply_translation((0, 0, -lowest))
        builder.mesh(name, material, mesh, (*at, 0), (0, 0, parameters.facing_deg), scale=scale)


def _add_rope(
    builder: SceneBuilder, parameters: PersonParameters, slope: float, rng: np.random.Generator
) -> None:
    """A sagging rope between two posts, low in the field of view."""
    x = float(rng.uniform(0.45, 0.7)) * parameters.distance_m
    top = max(0.4, parameters.height_m + (slope - 0.08) * x)
    y = float(rng.uniform(0.1, 0.16)) * x
    left, right = (x, y, top), (x + 0.2, y - 1.9, top)
    posts = [
        union(
            [
                rod((px, py, 0), (px, py, pz + 0.05), 0.025, 12),
                rod((px, py, 0), (px, py, 0.03), 0.15, 20),
            ]
        )
        for px, py, pz in (left, right)
    ]
    builder.mesh("posts", "steel-galvanised", union(posts))
    path = hanging(left, right, sag=0.04 * x)
    builder.mesh("rope", "polyester-fabric", tube(path, parameters.rope_mm / 2000))


def _paddle(side: Side) -> Mesh:
    """Marshalling paddle, a disc of 0.3 m."""
    grip, axis = _grip(side)
    handle = rod(grip, grip + 0.18 * axis, 0.014, 8)
    centre = grip + 0.3 * axis
    # Perpendicular to the arm and towards the viewer; the arm is never level and straight ahead.
    facing = np.array([-1.0, 0.0, 0.0]) + axis[0] * axis
    facing /= np.linalg.norm(facing)
    return union([handle, rod(centre - 0.004 * facing, centre + 0.004 * facing, 0.15, 24)])


def _stick(side: Side) -> Mesh:
    """Light stick of 0.5 m."""
    grip, axis = _grip(side)
    profile = [
        (0, 0),
        (0.015, 0),
        (0.015, 0.15),
        (0.022, 0.17),
        (0.022, 0.48),
        (0.012, 0.5),
        (0, 0.5),
    ]
    stick = lathe(profile, 12)
    stick.apply_transform(align_vectors((0, 0, 1), axis))
    return stick.apply_translation(grip)


def _grip(side: Side) -> tuple[Floats, Floats]:
    """Middle of the hand, and the direction in which it points."""
    axis = np.subtract(side.fingers, side.palm)
    return np.add(side.palm, 0.04 / np.linalg.norm(axis) * axis), axis / np.linalg.norm(axis)


_HELD = {"paddle": _paddle, "stick": _stick}

FAMILY = Family(
    "A person with a raised arm behind a rope, before a wall, a hedge or containers",
    PersonParameters,
    build,
)
