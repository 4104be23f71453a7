"""Corridors integrate over the posterior of the spots, and maps are held against their ranges."""

import pickle
from dataclasses import replace

import numpy as np
import pytest

from reconstruction import InputError, Reconstructor
from reconstruction.capture import Optics
from reconstruction.depth import (
    DISTANCES_M,
    FORWARD,
    CorridorPosterior,
    DepthEstimate,
    SpotsAhead,
    corridors_of,
    nearest_obstacle_m,
    pixel_of,
    pixel_rays,
)
from reconstruction.depth.agreement import agrees
from reconstruction.depth.corridor_posterior import UNSEEN, WRONG, unseen_free
from reconstruction.ranging.first_surface import EDGES_M, FirstSurfaces
from sameplane import recorded

SHAPE = (32, 32)
OPTICS = Optics(np.tan(np.radians(10)), np.tan(np.radians(10)))
RAYS = pixel_rays(OPTICS, SHAPE)
DIRECTIONS = np.array([[x, y, 1.0] for y in (-0.09, 0.09) for x in (-0.09, 0.09)])
DIRECTIONS /= np.linalg.norm(DIRECTIONS, axis=1)[:, None]
PIXEL = pixel_of(DIRECTIONS, OPTICS, SHAPE)


def surfaces(*weights_at_m, beyond=0.0):
    """The same posterior of all four spots: weights at some ranges, and beyond all."""
    mass = np.zeros((4, EDGES_M.size + 1))
    for range_m, weight in weights_at_m:
        mass[:, np.searchsorted(EDGES_M, range_m)] += weight
    mass[:, -1] += beyond
    return FirstSurfaces(mass)


def posterior(first, depth_m=None, sigma=0.1):
    """Corridors of a flat map, or of none."""
    known = depth_m is not None
    estimate = DepthEstimate(
        np.full(SHAPE, depth_m if known else np.nan), np.full(SHAPE, sigma) if known else None
    )
    image = np.ones(SHAPE)
    spots = SpotsAhead(first, DIRECTIONS, PIXEL, image)
    return CorridorPosterior(estimate, corridors_of(estimate, RAYS), spots, RAYS)


def at(free, distance_m):
    """Probability at a distance."""
    return float(np.interp(distance_m, DISTANCES_M, free))


def test_an_alternative_that_the_map_dropped_stays_in_the_way():
    free = posterior(surfaces((2.0, 0.2), (12.0, 0.8)), depth_m=12.0)(FORWARD)
    assert 0.6 < at(free, 3.0) < 0.81
    assert (np.diff(free) <= 0).all()


def test_an_alternative_outside_the_corridor_s_spots_stays_in_the_way_too():
    """At 5 m the spots lie beside the corridor, but what they meet goes on."""
    free = posterior(surfaces((5.0, 0.3), (15.0, 0.7)), depth_m=15.0)(FORWARD)
    assert at(free, 6.0) < 0.75


def test_a_map_far_beyond_its_ranges_is_not_believed():
    free = posterior(surfaces((3.0, 1.0)), depth_m=12.0)(FORWARD)
    assert at(free, 3.5) < 0.1


def test_without_a_map_the_spots_alone_answer():
    free = posterior(surfaces((0.1, 0.6), beyond=0.4))(FORWARD)
    assert at(free, 1.0) <= 0.4 + 1e-9
    assert np.isfinite(free).all()


def test_a_steered_direction_counts_the_spots_within_it():
    direction = np.array([0.09, 0.09, 1.0])
    first = surfaces(beyond=1.0)
    mass = first.mass.copy()
    mass[3] = surfaces((4.0, 1.0)).mass[3]
    free = posterior(FirstSurfaces(mass), depth_m=30.0)
    assert at(free(direction), 5.0) < 0.1


def test_between_the_rays_something_may_stand():
    looked_m = 10 * DIRECTIONS
    free = unseen_free(looked_m, FORWARD)
    assert at(free, 0.6) == pytest.approx(1.0)
    assert 1 - UNSEEN <= at(free, 3.0) < 0.9
    assert free.min() >= 1 - UNSEEN


def test_where_ranges_have_looked_everywhere_nothing_is_unseen():
    across = np.linspace(-0.35, 0.35, 15)
    looked_m = np.array([[x, y, 3.0] for x in across for y in across])
    free = unseen_free(looked_m, FORWARD)
    assert at(free, 2.8) == pytest.approx(1.0)
    assert at(free, 6.0) == pytest.approx(1 - UNSEEN)


