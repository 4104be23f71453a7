"""Corridors in any direction."""

import numpy as np
import pytest

from reconstruction.base.errors import InputError
from reconstruction.capture import Optics
from reconstruction.depth import DepthEstimate, nearest_obstacle_m
from reconstruction.depth.ahead import Ahead
from reconstruction.depth.obstacle import CorridorPrior
from reconstruction.depth.pixels import pixel_rays

OPTICS = Optics(tan_half_width=0.4, tan_half_height=0.4)
SHAPE = (8, 8)
SIDE = np.array([0.2, 0.0, 1.0])


def wall_with_a_gap(x_m):
    """Depths of a wall at 3 m, and at 12 m where x is within 0.5 m of this at the wall."""
    x = 3.0 * pixel_rays(OPTICS, (32, 32))[..., 0]
    return np.where(np.abs(x - x_m) < 0.5, 12.0, 3.0)


@pytest.mark.parametrize("axis", [0, 1])
def test_a_corridor_through_a_gap_is_free_beside_the_wall(axis):
    depth_m = wall_with_a_gap(3.0 * SIDE[0])
    direction = SIDE if axis == 0 else SIDE[[1, 0, 2]]
    depth_m = depth_m if axis == 0 else depth_m.T
    prior = CorridorPrior(0.0, 1.0, 0.05, 0.0, 0.3)
    ahead = Ahead(pixel_rays(OPTICS, (32, 32)), depth_m, np.full((32, 32), 0.02), None, prior)
    assert nearest_obstacle_m(ahead.free()) == pytest.approx(3.0, rel=0.1)
    length = np.linalg.norm(direction)
    assert nearest_obstacle_m(ahead.free(direction)) == pytest.approx(12 * length, rel=0.1)
    assert nearest_obstacle_m(ahead.free(-3 * direction * [1, 1, -1])) == pytest.approx(
        3 * length, rel=0.1
    )


@pytest.mark.parametrize(
    ("direction", "message"),
    [
        ((0.5, 0, 1), r"out of view; x / z is at most 0\.35"),
        ((0, -0.5, 1), "y / z at most"),
        ((0, 0, -1), "with z > 0"),
        ((0, 0, 0), "not all zero"),
        ((0, np.nan, 1), "three finite numbers"),
        ((0, 1), "three finite numbers"),
    ],
)
def test_a_corridor_that_leads_out_of_view_is_refused(direction, message):
    with pytest.raises(InputError, match=message):
        Ahead.of(
            DepthEstimate(np.full(SHAPE, 3.0), np.full(SHAPE, 0.1)),
            pixel_rays(OPTICS, SHAPE),
            "learned",
        ).free(direction)
