"""Things that move: what is old must not hide them, nor stay when they have left."""

import numpy as np
import pytest

from flights import OPTICS, SHAPE, pose, ranges, towards
from reconstruction.depth import DepthEstimate
from reconstruction.depth.memory import FlightMemory, FrameRanges
from reconstruction.depth.memory.appearance import NOISE_FRAMES, Appearance, Appearances
from reconstruction.depth.memory.maps import MapMemory
from reconstruction.depth.memory.points import RangeMemory

WALL_M, THING_M, NOISE = 6.0, 3.0, 4.0
GRID = [(row, column) for row in range(10, 56, 4) for column in range(10, 56, 4)]
THING = np.s_[16:48, 20:40]
NONE = FrameRanges(towards((5, 5)), np.full(1, np.nan), np.full(1, np.nan))


def wall(seed=0):
    """A wall's noisy image."""
    return 100 + NOISE * np.random.default_rng(seed).standard_normal(SHAPE)


def with_thing(seed=0):
    """The wall with a thing before it, which is four times as bright."""
    image = wall(seed)
    image[THING] *= (WALL_M / THING_M) ** 2
    return image


def in_thing(seen):
    """How many points are inside the thing's outline."""
    row, column = seen.pixel.T
    return int(np.sum((row > 18) & (row < 46) & (column > 22) & (column < 38)))


def met(memory, number, depth_m, image, pixels=GRID):
    """Add ranges at some pixels."""
    spots = towards(*pixels)
    range_m = ranges(spots, np.broadcast_to(depth_m, len(pixels)))
    memory.add(pose(number), spots, range_m, np.full(len(pixels), 0.01), Appearance(image, NOISE))


def test_a_wall_is_not_seen_where_something_came_before_it_and_is_again_when_that_left():
    memory = RangeMemory(OPTICS, SHAPE)
    met(memory, 0, WALL_M, wall())
    covered = memory.seen(pose(1), Appearance(with_thing(1), NOISE))
    assert in_thing(covered) == 0
    outside = [p for p in GRID if not (14 <= p[0] <= 49 and 18 <= p[1] <= 41)]
    assert len(covered.index) >= len(outside)
    again = memory.seen(pose(2), Appearance(wall(2), NOISE))
    assert len(again.index) == len(GRID)


def test_what_has_left_is_gone_at_once_without_any_spot_there():
    memory = RangeMemory(OPTICS, SHAPE)
    inside = [p for p in GRID if 18 < p[0] < 46 and 22 < p[1] < 38]
    met(memory, 0, THING_M, with_thing(), inside)
    assert in_thing(memory.seen(pose(1), Appearance(with_thing(1), NOISE))) == len(inside)
    assert in_thing(memory.seen(pose(1), Appearance(wall(1), NOISE))) == 0


@pytest.mark.parametrize("lit_by", ["projector", "sun"])
@pytest.mark.parametrize("ahead_m", [0.0, 1.5, -1.5])
def test_a_still_world_loses_no_point_whatever_lights_it(lit_by, ahead_m):
    memory = RangeMemory(OPTICS, SHAPE)
    met(memory, 0, WALL_M, wall())
    factor = (WALL_M / (WALL_M - ahead_m)) ** 2 if lit_by == "projector" else 1.0
    at = pose(1, (0, 0, ahead_m))
    for seed in range(50):
        seen = memory.seen(at, Appearance(factor * wall(seed), NOISE))
        assert len(seen.index) == len(memory.seen(at).index) > 60


def test_an_edge_that_an_error_of_the_pose_moves_is_no_change():
    image = np.full(SHAPE, 100.0)
    image[:, 32:] = 25.0
    memory = RangeMemory(OPTICS, SHAPE)
    met(memory, 0, WALL_M, image, [(20, 31), (20, 32)])
    later = Appearance(np.roll(image, 1, axis=1), 0.0)
    assert len(memory.seen(pose(60), later).index) == 1
    memory.points.pose_variance_rad2[:] = (0.3 / 32) ** 2
    assert len(memory.seen(pose(60, variance_rad2=(0.3 / 32) ** 2), later).index) == 2


def test_points_without_an_image_are_seen():
    memory, spots = RangeMemory(OPTICS, SHAPE), towards(*GRID)
    memory.add(pose(0), spots, ranges(spots, WALL_M), np.full(len(GRID), 0.01))
    assert len(memory.seen(pose(1), Appearance(with_thing(), NOISE)).index) == len(GRID)


def test_noise_is_that_of_the_images_and_not_of_what_covers_the_view():
    images = Appearances()
    for seed in range(3 * NOISE_FRAMES):
        still = images.take(wall(seed))
    assert still.sigma == pytest.approx(2**0.5 * NOISE, rel=0.15)
    for seed in range(10):
        covered = images.take(4 * wall(seed))
    assert covered.sigma < 1.2 * still.sigma


def test_dark_noise_is_no_change():
    images, rng = Appearances(), np.random.default_rng(1)
    memory = RangeMemory(OPTICS, SHAPE)
    for number in range(2 * NOISE_FRAMES):
        dark = images.take(NOISE * rng.standard_normal(SHAPE))
        if number == NOISE_FRAMES:
            met(memory, 0, WALL_M, dark.image)
    assert len(memory.seen(pose(1), dark).index) > 0.97 * len(GRID)


def test_the_average_begins_anew_where_the_image_changed():
    maps, sigma = MapMemory(OPTICS, SHAPE), np.full(SHAPE, 0.3)
    maps.take(pose(0), np.full(SHAPE, np.log(WALL_M)), sigma, Appearance(wall(), NOISE))
    new = np.full(SHAPE, np.log(WALL_M))
    new[THING] = np.log(THING_M)  # within three sigma of what was there
    result = maps.take(pose(1), new, sigma, Appearance(with_thing(1), NOISE))
    np.testing.assert_allclose(result, new)


@pytest.mark.parametrize("image", [True, False], ids=["image changes", "image stays"])
def test_a_nearer_range_hides_the_wall_around_it_at_once(image):
    memory, spot = RangeMemory(OPTICS, SHAPE), [(32, 32)]
    met(memory, 0, WALL_M, wall())
    now = with_thing(1) if image else wall(1)
    met(memory, 1, THING_M, now, spot)
    seen = memory.seen(pose(1), Appearance(now, NOISE))
    near = np.hypot(*(seen.pixel - spot).T) < 4
    np.testing.assert_allclose(np.exp(seen.log_depth[near]), [THING_M])
    assert len(memory.points) == len(GRID) + 1  # the wall is still remembered


def test_a_thing_that_crosses_is_where_it_is_in_every_frame_and_nowhere_else():
    memory, rng, off = FlightMemory(OPTICS, SHAPE), np.random.default_rng(2), []
    for number in range(90):
        left = number - 20
        truth_m, image = np.full(SHAPE, WALL_M), wall(number)
        if left < 64:
            across = np.s_[:, max(left, 0) : max(left + 16, 0)]
            truth_m[across] = THING_M
            image[across] *= 4
        alone = DepthEstimate(truth_m, np.full(SHAPE, 0.3), np.full(SHAPE, 0.1))
        pixels = rng.integers(0, 64, (4, 2))
        spots, (row, column) = towards(*pixels), pixels.T
        given = FrameRanges(spots, ranges(spots, truth_m[row, column]), np.full(4, 0.02))
        result, *_ = memory.take(pose(number), image, alone, given)
        off.append(np.mean(np.abs(result.depth_m / truth_m - 1)))
    assert max(off) < 0.06
