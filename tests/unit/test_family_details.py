"""What families are put together from: ropes, nets, stones, people; and the scenes shipped."""

import warnings

import numpy as np
import pytest
import yaml

from spisim.scene import Scene, draw_scene, list_scenes, load_scene, scenes_folder
from spisim.scene.families import FAMILIES, SceneBuilder
from spisim.scene.layout import OFFERED, layout_problem
from spisim.scene.soundness import fault
from spisim_worlds.parts import figure
from spisim_worlds.parts.backdrops import outdoors
from spisim_worlds.parts.figure import Arm, Leg, Side
from spisim_worlds.parts.natural import blob, clipped_bush, scattered_rocks
from spisim_worlds.parts.ropes import hanging, lying, net
from spisim_worlds.parts.shapes import alike, block, grid_mesh, loft
from spisim_worlds.person import STANCES


def test_a_hanging_rope_is_a_parabola_between_its_ends() -> None:
    path = hanging((0, 0, 2), (4, 2, 3), sag=0.3, points=9)
    np.testing.assert_allclose(path[[0, -1]], [(0, 0, 2), (4, 2, 3)])
    np.testing.assert_allclose(path[4], (2, 1, 2.5 - 0.3))
    # A parabola: the same curvature everywhere.
    np.testing.assert_allclose(np.diff(path[:, 2], 2), 8 * 0.3 / 8**2, rtol=1e-9)


def test_a_lying_cable_starts_and_ends_where_told_at_one_height() -> None:
    corners = [(0, 0), (1, 2), (3, 2), (4, 0)]
    path = lying(corners, 0.1, 0.01, np.random.default_rng(1))
    np.testing.assert_allclose(path[[0, -1], :2], [(0, 0), (4, 0)], atol=1e-12)
    assert (path[:, 2] == 0.01).all()


def test_a_net_has_cords_as_thick_as_told_and_one_mesh_apart() -> None:
    flat = net([(0, 0, 0), (0, 0, 1), (0, 2, 1), (0, 2, 0)], 0.1, 0.004, sag=0.0)
    cords = flat.split()
    assert len(cords) == 11 + 21
    assert all(cord.is_watertight for cord in cords)
    np.testing.assert_allclose(flat.bounds[:, 0], (-0.002, 0.002), atol=2e-4)
    level = sorted(cord.centroid[2] for cord in cords if np.ptp(cord.bounds[:, 1]) > 1)
    np.testing.assert_allclose(np.diff(level), 0.1)


def test_alike_solids_have_the_volume_of_all() -> None:
    one = block((1, 2, 3), (0, 0, 0))
    many = alike(one.vertices + np.array([(0, 0, 0), (5, 0, 0), (10, 0, 0)])[:, None], one.faces)
    assert many.is_watertight
    assert many.volume == pytest.approx(18)


def test_a_loft_through_squares_is_a_prism() -> None:
    square = np.array([(0, 0), (1, 0), (1, 1), (0, 1)], float)
    rings = np.stack([np.column_stack([square, np.full(4, z)]) for z in (0.0, 1.0, 2.5)])
    prism = loft(rings)
    assert prism.is_watertight
    assert prism.volume == pytest.approx(2.5)


def test_a_grid_becomes_a_sheet_of_its_size() -> None:
    x, y = np.meshgrid(np.linspace(0, 2, 4), np.linspace(0, 3, 5), indexing="ij")
    sheet = grid_mesh(np.stack([x, y, 0 * x], axis=-1))
    assert sheet.area == pytest.approx(6)
    np.testing.assert_allclose(sheet.face_normals, np.tile((0, 0, 1.0), (len(sheet.faces), 1)))


def test_stones_and_bushes_are_closed_and_face_out() -> None:
    rng = np.random.default_rng(2)
    stones = scattered_rocks(rng, np.zeros((4, 3)), np.full(4, 0.1))
    body, foliage = clipped_bush(rng, (1, 1, 2), 0.1, 50)
    assert all(fault(mesh) is None for mesh in (stones, blob(rng, (1, 2, 1), 0.2), body, foliage))
    assert 0.05 < np.ptp(stones.bounds, axis=0).max() < 0.2
    assert body.volume > 0


