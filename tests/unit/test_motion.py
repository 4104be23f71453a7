"""Drone and objects move rigidly, and nothing may fly through the instrument unnoticed."""

from pathlib import Path

import numpy as np
import pytest
import trimesh

from reconstruction.base.errors import InputError
from spisim.atmosphere import CLEAR
from spisim.scene import (
    Ambient,
    Scene,
    SceneObject,
    check_clear_of_sensor,
    find_material,
    load_scene,
    look_at,
)

BRICK = find_material("brick")


def block(centre=(3.0, 0.0, 0.0), size=(1.0, 1.0, 1.0), **motion) -> SceneObject:
    mesh = trimesh.creation.box(size)
    mesh.apply_translation(centre)
    return SceneObject("block", mesh, BRICK, **motion)


def scene_of(*objects: SceneObject, **motion) -> Scene:
    pose = look_at((0, 0, 0), (1, 0, 0), (0, 0, 1))
    return Scene("test", objects, CLEAR, Ambient(), pose, **motion)


def test_a_scene_at_rest_is_its_own_future() -> None:
    scene = scene_of(block())
    assert not scene.moves
    assert scene.at(3.0) is scene


def test_what_does_not_move_is_kept_as_it_is() -> None:
    still, moving = block(), block(velocity_m_s=(0, 1, 0))
    following = scene_of(still, moving).at(0.5)
    assert following.objects[0] is still
    assert following.objects[1] is not moving
    np.testing.assert_allclose(following.objects[1].mesh.center_mass, [3, 0.5, 0], atol=1e-9)
    np.testing.assert_allclose(moving.mesh.center_mass, [3, 0, 0], atol=1e-9)


def test_object_turns_about_the_centre_of_its_bounds_while_it_moves() -> None:
    quarter = np.pi / 2
    thing = block((3, 1, 0), (2, 1, 1), velocity_m_s=(0, 0, 2), angular_velocity_rad_s=(0, 0, 1))
    following = thing.at(quarter)
    np.testing.assert_allclose(following.mesh.extents, [1, 2, 1], atol=1e-9)
    np.testing.assert_allclose(following.mesh.bounds.mean(axis=0), [3, 1, 2 * quarter], atol=1e-9)


def test_turning_is_right_handed_about_world_axes() -> None:
    thing = block(angular_velocity_rad_s=(0, 0, 1))
    moved = thing.motion(np.pi / 2) @ [4, 0, 0, 1]  # the far side, seen from the drone
    np.testing.assert_allclose(moved, [3, 1, 0, 1], atol=1e-12)


def test_drone_moves_and_yaws_about_itself() -> None:
    scene = scene_of(
        block(),
        drone_velocity_m_s=(1, 2, 3),
        drone_angular_velocity_rad_s=(0, 0, np.pi / 2),
    )
    assert scene.moves
    pose = scene.at(1.0).drone_pose
    np.testing.assert_allclose(pose[:3, 3], [1, 2, 3], atol=1e-12)
    np.testing.assert_allclose(pose[:3, 2], [0, 1, 0], atol=1e-12)  # from +x to the left
    np.testing.assert_allclose(pose[:3, 1], [0, 0, -1], atol=1e-12)  # down stays down
    np.testing.assert_allclose(pose, scene.drone_pose_at(1.0))
    assert scene.at(1.0).objects == scene.objects


def test_constant_motion_adds_up() -> None:
    scene = scene_of(
        block(),
        drone_velocity_m_s=(1, 0, 2),
        drone_angular_velocity_rad_s=(0.3, -0.2, 0.5),
    )
    np.testing.assert_allclose(scene.at(0.7).at(0.4).drone_pose, scene.at(1.1).drone_pose)


# In scene files

TEXT = """
name: test
drone: {position_m: [0, 0, 1], look_at_m: [5, 0, 1], velocity_m_s: [2, 0, 0],
        angular_velocity_deg_s: [0, 0, 90]}
objects:
  - {name: post, shape: box, size_m: [1, 1, 1], material: brick, velocity_m_s: [0, 1, 0],
     angular_velocity_deg_s: [180, 0, 0],
     instances: [{translate_m: [3, 0, 0]}, {translate_m: [6, 0, 0], rotate_deg: [0, 0, 90]}]}
  - {name: wall, shape: rectangle, size_m: [4, 4], translate_m: [9, 0, 1], material: concrete}
"""


