"""Animals on a pasture: they stand on z = 0 along x, head towards +x; lengths in metres."""

import numpy as np

from spisim_worlds.parts.shapes import Mesh, limb, tube, union

#: Length of the body, height of the back, half the width.
SIZES = {"cows": (1.5, 1.4, 0.36), "sheep": (0.75, 0.75, 0.24), "horses": (1.5, 1.6, 0.33)}
COATS = {"cows": "leather", "sheep": "cotton-terry", "horses": "hair-dark"}


def animal(rng: np.random.Generator, kind: str) -> Mesh:
    """One that grazes, or has its head up."""
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