def test_daylight_comes_from_above_and_within_what_is_plausible() -> None:
    rng = np.random.default_rng(3)
    days = [outdoors(rng) for _ in range(40)]
    sunny = [day for day in days if "sun_klx" in day]
    assert 10 < len(sunny) < 30
    for day in sunny:
        assert np.linalg.norm(day["sun_direction"]) == pytest.approx(1)
        assert -np.sin(np.radians(60)) <= day["sun_direction"][2] <= -np.sin(np.radians(15))
    assert all(day["sky_klx"] <= 20 for day in days)


def lengths(side: Side, *joints: str) -> list[float]:
    points = np.array([getattr(side, joint) for joint in joints])
    return np.linalg.norm(np.diff(points, axis=0), axis=1).tolist()


def test_limbs_keep_their_lengths_in_every_posture() -> None:
    rng = np.random.default_rng(4)
    for side in (-1, 1):
        arm, leg = Arm(*rng.uniform(0, 90, 3)), Leg(*rng.uniform(0, 90, 3))
        joints = figure.posed(side, arm, leg)
        arms = [figure.UPPER_ARM_M, figure.FOREARM_M]
        assert lengths(joints, "shoulder", "elbow", "wrist") == pytest.approx(arms)
        legs = [figure.THIGH_M, figure.SHIN_M]
        assert lengths(joints, "hip", "knee", "ankle") == pytest.approx(legs)


def test_angles_of_limbs() -> None:
    up = figure.posed(1, Arm(180), Leg())
    assert up.fingers == pytest.approx([0, 0.2, 1.4 + 0.28 + 0.24 + 0.09])
    sideways = figure.posed(-1, Arm(90), Leg())
    assert sideways.wrist == pytest.approx([0, -0.2 - 0.52, 1.4])
    ahead = figure.posed(1, Arm(90, 90), Leg(90, 0, 0))
    assert ahead.wrist == pytest.approx([-0.52, 0.2, 1.4])
    assert ahead.ankle == pytest.approx([-0.78, 0.09, 0.86])
    bent = figure.posed(1, Arm(0), Leg(0, 90, 0))
    assert bent.ankle == pytest.approx([0.4, 0.09, 0.48])


@pytest.mark.parametrize("stance", STANCES)
def test_people_stand_on_the_ground(stance: str) -> None:
    scene = draw_scene("person", 1, {"stance": stance, "person_m": 1.77})
    parts = {thing.name: thing.mesh.bounds for thing in scene.objects}
    assert parts["trousers"][0, 2] == pytest.approx(0, abs=1e-6)
    head = parts["skin"][1, 2] - parts["trousers"][0, 2]
    assert head > 1.0


@pytest.mark.parametrize(
    ("family", "parameters", "name", "across"),
    [
        ("hovering-drone", {"load": "parcel", "rope_mm": 4}, "rope", 0.004),
        ("reflective-shelf", {"wire_mm": 3}, "wire", 0.003),
        ("landing-pad", {"cable_mm": 10}, "cable", 0.010),
    ],
)
def test_thin_things_are_as_thin_as_told(
    family: str, parameters: dict, name: str, across: float
) -> None:
    scene = draw_scene(family, 6, parameters)
    mesh = next(thing.mesh for thing in scene.objects if thing.name == name)
    if name == "cable":  # lies on the ground, so that its height is its diameter there
        low = mesh.vertices[mesh.vertices[:, 2] < across + 1e-6]
        assert np.ptp(low[:, 2]) == pytest.approx(across, rel=1e-3)
    else:
        np.testing.assert_allclose(np.ptp(mesh.bounds, axis=0)[:2], across, rtol=1e-3)