def test_scene_file_gives_velocities(tmp_path: Path) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(TEXT)
    scene = load_scene(path)
    assert scene.drone_velocity_m_s == (2, 0, 0)
    assert scene.drone_angular_velocity_rad_s == pytest.approx((0, 0, np.pi / 2))
    for post in scene.objects[:2]:
        assert post.velocity_m_s == (0, 1, 0)  # along the world's axes, however it is posed
        assert post.angular_velocity_rad_s == pytest.approx((np.pi, 0, 0))
    assert not scene.objects[2].moves
    assert not load_scene("warehouse").moves


@pytest.mark.parametrize("value", ["[1, 2]", "3", "[.nan, 0, 0]", "[yes, 0, 0]"])
def test_impossible_velocity(tmp_path: Path, value: str) -> None:
    path = tmp_path / "scene.yaml"
    path.write_text(TEXT.replace("velocity_m_s: [0, 1, 0]", f"velocity_m_s: {value}"))
    with pytest.raises(InputError, match=r"scene\.yaml: objects\[0\]\.velocity_m_s"):
        load_scene(path)
    path.write_text(TEXT.replace("velocity_m_s: [2, 0, 0]", "velocity_ms: [2, 0, 0]"))
    with pytest.raises(InputError, match=r"drone.*did you mean 'velocity_m_s'"):
        load_scene(path)


# Collisions


@pytest.mark.parametrize(
    ("thing", "drone"),
    [
        (block(velocity_m_s=(-5, 0, 0)), {}),
        (block(), {"drone_velocity_m_s": (5, 0, 0)}),
        (block(velocity_m_s=(-2, 1, 0)), {"drone_velocity_m_s": (3, 1, 0)}),
        (block(velocity_m_s=(-5, 0, 0)), {"drone_angular_velocity_rad_s": (0, 0, 3)}),
    ],
    ids=["object", "drone", "both", "drone turns"],
)
def test_collision_names_object_and_time(thing: SceneObject, drone: dict) -> None:
    scene = scene_of(block((0, 5, 0)), thing, **drone)
    with pytest.raises(InputError, match=r"'block' passes through the instrument 0\.5 s"):
        check_clear_of_sensor(scene, 1.0)
    check_clear_of_sensor(scene, 0.49)


def test_collision_with_a_turning_blade() -> None:
    """A blade along y, 2 m ahead, turns about z: its tip comes round to the drone's side."""
    blade = block((2, 0, 0), (0.02, 4.2, 0.5), angular_velocity_rad_s=(0, 0, 1))
    with pytest.raises(InputError, match=r"'block' passes through the instrument 1\.5\d* s"):
        check_clear_of_sensor(scene_of(blade), 2.0)
    check_clear_of_sensor(scene_of(blade), 1.5)
    short = block((2, 0, 0), (0.02, 3.9, 0.5), angular_velocity_rad_s=(0, 0, 1))
    check_clear_of_sensor(scene_of(short), 10.0)


def test_what_passes_by_or_flies_along_is_no_collision() -> None:
    check_clear_of_sensor(scene_of(block()), 10.0)
    check_clear_of_sensor(scene_of(block((3, 0.6, 0), velocity_m_s=(-5, 0, 0))), 10.0)
    check_clear_of_sensor(scene_of(block(velocity_m_s=(5, 0, 0))), 10.0)
    together = scene_of(block(velocity_m_s=(0.1, 0.7, 0.3)), drone_velocity_m_s=(0.1, 0.7, 0.3))
    check_clear_of_sensor(together, 10.0)


def test_nothing_is_too_fast_to_be_seen() -> None:
    bullet = block((300, 0, 0), (0.01, 0.01, 0.01), velocity_m_s=(-1000, 0, 0))
    with pytest.raises(InputError, match=r"0\.3 s"):
        check_clear_of_sensor(scene_of(bullet), 1.0)
