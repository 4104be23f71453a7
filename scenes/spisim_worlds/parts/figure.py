"""People in any posture, and grazing animals.

A person is about 1.77 m tall and faces -x; `Side` holds the joints of the right (-1) or left (1)
half. Animals stand on z = 0 along x, with the head towards +x; lengths in metres.
"""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
from trimesh.creation import icosphere

from reconstruction.base.arrays import Floats
from spisim_worlds.parts.shapes import Mesh, Point, lathe, limb, moved, tube, union

UPPER_ARM_M, FOREARM_M, HAND_M = 0.28, 0.24, 0.09
THIGH_M, SHIN_M = 0.38, 0.4
TORSO = [
    (0, 0.84), (0.15, 0.86), (0.165, 0.93), (0.14, 1.05), (0.15, 1.2),
    (0.175, 1.36), (0.165, 1.43), (0.11, 1.48), (0.06, 1.5), (0, 1.5),
]  # fmt: skip
#: Depth and width of the chest relative to the profile's radius.
FLAT = (0.68, 1.08, 1)


@dataclass(frozen=True)
class Side:
    """Joints of an arm and a leg, in metres."""

    shoulder: Point
    elbow: Point
    wrist: Point
    palm: Point
    fingers: Point
    hip: Point
    knee: Point
    ankle: Point
    heel: Point
    toe: Point


@dataclass(frozen=True)
class Arm:
    """Angles of an arm: `raised_deg` from hanging (0) to straight up (180), and `bent_deg` further.

    Both are in the plane `forward_deg` from sideways (0) to straight ahead (90).
    """

    raised_deg: float
    forward_deg: float = 0.0
    bent_deg: float = 0.0


@dataclass(frozen=True)
class Leg:
    """Angles of a leg: `forward_deg` of the thigh from straight down, and the bend of the knee."""

    forward_deg: float = 0.0
    bent_deg: float = 0.0
    apart_deg: float = 3.0


def resting(side: int) -> Side:
    """Return joints of a person who stands with slightly bent arms."""
    x, y, z = -0.17, 0.22 * side, 1.06
    return Side(
        shoulder=(0, 0.2 * side, 1.4),
        elbow=(0.03, 0.29 * side, 1.14),
        wrist=(x, y, z),
        palm=(x - 0.02, y, z),
        fingers=(x - 0.09, y - 0.02 * side, z + 0.02),
        hip=(0, 0.09 * side, 0.86),
        knee=(-0.02, 0.11 * side, 0.49),
        ankle=(0, 0.12 * side, 0.1),
        heel=(0.02, 0.12 * side, 0.045),
        toe=(-0.13, 0.13 * side, 0.04),
    )


def posed(side: int, arm: Arm, leg: Leg) -> Side:
    """Return joints by angles; the hip is fixed, so the feet may end above or below z = 0."""
    shoulder, hip = np.array([0, 0.2 * side, 1.4]), np.array([0, 0.09 * side, 0.86])
    elbow = shoulder + UPPER_ARM_M * _arm_direction(side, arm.raised_deg, arm.forward_deg)
    forearm = _arm_direction(side, arm.raised_deg + arm.bent_deg, arm.forward_deg)
    wrist = elbow + FOREARM_M * forearm
    knee = hip + THIGH_M * _leg_direction(side, leg.forward_deg, leg.apart_deg)
    turn_deg = leg.forward_deg - leg.bent_deg
    ankle = knee + SHIN_M * _leg_direction(side, turn_deg, leg.apart_deg)
    back, down = _leg_direction(side, turn_deg - 90, 0), _leg_direction(side, turn_deg, 0)
    return Side(
        shoulder.tolist(),
        elbow.tolist(),
        wrist.tolist(),
        (wrist + 0.02 * forearm).tolist(),
        (wrist + HAND_M * forearm).tolist(),
        hip.tolist(),
        knee.tolist(),
        ankle.tolist(),
        (ankle + 0.02 * back + 0.055 * down).tolist(),
        (ankle - 0.13 * back + 0.06 * down).tolist(),
    )


def clothes(sides: Sequence[Side]) -> Mesh:
    """Overall and boots."""
    limbs = [part for side in sides for part in (*_sleeves(side), *_trouser_leg(side))]
    return union([_chest(), *limbs])


def jacket(sides: Sequence[Side]) -> Mesh:
    """Clothes above the belt."""
    return union([_chest(), *(part for side in sides for part in _sleeves(side))])


def trousers(sides: Sequence[Side]) -> Mesh:
    """Clothes below the belt, including boots."""
    return union([part for side in sides for part in _trouser_leg(side)])


def skin(sides: Sequence[Side]) -> Mesh:
    """Head, neck and hands."""
    head = icosphere(2, 0.105)
    head.apply_scale((0.95, 0.78, 1.15))
    parts = [moved(head, (-0.01, 0, 1.645)), limb((0, 0, 1.47), (0, 0, 1.57), 0.055)]
    return union([*parts, *(limb(side.palm, side.fingers, 0.036) for side in sides)])