def test_marker_has_a_dark_border_and_cells_inside() -> None:
    scene = draw_scene("landing-pad", 6, {"marker_cells": 4, "turn_deg": 0, "pad_m": 1.0})
    objects = {thing.name: thing.mesh for thing in scene.objects}
    cells = objects["dark cells of the marker"].split()
    assert 20 <= len(cells) < 36  # the border of 20, and some of the 16 inside
    cell = 0.36 / 8
    np.testing.assert_allclose([np.ptp(c.bounds, axis=0)[:2] for c in cells], cell)
    assert np.ptp(objects["marker"].bounds, axis=0)[0] == pytest.approx(0.36)


def test_steps_of_a_wedge_are_as_deep_as_told_about_its_distance() -> None:
    given = {"target": "step-wedge", "distance_m": 4, "steps": 5, "step_m": 0.2}
    scene = draw_scene("targets", 0, given)
    fronts = [t.mesh.bounds[0, 0] for t in scene.objects if t.name.startswith("step")]
    assert fronts == pytest.approx([3.6, 3.8, 4.0, 4.2, 4.4])


def test_a_builder_says_materials_only_if_it_has_some() -> None:
    builder = SceneBuilder(position_m=(0, 0, 1), look_at_m=(1, 0, 1))
    assert "materials" not in builder.sections()
    builder.materials["soot"] = {"reflectance": 0.03, "source": "made up"}
    assert builder.sections()["materials"] == builder.materials


def test_a_turning_rotor_lets_most_light_through() -> None:
    scene = draw_scene("hovering-drone", 2, {"rotors": "blurred"})
    rotors = next(thing for thing in scene.objects if thing.name == "rotors")
    assert rotors.material.opacity == pytest.approx(0.12)


@pytest.mark.parametrize("name", list_scenes())
def test_shipped_scenes_are_sound_and_to_fly_in(name: str) -> None:
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        scene = load_scene(name)
    assert scene.name == name
    assert layout_problem(scene, OFFERED) is None
    assert triangles(scene) < 60_000


def test_every_closed_family_is_in_the_library() -> None:
    names = list_scenes()
    files = [scenes_folder() / f"{name}.yaml" for name in names]
    displayed = {yaml.safe_load(file.read_text(encoding="utf-8")).get("family") for file in files}
    closed = {name for name, family in FAMILIES.items() if family.min_spots == 4}
    assert closed <= displayed | set(names)


def triangles(scene: Scene) -> int:
    return sum(len(thing.mesh.faces) for thing in scene.objects)


def test_draws_offer_a_surface_in_each_corner_of_the_view() -> None:
    x, y, _ = OFFERED.beams.T
    assert sorted(zip(np.sign(x), np.sign(y), strict=True)) == [(-1, -1), (-1, 1), (1, -1), (1, 1)]
    np.testing.assert_array_equal(np.sign(OFFERED.detectors_m[:, 0]), np.sign(x))
    np.testing.assert_array_equal(np.sign(OFFERED.detectors_m[:, 1]), np.sign(y))


def test_spokes_of_a_star_are_equally_far_apart() -> None:
    scene = draw_scene("targets", 7, {"target": "siemens-star", "spokes": 9, "setting": "alone"})
    (star,) = (each.mesh for each in scene.objects if each.name == "star")
    _, y, z = np.array(star.vertices - star.vertices.mean(axis=0)).T
    points = y + 1j * z
    turned = points * np.exp(2j * np.pi / 9)
    nearest = np.abs(turned[:, None] - points).min(axis=1)
    assert nearest.max() < 0.01 * np.abs(points).max()


@pytest.mark.parametrize(
    ("railing", "material"), [("parapet", "concrete"), ("bars", "steel-galvanised")]
)
def test_a_parapet_is_of_concrete_and_bars_of_steel(railing: str, material: str) -> None:
    scene = draw_scene("bridge", 3, {"railing": railing})
    (thing,) = (each for each in scene.objects if each.name == "railing")
    assert thing.material.name == material