@pytest.mark.parametrize(("depth_m", "expected"), [(3.0, True), (3.5, True), (9.0, False)])
def test_a_map_agrees_with_its_own_ranges_or_not(depth_m, expected):
    estimate = DepthEstimate(np.full(SHAPE, depth_m), np.full(SHAPE, 2.0))
    log_depth = np.log(np.full((1, 4), 3.0))
    assert bool(agrees(estimate, PIXEL, log_depth)[0]) is expected


def test_one_spot_on_an_edge_is_no_contradiction():
    estimate = DepthEstimate(np.full(SHAPE, 3.0), np.full(SHAPE, 0.1))
    assert agrees(estimate, PIXEL, np.log([[3.0, 3.0, 3.0, 30.0]]))[0]
    assert agrees(estimate, PIXEL, np.full((1, 4), np.nan))[0]


class Broken:
    """A depth method that always fails."""

    name, title, needs = "broken", "broken", ("spots",)

    def compile(self, context):
        """Solver that raises."""

        def solve(view):
            raise ArithmeticError("broken")

        return solve


def test_a_frame_whose_every_map_fails_is_not_free():
    capture, failures = recorded(3), []
    reconstructor = Reconstructor(
        capture.setup, depth=Broken(), failed=lambda *failure: failures.append(failure)
    )
    result = reconstructor(capture.frame(0))
    assert len(failures) == 1
    assert result.depth_m is None
    assert result.obstacle_m < 1.25 * np.median(result.ranges.range_m)


@pytest.mark.parametrize("status", ["saturated", "weak"])
def test_a_frame_of_spots_without_ranges_is_not_free(status):
    capture = recorded(3)
    taps = np.full_like(capture.spots.taps, np.median(capture.spots.taps))  # of no phase
    saturated = np.full(capture.spots.saturated.shape, status == "saturated")
    changed = replace(capture, spots=replace(capture.spots, taps=taps, saturated=saturated))
    result = Reconstructor(changed.setup)(changed.frame(0))
    assert set(result.ranges.status) == {status}
    assert result.obstacle_m < 4.5  # the plane is at 4 m, and bright


def test_what_a_flight_remembers_in_the_corridor_is_in_the_way():
    """Two points of a pole at 2 m, a map and spots that say 6 m: a lone point may be wrong."""
    points_m = np.array([[0.1, 0.0, 2.0], [0.1, 0.2, 2.0], [0.5, 0.0, 2.0]])

    def free_past(log_sigma):
        estimate = replace(
            DepthEstimate(np.full(SHAPE, 6.0), np.full(SHAPE, 0.1)),
            points_m=points_m,
            points_log_sigma=np.array(log_sigma),
        )
        spots = SpotsAhead(surfaces((6.0, 1.0)), DIRECTIONS, PIXEL, np.ones(SHAPE))
        free = CorridorPosterior(estimate, corridors_of(estimate, RAYS), spots, RAYS)(FORWARD)
        return at(free, 1.7), at(free, 2.5)

    assert min(free_past([np.inf, np.inf, 0.02])) > 0.85  # out of the corridor
    assert free_past([0.02, np.inf, np.inf])[1] == pytest.approx(WRONG, abs=0.01)
    before, past = free_past([0.02, 0.02, 0.02])
    assert before > 0.85
    assert past == pytest.approx(WRONG**2, abs=0.01)


@pytest.mark.parametrize("direction", [(1, 0, 0.1), (0, 0, -1), (0, 0, 0), (1, 0)])
def test_directions_out_of_view_are_refused_without_a_map_too(direction):
    with pytest.raises(InputError, match="direction"):
        posterior(surfaces((3.0, 1.0)))(direction)


def test_a_broad_range_is_not_taken_for_its_nearest_part():
    spread = [(range_m, 1 / 16) for range_m in np.geomspace(2, 8, 16)]
    free = posterior(surfaces(*spread))(FORWARD)
    assert at(free, 1.8) > 0.85
    assert 0.35 < at(free, 4.0) < 0.65


def test_corridors_can_be_pickled():
    estimate = DepthEstimate(np.full(SHAPE, 3.0), free=np.linspace(1, 0, DISTANCES_M.size))
    spots = SpotsAhead(surfaces((3.0, 1.0)), DIRECTIONS, PIXEL, np.ones(SHAPE))
    corridors = CorridorPosterior(estimate, corridors_of(estimate, RAYS), spots, RAYS)
    again = pickle.loads(pickle.dumps(corridors))
    np.testing.assert_array_equal(again(FORWARD), corridors(FORWARD))


def test_a_probability_that_is_no_number_is_not_free():
    assert nearest_obstacle_m(np.full(DISTANCES_M.size, np.nan)) == DISTANCES_M[0]
