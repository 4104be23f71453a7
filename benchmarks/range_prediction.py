"""Depths of a sensor's zones in the next frame, predicted by a bank of filters for each zone.

What a zone will see depends on what is there. The floor below a level flight passes through it at
the same depth, a point that stands in the world moves as the poses say, and a surface moves as its
plane does, which the neighbouring zones show. Each of these motions has a filter that takes the
measured depth, and one that takes half of it, for zones and poses with more noise than surfaces
change. The filters count by their likelihood in the last frames (multiple models, Y. Bar-Shalom,
X. R. Li & T. Kirubarajan, Estimation with Applications to Tracking and Navigation (2001), ch. 11),
with errors of a Laplace distribution, so that outliers count little. Its scale holds the noise of
ranges and poses and follows from the zone's own innovations.
"""

import numpy as np

from reconstruction.base.arrays import Floats
from reconstruction.capture import Optics
from reconstruction.depth.pixels import pixel_rays

MOTIONS = "still", "point", "plane"
GAINS = 1.0, 0.5
FORGETTING = 0.9
"""Weight of a frame relative to the next."""
FIRST_SCALE_M, MIN_SCALE_M = 0.02, 0.001
"""Mean absolute innovation of a zone at first, and at least: ranges are whole millimetres."""
OUTLIER = 4.0
"""Innovations of so many scales are another surface's, and count no more than that."""
ROUGHNESS, SLOPE, FREEDOM = 0.05, 0.7, 4.0
"""Neighbours scatter about a plane by this fraction, with Student's t; its slope about none."""
MAX_LOG_STEP = 0.5
"""A plane or point that would move farther than this in ln depth says nothing about its zone."""


class RangePrediction:
    """Predicts the depths of ``shape`` zones, row by row, which see a square grid of tangents."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._rays = pixel_rays(optics, shape).reshape(-1, 3)
        index = np.indices(shape).reshape(2, -1)
        rings = np.abs(index[:, :, None] - index[:, None]).max(axis=0)
        self._neighbours = rings == 1
        self._apart = self._rays[:, :2] - self._rays[:, None, :2]
        self._motions = [motion for motion in MOTIONS for _ in GAINS]
        self._gains = np.tile(GAINS, len(MOTIONS))[:, None]
        count = len(self._rays)
        self._depth_m = np.full((len(self._motions), count), np.nan)
        self._loss = np.zeros_like(self._depth_m)
        self._scale_m = np.full(count, FIRST_SCALE_M)
        self._position_m, self._axes = np.zeros(3), np.eye(3)

    def at(self, position_m: Floats, axes: Floats) -> Floats:
        """Expected depths (S,) at the next pose; nan in zones that have measured none yet."""
        turn, shift_m = axes.T @ self._axes, (self._position_m - position_m) @ axes
        pairs = zip(self._motions, self._depth_m, strict=True)
        self._depth_m = np.stack([self._moved(*pair, turn, shift_m) for pair in pairs])
        self._position_m, self._axes = position_m, axes
        likelihood = np.exp(self._loss.min(axis=0) - self._loss)
        self._weights = likelihood / likelihood.sum(axis=0)
        return np.asarray(np.exp((self._weights * np.log(self._depth_m)).sum(axis=0)))

    def take(self, depth_m: Floats) -> None:
        """Learn from the depths (S,) measured at the pose of the prediction, nan where none is."""
        innovation_m = depth_m - self._depth_m
        known = np.isfinite(innovation_m[0])
        off_m = np.minimum(np.abs(innovation_m), OUTLIER * self._scale_m)
        loss = FORGETTING * self._loss + off_m / self._scale_m
        self._loss = np.where(known, loss, self._loss)
        mean_m = (self._weights * off_m).sum(axis=0)
        scale_m = FORGETTING * self._scale_m + (1 - FORGETTING) * mean_m
        another = np.abs(innovation_m) > OUTLIER * self._scale_m
        taken_m = np.where(another | ~known, depth_m, self._depth_m + self._gains * innovation_m)
        self._depth_m = np.where(np.isfinite(depth_m), taken_m, self._depth_m)
        self._scale_m = np.where(known, np.maximum(scale_m, MIN_SCALE_M), self._scale_m)

    def _moved(self, motion: str, depth_m: Floats, turn: Floats, shift_m: Floats) -> Floats:
        """Depths (S,) after the frame has turned and the scene has shifted in it."""
        if motion == "still":
            return depth_m
        if motion == "point":
            moved_m = depth_m * (self._rays @ turn[2]) + shift_m[2]
        else:
            normals = self._normals(1 / depth_m) @ turn.T
            moved_m = (1 + normals @ shift_m) / (normals * self._rays).sum(axis=1)
        with np.errstate(invalid="ignore", divide="ignore"):
            near = np.abs(np.log(moved_m / depth_m)) < MAX_LOG_STEP
        return np.where(near, moved_m, depth_m)

    def _normals(self, inverse: Floats) -> Floats:
        """Planes n · p = 1 (S, 3) through the points of inverse depths (S,) and their neighbours.

        Inverse depth is linear in the tangents on a plane.
        """
        rise = inverse / inverse[:, None] - 1
        usable = self._neighbours & np.isfinite(rise)
        rise = np.where(usable, rise, 0.0)
        slopes = np.zeros((len(inverse), 2))
        by_slope = (SLOPE**2 * self._apart**2).sum(axis=-1)
        for unknown in (by_slope, 0.0):
            off = rise - np.einsum("ija,ia->ij", self._apart, slopes)
            variance = ROUGHNESS**2 + unknown
            weights = usable * (FREEDOM + 1) / (FREEDOM + off**2 / variance) / ROUGHNESS**2
            weighted = weights[..., None] * self._apart
            information = np.einsum("ija,ijb->iab", weighted, self._apart) + np.eye(2) / SLOPE**2
            right = np.einsum("ija,ij->ia", weighted, rise)
            slopes = np.linalg.solve(information, right[..., None])[..., 0]
        along = 1 - (slopes * self._rays[:, :2]).sum(axis=1)
        return np.column_stack([slopes, along]) * inverse[:, None]
