"""Scene files become scenes in the right place."""

import numpy as np
import pytest
import trimesh
from numpy.typing import ArrayLike, NDArray

from reconstruction.base.errors import InputError
from scenefiles import MINIMAL, Load, with_objects
from spisim.scene import (
    Scene,
    daylight_spectrum,
    enclosing_object,
    in_band_irradiance,
    list_scenes,
    load_scene,
    look_at,
    pose_matrix,
)
from spisim.scene.rays import first_hits, winding_number


def ranges_along(scene: Scene, directions: ArrayLike) -> NDArray[np.float64]:
    """Distance (n,) from the drone along directions (n, 3) in its optical frame; inf for none."""
    rays = np.atleast_2d(np.asarray(directions, float))
    rays = rays / np.linalg.norm(rays, axis=1, keepdims=True) @ scene.drone_pose[:3, :3].T
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    return first_hits(scene.drone_pose[:3, 3], rays, triangles)


# What a scene says


def test_minimal_scene(load: Load) -> None:
    scene = load(MINIMAL)
    assert scene.name == "test"
    assert [item.name for item in scene.objects] == ["wall"]
    assert scene.objects[0].material.reflectance == 0.39
    assert scene.atmosphere.extinction_per_m == 0
    assert (scene.ambient.sun_klx, scene.ambient.sky_klx) == (0, 0)
    assert scene.text == MINIMAL


def test_optical_frame_is_right_down_forward(load: Load) -> None:
    pose = load(MINIMAL).drone_pose
    np.testing.assert_allclose(pose @ [0, 0, 2, 1], [2, 0, 1, 1], atol=1e-12)  # forward: +x
    np.testing.assert_allclose(pose @ [1, 0, 0, 1], [0, -1, 1, 1], atol=1e-12)  # right: -y
    np.testing.assert_allclose(pose @ [0, 1, 0, 1], [0, 0, 0, 1], atol=1e-12)  # down: -z


def test_look_at_is_a_rotation_whatever_the_length_of_up() -> None:
    pose = look_at((1, 2, 3), (-4, 5, 1), (0, 0, 1e-4))
    rotation = pose[:3, :3]
    np.testing.assert_allclose(rotation @ rotation.T, np.eye(3), atol=1e-12)
    assert np.linalg.det(rotation) == pytest.approx(1)
    assert rotation[2, 0] == pytest.approx(0)  # the horizon is level
    assert rotation[2, 1] < 0  # down is down


def test_rotation_is_roll_then_pitch_then_yaw_about_fixed_axes() -> None:
    x, y, z = np.eye(3)
    yaw_last = pose_matrix((90, 0, 90), (0, 0, 0))[:3, :3]
    np.testing.assert_allclose(yaw_last @ z, x, atol=1e-12)  # roll takes z to -y, yaw that to x
    np.testing.assert_allclose(yaw_last @ x, y, atol=1e-12)
    pitch = pose_matrix((0, 90, 0), (1, 2, 3))
    np.testing.assert_allclose(pitch @ [1, 0, 0, 1], [1, 2, 2, 1], atol=1e-12)


@pytest.mark.parametrize(
    ("item", "extents", "volume"),
    [
        ("shape: box, size_m: [1, 2, 3]", [1, 2, 3], 6),
        ("shape: sphere, radius_m: 0.5", [1, 1, 1], 4 / 3 * np.pi * 0.125),
        ("shape: cylinder, radius_m: 0.5, height_m: 2", [1, 1, 2], np.pi * 0.5),
        ("mesh: solid.ply", [2, 2, 2], 8),
        ("mesh: solid.ply, scale: 0.5", [1, 1, 1], 1),
    ],
)
def test_shapes_are_centred_where_they_are_put(
    load: Load, item: str, extents: list[float], volume: float
) -> None:
    text = with_objects(f"name: it, {item}, translate_m: [3, 4, 5], material: brick")
    mesh = load(text).objects[1].mesh
    np.testing.assert_allclose(mesh.bounds.mean(axis=0), [3, 4, 5], atol=1e-3)
    np.testing.assert_allclose(mesh.extents, extents, rtol=2e-3)
    assert mesh.volume == pytest.approx(volume, rel=4e-3)