def nose() -> Mesh:
    """The nose, which distinguishes the front of a head."""
    return limb((-0.105, 0, 1.655), (-0.125, 0, 1.625), 0.014)


def hair() -> Mesh:
    """Hair that leaves the face free."""
    crown = icosphere(2, 0.108)
    crown.apply_scale((0.93, 0.85, 1.1))
    return moved(crown, (0.012, 0, 1.672))


def hard_hat() -> Mesh:
    """Hard hat."""
    dome = [(0.115 * np.cos(a), 1.68 + 0.105 * np.sin(a)) for a in np.radians((0, 25, 50, 75, 90))]
    brim = [(0, 1.672), (0.14, 1.672), (0.14, 1.682)]
    return moved(lathe(brim + dome, sections=18), (-0.015, 0, 0))


def vest() -> Mesh:
    """Safety vest over the jacket."""
    wide = [(radius + 0.015, z) for radius, z in TORSO[2:7]]
    mesh = lathe([(0, 0.93), *wide, (0.1, 1.495), (0, 1.495)], sections=16)
    return mesh.apply_scale(FLAT)


def vest_bands() -> Mesh:
    """Two level bands around the vest."""
    bands = []
    for low, radius in ((1.03, 0.162), (1.2, 0.171)):
        ring = [(0, low), (radius, low), (radius + 0.004, low + 0.05), (0, low + 0.05)]
        bands.append(lathe(ring, sections=16).apply_scale(FLAT))
    return union(bands)


def _chest() -> Mesh:
    chest = lathe(TORSO, sections=16)
    chest.apply_scale(FLAT)
    return chest


def _sleeves(side: Side) -> list[Mesh]:
    return [limb(side.shoulder, side.elbow, 0.058), limb(side.elbow, side.wrist, 0.047)]


def _trouser_leg(side: Side) -> list[Mesh]:
    return [
        limb(side.hip, side.knee, 0.085),
        limb(side.knee, side.ankle, 0.065),
        limb(side.heel, side.toe, 0.045),
    ]


def _arm_direction(side: int, raised_deg: float, forward_deg: float) -> Floats:
    raised, forward = np.radians((raised_deg, forward_deg))
    out = np.array([-np.sin(forward), side * np.cos(forward), 0])
    return np.asarray(np.sin(raised) * out - np.cos(raised) * np.array([0, 0, 1]))


def _leg_direction(side: int, forward_deg: float, apart_deg: float) -> Floats:
    forward, apart = np.radians((forward_deg, apart_deg))
    down = np.array([-np.sin(forward), 0, -np.cos(forward)])
    return np.asarray(np.cos(apart) * down + np.sin(apart) * np.array([0, side, 0]))


#: Length of the body, height of the back, half the width.
SIZES = {"cows": (1.5, 1.4, 0.36), "sheep": (0.75, 0.75, 0.24), "horses": (1.5, 1.6, 0.33)}
COATS = {"cows": "leather", "sheep": "cotton-terry", "horses": "hair-dark"}


def animal(rng: np.random.Generator, kind: str) -> Mesh:
    """Return an animal that grazes, or has its head up."""
    long, tall, thick = SIZES[kind]
    belly = tall - thick
    trunk = limb((-long / 2 + thick, 0, belly), (long / 2 - thick, 0, belly), thick)
    legs = []
    for x in (-long / 2 + 0.8 * thick, long / 2 - 0.8 * thick):
        for y in (-0.55 * thick, 0.55 * thick):
            knee = (x + rng.uniform(-0.06, 0.06), y, 0.45 * belly)
            widths = thick * np.array([0.32, 0.2, 0.16])
            legs.append(tube([(x, y, belly), knee, (x, y, 0)], widths, 7))
    neck = np.array([long / 2 - 0.4 * thick, 0, belly + 0.3 * thick])
    if rng.random() < 0.5:
        head = neck + np.array([0.35 * tall, 0, -0.6 * belly])
        nose = head + np.array([0.12 * tall, 0, -0.1 * tall])
    else:
        head = neck + np.array([0.3 * tall, 0, 0.25 * tall])
        nose = head + np.array([0.2 * tall, 0, -0.08 * tall])
    front = [limb(neck, head, 0.42 * thick), limb(head, nose, 0.3 * thick)]
    ears = []
    for s in (-1, 1):
        root, tip = (head + thick * np.array([0, s * y, z]) for y, z in ((0.2, 0.2), (0.5, 0.35)))
        ears.append(limb(root, tip, 0.08 * thick))
    tail = tube([(-long / 2, 0, belly + 0.5 * thick), (-long / 2 - 0.1, 0, belly * 0.5)], 0.025, 5)
    return union([trunk, *legs, *front, *ears, tail])
