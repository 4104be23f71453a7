"""Which of the possible ranges of a spot a flight remembers."""

import numpy as np
import pytest

from flights import OPTICS, SHAPE, pose, towards
from reconstruction.depth import DepthEstimate
from reconstruction.depth.memory import FlightMemory, FrameRanges
from reconstruction.depth.memory.unwrap import MAX_LIKELIER, LostSpots, Possible, likeliest
from reconstruction.ranging import Alternative

R_M = 10.0


def echo(true_m, reflectance):
    """What a spot states of a surface: range within R, ln reflectance as if it lay there."""
    range_m = true_m % R_M
    log_reflectance = np.log([reflectance * (range_m / true_m) ** 2])
    return Possible.wrapped(np.array([range_m]), np.array([0.01]), log_reflectance, R_M)


def by_map(possible, map_m, sigma, **options):
    """Likeliest range by a map that says `map_m` for all spots."""
    return likeliest(possible, (np.log(possible.range_m) - np.log(map_m)) / sigma, **options)


@pytest.mark.parametrize(
    ("true_m", "reflectance", "map_m", "sigma"),
    [
        (12.15, 0.3, 12.0, 0.3),
        (12.15, 0.3, 3.0, 1.0),  # the echo convinces where the map does not know
        (2.15, 0.3, 2.2, 0.3),
        (2.15, 0.05, 2.3, 0.3),  # dark, but near
        (2.15, 0.3, 12.0, 0.3),  # too bright to be far, whatever the map says
        (9.5, 0.1, 9.0, 0.3),
    ],
)
def test_a_range_is_unwrapped_by_its_echo(true_m, reflectance, map_m, sigma):
    result = by_map(echo(true_m, reflectance), map_m, sigma)
    np.testing.assert_allclose(result, [[true_m], [0.01]])


def test_a_range_that_may_lie_at_either_of_two_distances_is_none():
    bright = echo(22.15, 0.4)  # or rather dark, at 12.15 m
    assert np.isnan(by_map(bright, 20.0, 0.3)).all()
    np.testing.assert_allclose(by_map(echo(22.15, 0.05), 20.0, 0.3)[0], [22.15])


def test_without_reflectance_a_range_is_left_as_it_is():
    unknown = np.full(2, np.nan)
    possible = Possible.wrapped(np.array([2.15, np.nan]), np.full(2, 0.01), unknown, R_M)
    np.testing.assert_array_equal(by_map(possible, 12.0, 0.1)[0], [2.15, np.nan])


@pytest.mark.parametrize(
    ("map_m", "sigma", "taken"),
    [
        (11.0, 0.1, (11.0, 0.02)),
        (8.0, 0.1, (8.5, 0.01)),
        (30.0, 0.2, (np.nan, np.nan)),  # the map speaks for none
        (9.7, 0.5, (np.nan, np.nan)),  # nor does it know
    ],
)
def test_the_map_decides_between_the_ranges_that_a_method_states(map_m, sigma, taken):
    several = [Alternative(8.5, 0.01, 0.6), Alternative(11.0, 0.02, 0.4)]
    possible = Possible.of([several, [Alternative(3.0, 0.05, 1.0)], []])
    range_m, sigma_m = by_map(possible, [map_m, 9.0, 9.0], sigma)
    np.testing.assert_allclose((range_m[0], sigma_m[0]), taken)
    np.testing.assert_allclose((range_m[1], sigma_m[1]), (3.0, 0.05))  # there is no other
    assert np.isnan([range_m[2], sigma_m[2]]).all()


def test_lost_spots_speak_for_what_is_beyond_the_unambiguous_range():
    """A dark wall at 8 m, or a usual one at 18 m: 19 in 20 spots met nothing, or none did."""
    lost, met = np.ones(4, dtype=bool), np.zeros(4, dtype=bool)
    empty, full = LostSpots(), LostSpots()
    for number in range(60):
        in_the_open = empty.take(lost if number % 20 else met, 0.01 * number)
        indoors = full.take(met, 0.01 * number)
    assert indoors == pytest.approx(1)
    assert in_the_open == MAX_LIKELIER
    assert full.take(lost, 10.0) > 2  # what was met long ago is forgotten
    weak = echo(18.0, 0.45)
    np.testing.assert_allclose(by_map(weak, 13.0, 1.0)[0], [8.0])
    assert np.isnan(by_map(weak, 13.0, 1.0, likelier=in_the_open)[0])
    bright = echo(8.0, 0.9)
    np.testing.assert_allclose(by_map(bright, 13.0, 1.0, likelier=in_the_open)[0], [8.0])


def test_a_map_is_not_believed_against_a_clear_echo():
    echoes = [
        [Alternative(4.0, 0.02, near), Alternative(14.0, 0.02, 1 - near)] for near in (0.9, 0.97)
    ]
    range_m, _ = by_map(Possible.of(echoes, R_M), 14.0, 0.1)
    np.testing.assert_array_equal(range_m, [np.nan, 4.0])