def test_rectangle_faces_z_before_its_rotation(load: Load) -> None:
    wall = load(MINIMAL).objects[0].mesh
    np.testing.assert_allclose(wall.face_normals, [[-1, 0, 0]] * 2, atol=1e-12)
    assert wall.area == pytest.approx(16)


def test_instances_are_named_and_posed_after_the_object(load: Load) -> None:
    scene = load(
        with_objects(
            "name: post, shape: box, size_m: [1, 1, 1], translate_m: [1, 0, 0], material: brick,"
            " instances: [{translate_m: [0, 5, 0]}, {rotate_deg: [0, 0, 90]}]"
        )
    )
    assert [item.name for item in scene.objects] == ["wall", "post-1", "post-2"]
    np.testing.assert_allclose(scene.objects[1].mesh.center_mass, [1, 5, 0], atol=1e-9)
    np.testing.assert_allclose(scene.objects[2].mesh.center_mass, [0, 1, 0], atol=1e-9)


def test_own_materials_fog_and_daylight(load: Load) -> None:
    scene = load(
        MINIMAL.replace("material: concrete", "material: mine")
        + "materials: {mine: {reflectance: 0.33, source: measured}}\n"
        + "fog: {visibility_m: 100, kind: heavy-advection, definition: mor}\n"
        + "ambient: {sun_klx: 50, sun_direction: [0, 3, -4], sky_klx: 10}\n"
    )
    assert scene.objects[0].material.reflectance == 0.33
    assert scene.atmosphere.extinction_per_m == pytest.approx(0.029957 * 1.0293, rel=1e-4)
    assert scene.ambient.sun_direction == pytest.approx((0, 0.6, -0.8))


def test_fog_by_coefficients(load: Load) -> None:
    air = load(MINIMAL + "fog: {extinction_per_m: 0.2, albedo: 0.9, g: 0.8}\n").atmosphere
    assert (air.extinction_per_m, air.albedo, air.g) == (0.2, 0.9, 0.8)


def test_numbers_may_be_written_as_yaml_1_2_does(load: Load) -> None:
    assert load(MINIMAL + "ambient: {sky_klx: 1e1}\n").ambient.sky_klx == 10


def test_the_drone_is_offset_and_turned_as_it_stands(tmp_path):
    path = tmp_path / "turned.yaml"

    def pose(turn_deg):
        path.write_text(
            "name: turned\n"
            "drone: {position_m: [0, 0, 2], look_at_m: [0, 5, 2], offset_m: [1, 0.5, 0.25],\n"
            f"  turn_deg: {turn_deg}}}\n"
            "objects: [{name: wall, shape: rectangle, size_m: [9, 9], material: concrete}]\n"
        )
        return load_scene(path).drone_pose

    # Looking along +y, forward is +y and left is -x.
    np.testing.assert_allclose(pose([0, 0, 0])[:3, 3], [-0.5, 1, 2.25], atol=1e-12)
    np.testing.assert_allclose(pose([0, 90, 0])[:3, 2], [0, 0, -1], atol=1e-12)  # down
    np.testing.assert_allclose(pose([0, 0, 90])[:3, 2], [-1, 0, 0], atol=1e-12)  # left
    np.testing.assert_allclose(pose([90, 0, 0])[:3, 0], [0, 0, -1], atol=1e-12)  # right side down


# The shipped scene


def test_warehouse_spots_hit_four_ranges() -> None:
    assert "warehouse" in list_scenes()
    scene = load_scene("warehouse")
    angles = np.radians([[-5, 5], [5, 5], [-5, -5], [5, -5]])
    directions = [
        [np.cos(el) * np.sin(az), -np.sin(el), np.cos(el) * np.cos(az)] for az, el in angles
    ]
    ranges = ranges_along(scene, directions)
    np.testing.assert_allclose(ranges, [7.84, 5.01, 2.88, 4.02], atol=0.01)
    assert scene.atmosphere.visibility_m == 200


