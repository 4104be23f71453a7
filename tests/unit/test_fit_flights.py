"""Fits to flights: frames as recordings of a drone at rest in the poses that they state."""

from dataclasses import replace
from functools import cache
from pathlib import Path

import numpy as np
import pytest
import yaml

import spisim
from reconstruction import Capture, InputError
from reconstruction.capture import Poses
from reconstruction.capture.schema import joined
from spisim.base.config import dump_yaml, parse_model
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.scene.load import make_scene
from spisim.simulation.flight.motion import scene_at
from spisim.simulation.light import solve
from spisim_inverse.fit.fitting import fit
from spisim_inverse.fit.flight import frames_of
from spisim_inverse.fit.pose import PoseErrors
from spisim_inverse.fit.readings import Readings
from spisim_inverse.fit.result import Fitted
from spisim_inverse.fit.twin import Twin

VISIBILITY, BOARD = "scene.fog.visibility_m", "materials.board"
TRUE_M, REFLECTANCE = 60.0, 0.4
DISTANCES_M = 2.0, 3.0, 4.5, 6.0
"""Of the frames from the board."""


@cache
def instrument() -> Instrument:
    fields = yaml.safe_load(spisim.load_instrument("paper").text)
    fields["projector"]["shape"] = [8, 8]
    fields["plan"] = {"patterns": 15, "order": "sequency-2d", "polarity": "single-ended"}
    fields.pop("eye_safety")
    return parse_model(dump_yaml(fields), Instrument, "instrument")


@cache
def board(visibility_m: float = TRUE_M) -> Scene:
    """A board across the way, 8 m from where the drone looks at it."""
    fields = {
        "name": "board",
        "drone": {"position_m": [0, 0, 0], "look_at_m": [0, 1, 0]},
        "objects": [{
            "name": "board", "shape": "box", "size_m": [8, 0.02, 8], "translate_m": [0, 8, 0],
            "material": "board",
        }],
        "materials": {"board": {"reflectance": REFLECTANCE, "source": "test"}},
        "fog": {"visibility_m": visibility_m},
    }  # fmt: skip
    return make_scene(dump_yaml(fields), Path(), "board")


def pose(distance_m: float) -> np.ndarray:
    own = board().drone_pose.copy()
    own[1, 3] = 8 - 0.01 - distance_m
    return own


@cache
def flight(off_m: float = 0.0, sigma_m: float = 0.0) -> Capture:
    """Frames at `DISTANCES_M` from the board, whose poses are `off_m` too far back and ahead."""
    shots = [
        spisim.simulate(
            scene_at(board(), 0.0, pose(each)), instrument(), spp=256, seed=number
        ).capture
        for number, each in enumerate(DISTANCES_M)
    ]
    signs = np.array([1, -1, 1, -1])
    stated = [pose(each + sign * off_m) for each, sign in zip(DISTANCES_M, signs, strict=True)]
    axes = board().drone_pose[:3, :3]
    assert np.allclose(axes, [[1, 0, 0], [0, 0, 1], [0, -1, 0]])
    covariance = np.zeros((4, 6, 6))
    covariance[:, range(3), range(3)] = sigma_m**2
    poses = Poses(
        0.1 * np.arange(4.0),
        np.array([each[:3, 3] for each in stated]),
        np.tile([-np.sqrt(0.5), 0, 0, np.sqrt(0.5)], (4, 1)),
        covariance,
    )
    return replace(
        shots[0], buckets=joined([each.buckets for each in shots]),
        spots=joined([each.spots for each in shots]), truth=None, poses=poses,
    )  # fmt: skip


def fitted(capture: Capture, scene: Scene | None = None, **options) -> Fitted:
    scene = board(180.0) if scene is None else scene
    return fit(capture, scene, instrument(), {VISIBILITY: None, BOARD: 0.15}, spp=16, **options)


def z(result: Fitted) -> np.ndarray:
    off = result.coordinates - np.log([TRUE_M, REFLECTANCE])
    return off / np.sqrt(np.diag(result.covariance))


def test_a_flight_separates_fog_from_reflectance():
    """By distance they part: errors fall by more than those of two frames of one place."""
    result = fitted(flight(), frames=2)
    assert result.fits
    assert np.abs(z(result)).max() < 4
    one = fitted(flight(), frames=1)
    sigmas = np.sqrt([np.diag(each.covariance) for each in (result, one)])
    assert sigmas[0, 0] < 0.7 * sigmas[1, 0]


def test_frames_are_spread_over_those_with_a_pose():
    poses = flight().poses
    gap = replace(poses, position_m=poses.position_m.copy(), orientation=poses.orientation.copy())
    gap.position_m[1] = gap.orientation[1] = np.nan
    numbers = [each.number for each in frames_of(replace(flight(), poses=gap), board(), 2)]
    assert numbers == [0, 3]
    numbers = [each.number for each in frames_of(replace(flight(), poses=gap), board(), 9)]
    assert numbers == [0, 2, 3]


def test_each_frame_is_seen_from_its_pose():
    frames = frames_of(flight(), board())
    for each, distance_m in zip(frames, DISTANCES_M, strict=True):
        np.testing.assert_allclose(each.scene.drone_pose, pose(distance_m), atol=1e-12)
        assert each.capture.poses is None
        assert each.capture.frames == 1
        assert each.pose_sigma == (0.0, 0.0)


def test_readings_change_with_the_distance_of_a_board_as_its_light_does():
    """As 1 / z² in air that is nearly clear: forwards by s it gains 2 s / z."""
    (frame, *_) = frames_of(flight(0.0, 0.04), board(5e4))
    twin = Twin.of(frame.scene, instrument(), frame.capture)
    readings = Readings.of(frame.capture)
    columns = PoseErrors(frame.pose_sigma, 0)(readings, twin, np.zeros(2), 16)
    light = solve(frame.scene, instrument(), spp=64, seed=1)
    signal = (
        readings.expected(twin, light).counts
        - readings.expected(twin, replace(light, image=0 * light.image)).counts
    )
    bright, z_m = signal[: readings.patterns], DISTANCES_M[0]
    gain = columns[: readings.patterns, 0].sum() / bright.sum()
    assert gain == pytest.approx(2 * 0.04 / z_m, rel=0.02)
    assert columns.shape == (readings.mean.size, 6)
    still = PoseErrors((0.0, 0.0), 0)(readings, twin, np.zeros(2), 16)
    assert still.shape == (readings.mean.size, 0)


@pytest.mark.slow
def test_errors_of_poses_count_as_noise():
    """Poses 4 cm off, alternately: their stated errors let the model fit, with larger sigmas."""
    exact, sure, unsure = (fitted(flight(*each)) for each in ((), (0.04, 0.0), (0.04, 0.04)))
    assert not sure.fits
    assert unsure.fits
    assert np.abs(z(unsure)).max() < 4
    assert np.diag(unsure.bound) == pytest.approx(np.diag(exact.bound), rel=0.2)
    assert unsure.covariance[1, 1] > 2 * exact.covariance[1, 1]


def test_without_any_pose_nothing_is_fitted():
    capture = replace(flight(), poses=Poses.none(4))
    with pytest.raises(InputError, match="no frame has one"):
        fitted(capture)


def test_a_scene_that_moves_cannot_be_fitted():
    thing = replace(board().objects[0], velocity_m_s=(0.0, 1.0, 0.0))
    with pytest.raises(InputError, match="drone alone does"):
        fitted(flight(), replace(board(), objects=(thing,)))
