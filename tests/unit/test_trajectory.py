"""Flights: read from files, smooth in between, clear of what is there, and loaded again as text."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
import trimesh
from scipy.spatial.transform import Rotation

import spisim
from reconstruction import InputError
from spisim.scene import (
    Scene,
    Trajectory,
    at_drone_state,
    check_clear_path,
    draw_scene,
    load_trajectory,
    look_at,
    make_scene,
    scenes_folder,
)
from worlds import scene, surface

H = 1e-5
WAY_POINTS = """# a comment
t,x,y,z,look_x,look_y,look_z
10,0,0,1,5,0,1
11,1,0,1,6,0,1
12,2,0,1,7,0,1
"""


def written(folder: Path, text: str) -> Path:
    path = folder / "flight.csv"
    path.write_text(text)
    return path


def curved() -> Trajectory:
    """A path that turns about all axes."""
    rng = np.random.default_rng(5)
    turns = Rotation.from_rotvec(np.cumsum(rng.normal(0, 0.4, (5, 3)), axis=0))
    return Trajectory.through(np.array([3.0, 4, 4.5, 6, 7]), rng.normal(0, 3, (5, 3)), turns)


def test_way_points_are_passed_looking_where_they_say(tmp_path: Path) -> None:
    flight = load_trajectory(written(tmp_path, WAY_POINTS))
    assert flight.duration_s == 2
    for time_s, x in ((0, 0), (1, 1), (2, 2), (0.5, 0.5)):
        expected = look_at((x, 0, 1), (9, 0, 1), (0, 0, 1))
        assert flight.pose(time_s) == pytest.approx(expected, abs=1e-12)
    assert flight.velocity(0.7) == pytest.approx([1, 0, 0])
    assert flight.angular_velocity(0.7) == pytest.approx([0, 0, 0], abs=1e-12)


def test_velocities_are_those_of_the_poses() -> None:
    """Against central differences of position and orientation, in world axes."""
    flight = curved()
    for time_s in (0.3, 1.2, 2.9, 3.7):
        before, after = flight.pose(time_s - H), flight.pose(time_s + H)
        velocity = (after - before)[:3, 3] / (2 * H)
        turn = Rotation.from_matrix(after[:3, :3] @ before[:3, :3].T).as_rotvec() / (2 * H)
        assert flight.velocity(time_s) == pytest.approx(velocity, rel=1e-6)
        assert flight.angular_velocity(time_s) == pytest.approx(turn, rel=1e-5)
        assert np.linalg.norm(turn) > 0.1


def test_velocities_do_not_jump_at_the_given_poses() -> None:
    flight = curved()
    for time_s in flight.times_s[1:-1]:
        early, late = time_s - 1e-9, time_s + 1e-9
        assert flight.velocity(early) == pytest.approx(flight.velocity(late), abs=1e-6)
        turns = [flight.angular_velocity(when) for when in (early, late)]
        assert turns[0] == pytest.approx(turns[1], abs=1e-6)


def test_faster_is_the_same_path_in_less_time() -> None:
    flight = curved()
    fast = flight.faster(2)
    assert fast.duration_s == pytest.approx(flight.duration_s / 2)
    assert fast.pose(0.6) == pytest.approx(flight.pose(1.2), abs=1e-9)
    assert fast.velocity(0.6) == pytest.approx(2 * flight.velocity(1.2))
    assert fast.angular_velocity(0.6) == pytest.approx(2 * flight.angular_velocity(1.2))


def test_csv_and_tum_say_the_same(tmp_path: Path) -> None:
    turn = Rotation.from_euler("z", 90, degrees=True).as_quat()
    numbers = [[t, 0, t, 1, *turn] for t in (0.0, 0.5, 1.0)]
    csv, tum = tmp_path / "a.csv", tmp_path / "a.txt"
    csv.write_text(
        "t, x, y, z, qx, qy, qz, qw\n" + "\n".join(",".join(map(str, r)) for r in numbers)
    )
    tum.write_text("# time x y z q\n" + "\n".join(" ".join(map(str, r)) for r in numbers) + "\n\n")
    one, other = load_trajectory(csv), load_trajectory(tum)
    assert np.array_equal(one.pose(0.3), other.pose(0.3))
    # The body's x axis, forward, is turned to the world's y.
    assert one.pose(0.3) == pytest.approx(look_at((0, 0.3, 1), (0, 9, 1), (0, 0, 1)), abs=1e-12)


def test_a_file_states_the_weather_of_its_flight(tmp_path: Path) -> None:
    assert load_trajectory(written(tmp_path, WAY_POINTS)).weather is None
    flight = load_trajectory(written(tmp_path, "#  Weather: 50\n" + WAY_POINTS))
    assert flight.faster(2).weather == "50"
    twice = WAY_POINTS + "# weather: fog\n# weather: clear\n"
    with pytest.raises(InputError, match=r"line 7: .* stated differently: 'fog' and 'clear'"):
        load_trajectory(written(tmp_path, twice))
    with pytest.raises(InputError, match=r"line 6: weather is 'foggy'; allowed: .*clear, fog"):
        load_trajectory(written(tmp_path, WAY_POINTS + "# weather: foggy\n"))


def test_quaternions_of_the_optical_frame(tmp_path: Path) -> None:
    pose = look_at((0, 0, 1), (3, 2, 0.5), (0, 0, 1))
    quaternion = Rotation.from_matrix(pose[:3, :3]).as_quat()
    rows = [" ".join(map(repr, [float(t), 0.0, 0.0, 1.0, *quaternion.tolist()])) for t in (0, 1)]
    flight = load_trajectory(written(tmp_path, "\n".join(rows)), "optical")
    assert flight.pose(0.5) == pytest.approx(pose, abs=1e-12)


@pytest.mark.parametrize(
    ("change", "message"),
    [
        (("12,2,", "11,2,"), r"line 5: time 11 should be later than the one before, 11"),
        (("12,2,", "9,2,"), r"line 5: time 9 should be later"),
        (("11,1,0", "11,1,nan"), r"line 4: y should be finite; found 'nan'"),
        (("11,1,0", "11,1,left"), r"line 4: y should be a number; found 'left'"),
        (("11,1,0", "11,1"), r"line 4: 6 columns; expected 7"),
        (("7,0,1", "2,0,1"), r"line 5: look_x look_y look_z should be a point that is neither"),
        (("7,0,1", "2,0,0"), r"line 5: .*straight above or below"),
        (("look_z", "look_q"), r"line 2: the header should be t,x,y,z,qx.* or t,x,y,z,look_x"),
        (("11,1,0,1,6,0,1\n12,2,0,1,7,0,1\n", ""), r"needs 2 poses or more, not 1"),
        ((WAY_POINTS, "# nothing\n"), r"the file is empty"),
        ((WAY_POINTS, "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 0\n"), r"line 2: .*length 1, not 0"),
        ((WAY_POINTS, "0 0 0 0 0 0 0 1\n1 0 0 0 0 0 0 1.1\n"), r"line 2: .*length 1, not 1\.1"),
        ((WAY_POINTS, "0 0 0 0 0 0 1\n"), r"line 1: 7 columns; expected 8"),
    ],
)
def test_mistakes_in_files(tmp_path: Path, change: tuple[str, str], message: str) -> None:
    assert change[0] in WAY_POINTS
    with pytest.raises(InputError, match=rf"flight\.csv.*{message}"):
        load_trajectory(written(tmp_path, WAY_POINTS.replace(*change)))


def test_files_that_are_none(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"none\.csv: no such file"):
        load_trajectory(tmp_path / "none.csv")
    (tmp_path / "picture.csv").write_bytes(b"\xff\xd8\xff\xe0")
    with pytest.raises(InputError, match="not a text file"):
        load_trajectory(tmp_path / "picture.csv")
    with pytest.raises(InputError, match="unknown frame 'bodi': did you mean 'body'"):
        load_trajectory(written(tmp_path, WAY_POINTS), "bodi")


@pytest.mark.parametrize("time_s", [-0.1, 4.1, np.nan])
def test_times_outside_of_the_flight(time_s: float) -> None:
    flight = curved()
    for question in (flight.pose, flight.velocity, flight.angular_velocity, flight.drone_state):
        with pytest.raises(InputError, match="outside of the flight, 0 to 4 s"):
            question(time_s)


# Moments


def same(one: Scene, other: Scene) -> bool:
    return (
        np.array_equal(one.drone_pose, other.drone_pose)
        and one.drone_velocity_m_s == other.drone_velocity_m_s
        and one.drone_angular_velocity_rad_s == other.drone_angular_velocity_rad_s
        and all(
            np.array_equal(a.mesh.triangles, b.mesh.triangles)
            for a, b in zip(one.objects, other.objects, strict=True)
        )
    )


def test_the_drone_of_a_moment_is_that_of_the_flight() -> None:
    flight = curved()
    position = at_drone_state(spisim.load_scene("warehouse"), flight.drone_state(1.7))
    assert position.drone_pose == pytest.approx(flight.pose(1.7), abs=1e-9)
    assert position.drone_velocity_m_s == pytest.approx(flight.velocity(1.7))
    assert position.drone_angular_velocity_rad_s == pytest.approx(flight.angular_velocity(1.7))
    assert position.drone_moves


def test_the_text_of_a_moment_makes_the_same_scene() -> None:
    text = (
        "name: x\ndrone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1]}\nobjects:\n"
        "  - {name: fan, shape: box, size_m: [1, 2, 3], material: brick, translate_m: [4, 9, 0],\n"
        "     velocity_m_s: [0, 1, 0], angular_velocity_deg_s: [0, 0, 90]}\n"
    )
    moment = load_trajectory(scenes_folder() / "warehouse-flight.csv").drone_state(2.3)
    position = make_scene(text, Path(), "x")
    moved = at_drone_state(position, moment)
    again = make_scene(moved.text, Path(), "x")
    assert same(moved, again)
    assert again.text == moved.text
    fan = position.objects[0]
    assert np.array_equal(moved.objects[0].mesh.vertices, fan.at(2.3).mesh.vertices)
    assert not np.array_equal(moved.objects[0].mesh.vertices, fan.mesh.vertices)


def test_a_family_draws_the_same_world_for_every_moment() -> None:
    """Though a drone that flies there would make another draw necessary."""
    position = draw_scene("targets", 1)
    moment = curved().drone_state(0.4)
    moved = at_drone_state(position, moment.model_copy(update={"position_m": (-30.0, 0.0, 1.5)}))
    again = make_scene(moved.text, Path(), "drawn")
    assert same(moved, again)
    assert np.array_equal(position.objects[0].mesh.triangles, again.objects[0].mesh.triangles)


def test_a_moment_inside_an_object_is_refused() -> None:
    position = spisim.load_scene("warehouse")
    inside = curved().drone_state(0).model_copy(update={"position_m": (3.0, 0.47, 0.9)})
    moved = at_drone_state(position, inside.model_copy(update={"look_at_m": (9.0, 0.0, 0.9)}))
    with pytest.raises(InputError, match="inside object 'drum'"):
        make_scene(moved.text, scenes_folder(), "moved")
    with pytest.raises(InputError, match=r"moment\.time_s"):
        make_scene(moved.text.replace("time_s: 0.0", "time_s: -1.0"), scenes_folder(), "moved")


# Paths through things


def block(velocity: tuple[float, float, float] = (0, 0, 0)) -> Scene:
    mesh = trimesh.creation.box((1, 1, 1)).apply_translation((5, 0, 1))
    return scene(replace(surface("block", mesh, 0.5), velocity_m_s=velocity))


def straight(y: float, speed: float = 2.0) -> Trajectory:
    """Along x at 1 m height, for 4 s."""
    points = np.array([[0, y, 1], [4 * speed, y, 1]], dtype=float)
    return Trajectory.through(np.array([0.0, 4.0]), points, Rotation.identity(2))


def test_a_path_through_an_object_is_refused_with_name_and_time() -> None:
    with pytest.raises(InputError, match=r"leads through object 'block' at 2\.25 s"):
        check_clear_path(block(), straight(0.1))
    check_clear_path(block(), straight(0.6))


def test_a_path_is_clear_of_an_object_that_has_gone_and_not_of_one_that_comes() -> None:
    check_clear_path(block((0, 1, 0)), straight(0.1))
    with pytest.raises(InputError, match="leads through object 'block'"):
        check_clear_path(block((0, 1, 0)), straight(2.4))


def test_a_curve_that_bulges_into_an_object_is_found() -> None:
    """The straight line between the poses would pass beside it."""
    points = np.array([[0, 0, 1], [2.5, 1.4, 1], [7.5, 1.4, 1], [10, 0, 1]], dtype=float)
    flight = Trajectory.through(np.arange(4.0), points, Rotation.identity(4))
    mesh = trimesh.creation.box((0.4, 0.1, 0.4)).apply_translation((5, 1.6, 1))
    assert flight.pose(1.5)[1, 3] > 1.55 > points[:, 1].max()
    with pytest.raises(InputError, match="leads through object 'lamp' at 1"):
        check_clear_path(scene(surface("lamp", mesh, 0.5)), flight)


def test_a_flight_that_begins_inside_an_object() -> None:
    mesh = trimesh.creation.box((30, 30, 30))
    with pytest.raises(InputError, match="begins inside object 'block'"):
        check_clear_path(scene(surface("block", mesh, 0.5)), straight(0))
    mesh.invert()  # a room
    check_clear_path(scene(surface("room", mesh, 0.5)), straight(0))


def test_the_shipped_flight_is_gentle_and_clear() -> None:
    flight = load_trajectory(scenes_folder() / "warehouse-flight.csv")
    check_clear_path(spisim.load_scene("warehouse"), flight)
    speeds = [np.linalg.norm(flight.velocity(t)) for t in np.linspace(0, flight.duration_s, 50)]
    assert max(speeds) < 1.0