def test_warehouse_fills_the_field_and_is_lit_from_above() -> None:
    scene = load_scene("warehouse")
    grid = np.tan(np.radians(10)) * np.linspace(-1, 1, 8)
    field = [[x, y, 1] for x in grid for y in grid]
    assert (ranges_along(scene, field) < 10).all()
    upwards = scene.drone_pose[:3, :3].T @ [4, 0, 2]  # through the skylight
    assert np.isinf(ranges_along(scene, upwards)).all()


# Geometry


def test_ranges_to_a_wall(load: Load) -> None:
    scene = load(MINIMAL)
    np.testing.assert_allclose(
        ranges_along(scene, [[0, 0, 2], [0.3, 0, 1], [0, 0, -1], [0, 1, 0]]),
        [5, 5 * np.hypot(1, 0.3), np.inf, np.inf],
    )


def test_ranges_take_the_nearest_object_from_either_side(load: Load) -> None:
    scene = load(
        with_objects(
            "name: ball, shape: sphere, radius_m: 1, translate_m: [3, 0, 1], material: brick",
            "name: back, shape: rectangle, size_m: [9, 9], rotate_deg: [0, 90, 0],"
            " translate_m: [1.5, 0, 1], material: brick",
        )
    )
    assert ranges_along(scene, [0, 0, 1]) == pytest.approx(1.5)
    assert ranges_along(scene, [0, 0, -1]) == np.inf


def test_winding_number_of_closed_open_and_inverted_surfaces() -> None:
    ball = trimesh.creation.icosphere(2)
    assert winding_number((0.2, 0, 0), ball.triangles) == pytest.approx(1)
    assert winding_number((1.2, 0, 0), ball.triangles) == pytest.approx(0, abs=1e-9)
    assert winding_number((0.2, 0, 0), ball.triangles[:, ::-1]) == pytest.approx(-1)
    upper = ball.triangles[ball.triangles_center[:, 2] > 0]
    assert winding_number((0, 0, -0.5), upper) < 0.5 < winding_number((0, 0, 0.5), upper)


def test_drone_in_a_room_is_in_the_open(load: Load) -> None:
    scene = load(with_objects("name: room, mesh: room.ply, material: brick"))
    assert enclosing_object(scene, (0, 0, 1)) is None
    assert ranges_along(scene, [0, -1, 0]) == pytest.approx(9)


@pytest.mark.parametrize("mesh", ["solid.ply", "gappy.ply"])
def test_drone_inside_an_object(load: Load, mesh: str) -> None:
    with pytest.raises(InputError, match=r"drone\.position_m.*inside object 'rock'"):
        load(with_objects(f"name: rock, mesh: {mesh}, translate_m: [0.3, 0, 1], material: brick"))
    load(with_objects(f"name: rock, mesh: {mesh}, translate_m: [2, 0, 1], material: brick"))


# Daylight


def test_daylight_in_the_paper_s_band() -> None:
    assert in_band_irradiance(100, (1544, 1556)) == pytest.approx(2.967, abs=0.001)
    assert in_band_irradiance(109.5, (1544, 1556)) == pytest.approx(3.249, abs=0.001)


def test_daylight_is_weak_where_water_vapour_absorbs() -> None:
    """Rows of ASTM G173-03: 0.89372 W/m² per nm at 850 nm, next to nothing at 1380 nm."""
    wavelengths, irradiance, klx = daylight_spectrum()
    assert klx == 109.5
    assert dict(zip(wavelengths, irradiance, strict=True))[850] == 0.89372
    assert in_band_irradiance(100, (1370, 1390)) < 1e-3 * in_band_irradiance(100, (840, 860))


def test_daylight_adds_over_bands() -> None:
    parts = in_band_irradiance(10, (1544, 1547.3)) + in_band_irradiance(10, (1547.3, 1556))
    assert parts == pytest.approx(in_band_irradiance(10, (1544, 1556)))


@pytest.mark.parametrize("band", [(799, 856), (1544, 1601), (1556, 1544), (1550, 1550)])
def test_daylight_outside_its_table(band: tuple[float, float]) -> None:
    with pytest.raises(InputError, match="800 to 1600 nm"):
        in_band_irradiance(10, band)
