"""Derivatives of light by where the drone and objects are."""

from dataclasses import replace

import numpy as np
import pytest

import spisim
from reconstruction.base.errors import InputError
from spisim.simulation.light import Transport, solve
from spisim.simulation.light.displacement import DIRECTIONS, displacements

CLEAR = {"fog": None, "rain": None, "snow": None, "smoke": None}
DISTANCE_M = 4.0
SPP = 16


@pytest.fixture(scope="module")
def board():
    """A white board square before the drone."""
    scene = spisim.load_scene("target-plane", changes=CLEAR)
    instrument = spisim.load_instrument("paper")
    return scene, instrument, solve(scene, instrument, spp=SPP)


def relative(board, name: str, field: str = "image") -> tuple[float, float]:
    """Derivative of the logarithm of all light of a field, and its standard error."""
    scene, instrument, light = board
    (result,) = displacements(scene, instrument, [name], light, spp=SPP)
    value, error = result.of(light, field)
    total = np.sum(getattr(light, field))
    return np.sum(value) / total, np.linalg.norm(error) / total


@pytest.mark.parametrize(("name", "sign"), [("drone.forward_m", 1), ("objects.board.x_m", -1)])
def test_light_of_a_board_falls_with_the_square_of_its_distance(board, name, sign):
    """∂ ln I / ∂ z = −2 / z, up to (step / z)² and the instrument's baselines."""
    slope, error = relative(board, name)
    assert slope == pytest.approx(sign * 2 / DISTANCE_M, rel=2e-3)
    assert error < 1e-3


def test_echoes_move_by_twice_the_way(board):
    """The mean path length of the spots' light changes by −2 m per metre forwards."""
    scene, instrument, light = board
    (result,) = displacements(scene, instrument, ["drone.forward_m"], light, spp=SPP)
    value, _ = result.of(light, "spot_histogram")
    histogram, lengths_m = light.spot_histogram, light.path_length_m
    mean_m = histogram @ lengths_m / histogram.sum(axis=1)
    slope = (value @ lengths_m - mean_m * value.sum(axis=1)) / histogram.sum(axis=1)
    along = -2 / instrument.lasers.directions[:, 2]  # of slanted beams more
    assert slope == pytest.approx(along, rel=5e-3)


def test_a_board_across_does_not_say_where_the_drone_is_beside_it(board):
    slope, error = relative(board, "drone.left_m")
    assert abs(slope) < 1e-4 + 4 * error


def test_directions_are_those_of_an_optical_frame():
    """x right, y down, z forward: forward, left and up are an orthonormal, right-handed frame."""
    frame = np.stack([DIRECTIONS[name] for name in ("forward_m", "left_m", "up_m")])
    np.testing.assert_array_equal(frame @ frame.T, np.eye(3))
    np.testing.assert_array_equal(np.cross(frame[0], frame[1]), frame[2])
    assert frame[0, 2] == 1
    assert frame[1, 0] == -1


def test_random_numbers_are_common(board):
    """Differences of passes with other random numbers each are far noisier."""
    scene, instrument, light = board
    (result,) = displacements(scene, instrument, ["drone.yaw_deg"], light, spp=SPP)
    common = np.median(result.of(light)[1])
    passes = [solve(scene, instrument, spp=SPP // 4, seed=seed).image for seed in range(8)]
    apart = np.std(np.subtract(passes[::2], passes[1::2]) / 0.2, axis=0, ddof=1) / 2
    assert common < 0.2 * np.median(apart)


def test_far_surfaces_whose_bins_follow_them(board):
    """Ends of a step have other bins; their light keeps its mean path length."""
    scene, instrument, _ = board
    far = replace(scene, drone_pose=scene.drone_pose.copy())
    far.drone_pose[0, 3] -= 60.0
    light = solve(far, instrument, spp=4)
    (result,) = displacements(far, instrument, ["drone.forward_m"], light, spp=4)
    value, _ = result.of(light, "spot_histogram")
    assert value.shape == light.spot_histogram.shape


def test_unknown_coordinates_are_named(board):
    scene, instrument, light = board
    with pytest.raises(InputError, match=r"drone.forwards_m.*did you mean 'drone.forward_m'"):
        displacements(scene, instrument, ["drone.forwards_m"], light)


def test_equal_seeds_give_equal_derivatives(board):
    scene, instrument, light = board

    def once() -> Transport:
        (result,) = displacements(scene, instrument, ["drone.up_m"], light, spp=4, seed=5)
        return result.of(light)[0]

    np.testing.assert_array_equal(once(), once())
