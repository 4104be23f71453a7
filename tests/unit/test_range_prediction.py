"""The next depths of a sensor's zones, and the flights of a nano-drone that judge them."""

import numpy as np
import pytest
from flight_measured import OPTICAL, ZONES, errors_of, measured_benchmark, nano_drone_checks
from range_prediction import RangePrediction
from scipy.spatial.transform import Rotation

from reconstruction.capture import Optics
from reconstruction.depth.pixels import pixel_rays

TAN = float(np.tan(np.radians(22.5)))
OPTICS, SHAPE = Optics(tan_half_width=TAN, tan_half_height=TAN), (ZONES, ZONES)
RAYS = pixel_rays(OPTICS, SHAPE).reshape(-1, 3)
HERE, AHEAD = np.zeros(3), np.eye(3)


def depths(normal, position_m, axes):
    """Depths (64,) of the plane normal · p = 1."""
    return (1 - normal @ position_m) / (RAYS @ axes.T @ normal)


def predicted(poses, measured):
    """Depths (frames, 64) predicted for each pose before those measured there are taken."""
    prediction, expected = RangePrediction(OPTICS, SHAPE), []
    for pose, depth_m in zip(poses, measured, strict=True):
        expected.append(prediction.at(*pose))
        prediction.take(depth_m)
    return np.array(expected)


@pytest.mark.parametrize("normal", [(0, 0, 0.25), (0.1, 0, 0.3), (0.1, 0.2, 0.25), (0, 2.0, 0)])
def test_planes_are_predicted_along_a_turning_flight(normal):
    frames = np.arange(40)
    turns = Rotation.from_rotvec(np.outer(0.005 * frames, [0, 1, 0])).as_matrix()
    poses = [(np.array([0, 0, 0.02 * each]), turns[each]) for each in frames]
    truth = np.array([depths(np.array(normal), *pose) for pose in poses])
    measured = np.where((truth > 0) & (truth < 10), truth, np.nan)
    error = np.abs(predicted(poses, measured) - measured)[20:]
    last = np.abs(np.diff(measured, axis=0))[19:]
    assert np.nanmedian(error) < 0.05 * np.nanmedian(last) + 1e-4


def test_noise_is_averaged_where_nothing_moves():
    """Innovations of a filter of gain g have the variance 2 / (2 - g), and those of none have 2."""
    noise = np.random.default_rng(3).standard_normal((400, 64))
    error = (predicted([(HERE, AHEAD)] * 400, 2 + 0.02 * noise) - 2 - 0.02 * noise)[50:]
    assert np.sqrt(2 / 1.5) - 0.02 < error.std() / 0.02 < 1.25


def test_a_depth_that_wanders_is_the_next_one():
    measured = 2 + 0.02 * np.random.default_rng(4).standard_normal((200, 64)).cumsum(axis=0)
    error = predicted([(HERE, AHEAD)] * 200, measured) - measured
    assert error[50:].std() < 1.1 * np.diff(measured, axis=0)[49:].std()


def test_another_surface_is_taken_at_once():
    measured = np.full((30, 64), 3.0)
    measured[20:, ::3] = 1.0
    np.testing.assert_allclose(predicted([(HERE, AHEAD)] * 30, measured)[21:], measured[21:])


def test_a_zone_without_a_depth_moves_on_and_one_without_any_has_none():
    poses = [(np.array([0, 0, 0.05 * frame]), AHEAD) for frame in range(25)]
    measured = np.array([np.full(64, 4 - pose[0][2]) for pose in poses])
    measured[20:, ::2] = np.nan
    measured[:, 5] = np.nan
    expected = predicted(poses, measured)
    assert np.isnan(expected[0]).all()
    assert np.isnan(expected[:, 5]).all()
    others = np.arange(64) != 5
    np.testing.assert_allclose(expected[-1, others], 4 - 0.05 * 24, rtol=2e-3)


def save_flight(folder, sigma_m):
    """A level flight at 0.45 m/s over a floor towards a wall; poses are late by random times."""
    rng = np.random.default_rng(7)
    zones, poses = [], ["name,timeStamp,posx,posy,posz,qw,qx,qy,qz"]
    for frame in range(80):
        time_ms = 30_000 + 66 * frame
        position_m = np.array([0.03 * frame, 0.0, 0.4])
        wall, floor = (depths(np.array(n), position_m - o, OPTICAL) for n, o in PLANES)
        depth_m = np.where((floor > 0) & (floor < wall), floor, wall)
        depth_m += sigma_m * rng.standard_normal(64)
        zones.append(f"{time_ms},0,0")
        zones += [f"{1e3 * each:.0f},1,5" for each in depth_m]
        x_m = position_m[0] + 0.2 * sigma_m * rng.standard_normal()
        poses.append(f"Drone,{time_ms},{x_m},0,0.4,1,0,0,0")
    folder.mkdir(parents=True)
    (folder / "state_ToF.csv").write_text("\n".join(zones), encoding="utf-8")
    (folder / "state_Vicon.csv").write_text("\n".join(poses), encoding="utf-8")


#: A wall at 4 m and the floor, as normals of n · (p - origin) = 1.
PLANES = (
    ((0.25, 0.0, 0.0), np.zeros(3)),
    ((0.0, 0.0, -1.0), np.array([0.0, 0.0, 1.0])),
)


def test_a_flight_is_predicted_better_than_by_either_reference(tmp_path):
    save_flight(tmp_path / "flight", sigma_m=0.01)
    checks = list(nano_drone_checks(tmp_path))
    assert len(checks) == 6
    assert all(check.holds for check in checks)
    tables, promised = measured_benchmark(tmp_path)
    assert [row[0] for row in tables[0].rows] == ["flight", "all"]
    assert [check.value for check in promised] == [check.value for check in checks]


def test_errors_of_references_are_those_of_the_geometry(tmp_path):
    save_flight(tmp_path / "flight", sigma_m=0.0)
    _, moved, last, speed = errors_of(tmp_path / "flight").reshape(4, -1, 64)
    np.testing.assert_allclose(speed, 0.03 / 0.066, rtol=1e-6)
    # A wall ahead is nearer by the step, and the floor at the same depth.
    np.testing.assert_allclose(last[:, :24], 0.03, atol=1.1e-3)
    np.testing.assert_allclose(last[:, -8:], 0.0, atol=1e-9)
    length = np.linalg.norm(RAYS, axis=1)[-8:]
    floor_m = 0.4 / RAYS[-1, 1]
    x = floor_m / length - 0.03
    side = np.sqrt(floor_m**2 - (floor_m / length) ** 2)
    np.testing.assert_allclose(moved[:, -8:] - np.abs(np.hypot(x, side) - floor_m), 0, atol=1.1e-3)


def test_without_recordings_there_is_nothing_to_check(tmp_path):
    assert list(nano_drone_checks(tmp_path)) == []
    assert measured_benchmark(tmp_path) == ([], [])
