"""Readings of a spot's target and of homogeneous fog in front of it, with their slopes."""

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from ...base.arrays import Floats
from ...capture.spots import SpotOptics
from .overlap import overlap, path_lengths
from .templates import PATCH_M

STEP_M = 0.005
"""Range step of the fog integral."""
DIFFERENCE_M = 1e-3
"""Half the path difference from which slopes are computed."""
MIN_STEPS = 8
"""Minimum number of steps before a target."""


@dataclass(frozen=True, eq=False)
class Echo:
    """Expected readings (n,) of a spot and their slopes.

    ``of_fog`` (n, 2) is along the logarithms of backscattering and extinction, ``of_target`` (n, 3)
    along range, reflectance and a path offset in metres. ``uneven`` (n, n) is the covariance added
    by fog whose density has a relative rms deviation of 1.
    """

    readings: Floats
    of_fog: Floats
    of_target: Floats
    uneven: Floats


class EchoModel:
    """Readings of spots up to a range; ``response`` as for `templates.make_templates`."""

    def __init__(
        self, optics: SpotOptics, response: Callable[[Floats], Floats], max_range_m: float
    ) -> None:
        self.spots = len(optics.directions)
        self._range_m = np.arange(1, max_range_m / STEP_M + 2) * STEP_M
        self._weight = overlap(optics, self._range_m)[0]
        self._path_m = path_lengths(optics, self._range_m)
        before, self._response, after = (
            np.stack([response(path + shift) for path in self._path_m])  # (spots, n, R)
            for shift in (-DIFFERENCE_M, 0.0, DIFFERENCE_M)
        )
        self._response_slope = (after - before) / (2 * DIFFERENCE_M)

    def __call__(self, spot: int, range_m: float, reflectance: float, log_fog: Floats) -> Echo:
        """Echo of a spot; ``log_fog`` holds the logarithms of backscattering and extinction."""
        beta, sigma = np.exp(log_fog)
        after = int(
            np.clip(np.searchsorted(self._range_m, range_m), MIN_STEPS, self._range_m.size - 1)
        )
        fraction = (range_m - self._range_m[after - 1]) / STEP_M
        path_m = self._path_m[spot, : after + 1]
        seen = self._weight[spot, : after + 1] * np.exp(-sigma * path_m)
        light = seen * self._response[spot, :, : after + 1]
        turned = seen * self._response_slope[spot, :, : after + 1]

        def here(values: Floats) -> Floats:
            before, behind = values[..., -2], values[..., -1]
            return np.asarray(before + fraction * (behind - before))

        def in_front(values: Floats) -> Floats:
            whole = values[..., :-1].sum(axis=-1) - values[..., -2] / 2
            return np.asarray(STEP_M * (whole + fraction * (values[..., -2] + here(values)) / 2))

        target, fog = here(light) / np.pi, in_front(light)
        # Along the range the phase follows the slope of the path; the rest changes slowly.
        fading = np.log(seen[-1] / seen[-2]) / STEP_M
        along = fading * here(light) + (path_m[-1] - path_m[-2]) / STEP_M * here(turned)
        damped = -sigma * (reflectance * here(path_m) * target + beta * in_front(path_m * light))
        offset = reflectance / np.pi * here(turned) + beta * in_front(turned)
        farther = reflectance / np.pi * along + beta * np.pi * target  # more fog in front, too
        return Echo(
            readings=reflectance * target + beta * fog,
            of_fog=np.stack([beta * fog, damped], axis=-1),
            of_target=np.stack([farther, target, offset], axis=-1),
            uneven=_uneven(beta * STEP_M * light[:, :-1]),
        )


def _uneven(cells: Floats) -> Floats:
    """Covariance (n, n) of the sum of cells (n, R) with exponentially correlated densities."""
    growth = np.exp(np.arange(cells.shape[-1]) * STEP_M / PATCH_M)
    grown = cells * growth
    before = (np.cumsum(grown, axis=-1) - grown) / growth
    shared = cells @ before.T
    return np.asarray(shared + shared.T + cells @ cells.T)
