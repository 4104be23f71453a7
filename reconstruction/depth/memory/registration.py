"""How well the pose of a frame, relative to an earlier one, explains both images.

With the map of the frame, every pixel has its place in the earlier image. The frame's is that
times a gain, plus what moves with the camera: veil and beam. What they leave is laid to an error of
the relative pose (direct alignment: Lucas & Kanade, IJCAI 1981; with depth: Kerl, Sturm & Cremers,
ICRA 2013).
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from ...base.arrays import Floats
from ...capture import Optics
from ..pixels import MIN_DEPTH_M, in_view, pixel_of, pixel_rays
from .maps import sampled

ROWS = 32
"""Rows of the images that are compared, after a blur by `BLUR` of their pixels."""
BLUR = 1.25
INDEPENDENT = 4 * np.pi * BLUR**2
"""Pixels of the compared images to an independent one, as the blur leaves them."""
STEPS = 3
MIN_OVERLAP = 0.3
"""Part of a frame that must be in view of the other."""
FLAT = 1e-6
"""Relative contrast below which there is nothing to see."""
FLOOR = 1e-3
"""Smallest deviation of two images, in standard deviations of one."""


class Evidence(NamedTuple):
    """What images say of the error x of a relative pose: ln p = h·x − x·Sx / 2 + constant.

    x is a rotation vector and a shift along the axes of the later frame: radians and metres.
    """

    information: Floats
    score: Floats

    def marginalized(self, precision: Floats) -> "Evidence":
        """Of a part of x, the rest of which is noise of the inverse variances (6,)."""
        kept = precision[:, None] * np.linalg.inv(self.information + np.diag(precision))
        return Evidence(kept @ self.information, kept @ self.score)


@dataclass(frozen=True, eq=False)
class Keyframe:
    """An image, blurred and of fewer pixels, with its points in the optical frame."""

    time_s: float
    image: Floats
    points_m: Floats


class Registration:
    """Compares frames of one camera."""

    def __init__(self, optics: Optics, shape: tuple[int, int]) -> None:
        self._optics = optics
        self._step = max(1, shape[0] // ROWS)
        self._rays = pixel_rays(optics, shape)[:: self._step, :: self._step]
        self._shape = self._rays.shape[:2]
        self._blur = BLUR * self._step
        self._full_shape = shape

    def keyframe(self, time_s: float, image: Floats, log_depth: Floats) -> Keyframe:
        """What is kept of a frame's image (H, W) and map of ln depth."""
        from scipy.ndimage import gaussian_filter  # slow to load

        every = (slice(None, None, self._step),) * 2
        blurred = gaussian_filter(image.astype(np.float64), self._blur, mode="nearest")[every]
        return Keyframe(time_s, blurred, self._rays * np.exp(log_depth[every])[..., None])

    def evidence(
        self, frame: Keyframe, before: Keyframe, turn: Floats, shift_m: Floats, precision: Floats
    ) -> Evidence | None:
        """Evidence on the error of a relative pose; None without overlap or anything to see.

        ``turn`` (3, 3) and ``shift_m`` (3,) take points of ``frame`` into ``before``; ``precision``
        (6,) are the inverse variances of their error, by which its estimates are damped.
        """
        if min(self._shape) < 2:
            return None
        flow, error = self._flow(frame.points_m), np.zeros(6)
        for _ in range(STEPS):
            found = self._at(error, frame, before, turn, shift_m, flow)
            if found is None:
                return None
            total = found._replace(score=found.score + found.information @ error)
            error = np.asarray(np.linalg.solve(total.information + np.diag(precision), total.score))
        return total

    def _at(
        self,
        error: Floats,
        frame: Keyframe,
        before: Keyframe,
        turn: Floats,
        shift_m: Floats,
        flow: tuple[Floats, Floats],
    ) -> Evidence | None:
        """Evidence on what the error is beyond a given one (6,), about which it is linear."""
        from scipy.spatial.transform import Rotation  # slow to load

        shift_m, turn = (
            shift_m + turn @ error[3:],
            turn @ Rotation.from_rotvec(error[:3]).as_matrix(),
        )
        local_m = (frame.points_m @ turn.T + shift_m).reshape(-1, 3)
        local_m[:, 2] = np.maximum(local_m[:, 2], MIN_DEPTH_M)
        pixel = pixel_of(local_m, self._optics, self._full_shape) / self._step
        inside = in_view(pixel, self._shape)
        if inside.mean() < MIN_OVERLAP:
            return None
        carried, image = sampled(before.image, pixel), frame.image.ravel()[inside]
        if min(np.ptp(carried[inside]), np.ptp(image)) <= FLAT * np.abs(image).max():
            return None
        slope = np.gradient(carried.reshape(self._shape))
        moved = flow[0] * slope[0].ravel() + flow[1] * slope[1].ravel()
        others = np.array([carried, before.image.ravel()])
        return _least_squares(moved[:, inside], others[:, inside], image)

    def _flow(self, points_m: Floats) -> tuple[Floats, Floats]:
        """Rows and columns (6, N) by which pixels move by each part of the error."""
        x, y, z = points_m.reshape(-1, 3).T
        height, width = (side / self._step for side in self._full_shape)
        zero, one = np.zeros_like(z), np.ones_like(z)
        across = np.array([zero, z, -y, one, zero, zero])
        down = np.array([-z, zero, x, zero, one, zero])
        ahead = np.array([y, -x, zero, zero, zero, one])
        per_m = (height / 2 / self._optics.tan_half_height, width / 2 / self._optics.tan_half_width)
        return per_m[0] * (down - y / z * ahead) / z, per_m[1] * (across - x / z * ahead) / z


def _least_squares(moved: Floats, others: Floats, image: Floats) -> Evidence:
    """Evidence on the factors of ``moved`` (6, N), those of ``others`` (2, N) being free.

    The first of the others moves. The noise is what they leave.
    """
    moved, others, image = (
        each - each.mean(axis=-1, keepdims=True) for each in (moved, others, image)
    )
    normal = others @ others.T + FLOOR**2 * len(image) * np.var(image) * np.eye(len(others))
    factors, common = (
        np.linalg.solve(normal, others @ image),
        np.linalg.solve(normal, others @ moved.T),
    )
    moved, common = factors[0] * moved, factors[0] * common
    left = image - factors @ others
    variance = INDEPENDENT * float(np.mean(left**2) + FLOOR**2 * np.var(image))
    own = moved - common.T @ others
    return Evidence(own @ own.T / variance, own @ left / variance)
