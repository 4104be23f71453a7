"""Boxes of fog and smoke."""

import warnings
from collections.abc import Sequence
from itertools import combinations

import numpy as np

from reconstruction.arrays import Floats
from spisim.scene.model import Volume
from spisim.scene.warning import SceneWarning

#: Boxes that overlap by less, relative to their size, only touch.
TOUCHING = 1e-9


def warn_of_overlap(volumes: Sequence[Volume]) -> None:
    """SceneWarning for every two volumes that share space: there, both scatter."""
    for first, second in combinations(volumes, 2):
        if overlap(first.to_world, second.to_world):
            warnings.warn(
                f"volumes {first.name!r} and {second.name!r} overlap: their extinctions add where "
                "they do",
                SceneWarning,
                stacklevel=2,
            )


def overlap(first: Floats, second: Floats) -> bool:
    """Whether two boxes, as (4, 4) poses of the unit cube, share space.

    Two boxes are apart if they are along the normal of a face of either or along a vector normal
    to an edge of both (Gottschalk, Lin & Manocha 1996).
    """
    edges = [box[:3, :3].T for box in (first, second)]  # rows: three edge vectors
    centres = [box[:3, :3].sum(axis=1) / 2 + box[:3, 3] for box in (first, second)]
    axes = np.concatenate(
        [
            *(_face_normals(box) for box in edges),
            np.cross(edges[0][:, None], edges[1]).reshape(9, 3),
        ]
    )
    gaps = np.abs(axes @ (centres[1] - centres[0]))
    reaches = sum(np.abs(axes @ box.T).sum(axis=1) / 2 for box in edges)
    # Edges that are parallel give no axis, only rounding.
    sizes = np.linalg.norm(edges[0], axis=1).max() * np.linalg.norm(edges[1], axis=1).max()
    real = np.linalg.norm(axes, axis=1) > TOUCHING * sizes
    return bool((gaps < (1 - TOUCHING) * reaches)[real].all())


def _face_normals(edges: Floats) -> Floats:
    return np.cross(np.roll(edges, -1, axis=0), np.roll(edges, -2, axis=0))