def either_or(near, spots):
    """Ranges of spots that have met something at 4 m, with probability `near`, or at 14 m."""
    either = [Alternative(4.0, 0.02, near), Alternative(14.0, 0.02, 1 - near)]
    nothing, possible = np.full(len(spots), np.nan), Possible.of([either] * len(spots), R_M)
    return FrameRanges(spots, nothing, nothing, possible, np.zeros(len(spots), dtype=bool))


def flat_map(depth_m, sigma):
    return DepthEstimate(np.full(SHAPE, depth_m), np.full(SHAPE, sigma))


def before_a_wall(spots, frames=20):
    """A flight that knows a wall at 14 m."""
    memory = FlightMemory(OPTICS, SHAPE)
    wall = FrameRanges(spots, 14.0 / spots[:, 2], np.full(len(spots), 0.02))
    for number in range(frames):
        memory.take(pose(number), np.ones(SHAPE), flat_map(14.0, 0.3), wall)
    return memory


@pytest.mark.parametrize(
    ("near", "own_m", "sigma", "expected_m"),
    [
        (0.5, 8.0, 0.4, 14.0),  # the frame's own map lies between both
        (0.9, 8.0, 0.4, 8.0),  # in doubt
        (0.9, 5.0, 0.3, 5.0),  # something may have appeared: as the frame's own map has it
        (0.95, 5.0, 0.3, 5.0),
        (0.99, 8.0, 0.4, 4.0),  # its echo is too bright for the wall's distance
    ],
)
def test_what_was_there_decides_unless_something_may_have_appeared(near, own_m, sigma, expected_m):
    spots = towards((16, 16), (48, 48))
    memory = before_a_wall(spots)
    for number in range(20, 30):
        own = flat_map(own_m, sigma)
        result = memory.take(pose(number), np.ones(SHAPE), own, either_or(near, spots))
    assert result.estimate.depth_m[16, 16] == pytest.approx(expected_m, rel=0.25)


def test_what_may_have_appeared_hides_the_wall_behind_it_and_no_more():
    spots = towards((16, 16), (48, 48))
    memory = before_a_wall(spots)
    assert len(memory.ranges.points) == 2
    memory.take(pose(20), np.ones(SHAPE), flat_map(5.0, 0.3), either_or(0.9, spots[:1]))
    kept_m = memory.ranges.points.position_m
    np.testing.assert_allclose(kept_m, [14.0 / spots[1, 2] * spots[1]], rtol=1e-6)


@pytest.mark.parametrize(
    ("near", "own_m", "sigma"), [(0.88, 5.0, 0.3), (0.84, 4.0, 0.1), (0.7, 4.0, 0.1)]
)
def test_in_the_open_a_thing_that_the_frame_sees_near_is_not_taken_for_far(near, own_m, sigma):
    """All spots were lost before; one, of four, meets something at 4 or 14 m."""
    spots, nothing = towards((16, 16), (16, 48), (48, 16), (48, 48)), np.full(4, np.nan)
    memory = FlightMemory(OPTICS, SHAPE)
    empty = Possible.of([[]] * 4, R_M)
    for number in range(20):
        lost = FrameRanges(spots, nothing, nothing, empty, np.ones(4, dtype=bool))
        memory.take(pose(number), np.ones(SHAPE), flat_map(16.0, 1.0), lost)
    for number in range(20, 40):
        result = memory.take(
            pose(number), np.ones(SHAPE), flat_map(own_m, sigma), either_or(near, spots[:1])
        )
        assert not (memory.ranges.points.position_m[:, 2] > 8).any()
    assert result.estimate.depth_m[16, 16] < 1.2 * own_m


def test_one_weak_echo_in_the_open_is_no_wall():
    spots, nothing = towards((16, 16), (48, 48)), np.full(2, np.nan)
    memory, sky = FlightMemory(OPTICS, SHAPE), flat_map(16.0, 1.0)
    empty = Possible.of([[], []], R_M)
    for number in range(30):
        lost = FrameRanges(spots, nothing, nothing, empty, np.ones(2, dtype=bool))
        memory.take(pose(number), np.ones(SHAPE), sky, lost)
    result = memory.take(pose(30), np.ones(SHAPE), sky, either_or(0.95, spots[:1]))
    assert not len(memory.ranges.points)
    assert result.estimate.depth_m[16, 16] == pytest.approx(16.0)


def test_the_last_map_decides_where_it_was_seen():
    """After a turn the spot looks where the last map had nothing."""
    spots = towards((32, 32))
    memory, turned = before_a_wall(spots), (0, 0.6, 0)
    between = flat_map(8.0, 0.4)
    memory.take(pose(20, turn_rad=turned), np.ones(SHAPE), between, either_or(0.5, spots))
    assert len(memory.ranges.points) == 1  # of the wall, but none where nothing was known


def test_a_jump_forgets_the_last_map_and_lost_spots():
    spots = towards((16, 16), (48, 48))
    memory = before_a_wall(spots)
    much_later = pose(5000)
    result = memory.take(much_later, np.ones(SHAPE), flat_map(8.0, 0.4), either_or(0.5, spots))
    assert result.begun_anew
    assert result.estimate.depth_m[16, 16] == pytest.approx(8.0)
