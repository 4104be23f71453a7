"""Ranges by trimesh's ray casting: a second opinion on the ground truth.

trimesh finds the triangle with Embree (package embreex) or with an R-tree (rtree, slowly), and the
point on it in double precision.
"""

from dataclasses import dataclass

import numpy as np
import trimesh
from numpy.typing import NDArray
from scipy.ndimage import maximum_filter, minimum_filter

from reconstruction.base.arrays import Floats
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.scene.bsdf import ThinPane
from spisim.transport import ground_truth

#: Every so many-th row and column of pixels: an R-tree takes milliseconds for a ray.
STRIDE = 1 if trimesh.ray.has_embree else 8
#: Within a pixel and its neighbours, a step by so much of the range or another object is an edge.
EDGE = 0.02


@dataclass(frozen=True, eq=False)
class Comparison:
    """Truth against trimesh in the middle of the first frame, over pixels and spots."""

    truth_m: Floats  # (h, w), every STRIDE-th row and column; inf where nothing is hit
    trimesh_m: Floats
    spots_m: Floats  # (4,), truth less trimesh
    edges: NDArray[np.bool_]  # (h, w): pixels beside which the range steps

    @property
    def difference_m(self) -> Floats:
        """(h, w), of what either hits; inf where only one of them hits anything."""
        hit = np.isfinite(self.truth_m) | np.isfinite(self.trimesh_m)
        return np.abs(self.truth_m[hit] - self.trimesh_m[hit])

    @property
    def inside_m(self) -> Floats:
        """The same of pixels that are on no edge."""
        hit = (np.isfinite(self.truth_m) | np.isfinite(self.trimesh_m)) & ~self.edges
        return np.abs(self.truth_m[hit] - self.trimesh_m[hit])


def compare(scene: Scene, instrument: Instrument) -> Comparison:
    """Range of every pixel's centre and of the four spots, both ways."""
    middle = scene.at(instrument.frame_time_s / 2)
    truth = ground_truth(middle, instrument)
    projector = instrument.projector
    (height, width), step = projector.shape, slice(None, None, STRIDE)
    x = (2 * (np.arange(width) + 0.5) / width - 1)[step] * projector.tan_half_width
    y = (2 * (np.arange(height) + 0.5) / height - 1)[step] * projector.tan_half_height
    rays = np.stack([*np.meshgrid(x, y), np.ones((len(y), len(x)))], axis=-1)
    ranges = first_ranges(
        middle, np.concatenate([rays.reshape(-1, 3), instrument.lasers.directions])
    )
    finite = np.where(np.isfinite(truth.range_m), truth.range_m, np.inf).astype(np.float64)
    beyond = np.minimum(finite, 1e3)
    steps = maximum_filter(beyond, 3) - minimum_filter(beyond, 3) > EDGE * beyond
    steps |= maximum_filter(truth.object_id, 3) != minimum_filter(truth.object_id, 3)
    return Comparison(
        finite[step, step],
        ranges[:-4].reshape(len(y), len(x)),
        truth.spot_range_m - ranges[-4:],
        steps[step, step],
    )


def first_ranges(scene: Scene, rays: Floats) -> Floats:
    """Distance (n,) from the drone along rays (n, 3) of its optical frame; inf where none.

    Rays pass through panes, which send no light back.
    """
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ scene.drone_pose[:3, :3].T
    origin = scene.drone_pose[:3, 3]
    things = [o for o in scene.objects if not isinstance(o.material.bsdf, ThinPane)]
    bare = [trimesh.Trimesh(o.mesh.vertices, o.mesh.faces, process=False) for o in things]
    mesh = trimesh.util.concatenate(bare)
    origins = np.tile(origin, (len(rays), 1))
    positions, ray, _ = mesh.ray.intersects_location(origins, rays, multiple_hits=False)
    ranges = np.full(len(rays), np.inf)
    np.minimum.at(ranges, ray, np.linalg.norm(positions - origin, axis=1))
    return ranges
