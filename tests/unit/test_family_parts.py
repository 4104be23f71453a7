"""What families are put together from: as thin, as slack and as closed as told."""

from pathlib import Path

import numpy as np
import pytest

from spisim.scene import draw_scene, make_scene
from spisim.scene.bsdf import ThinPane
from spisim.scene.families import build
from spisim.scene.soundness import fault
from spisim_worlds.parts.placing import Ground, aside, rolling
from spisim_worlds.parts.plants import TWIG_RADIUS_M, grow, leaves, tree, wood
from spisim_worlds.parts.shapes import prism
from spisim_worlds.scaffold import TUBE_DIAMETER_M


@pytest.mark.parametrize("diameter_mm", [8.0, 30.0])
def test_conductors_are_as_thin_as_told(diameter_mm: float) -> None:
    mesh = build("power-line", 3, {"conductor_mm": diameter_mm}).meshes["conductors.ply"]
    # Volume over area of a long prism of six sides is √3/4 of its outer radius.
    radius_m = mesh.volume / mesh.area * 4 / np.sqrt(3)
    assert 2000 * radius_m == pytest.approx(diameter_mm, rel=5e-3)


@pytest.mark.parametrize(
    ("family", "parameter", "mesh", "sides"),
    [
        ("stairwell", "baluster_mm", "balusters", 6),
        ("street-canyon", "cable_mm", "cable", 6),
        ("warehouse", "cable_mm", "hanging-cable", 6),
        ("racing-gates", "bunting_mm", "cord", 6),
        ("racing-gates", "net_mm", "net", 4),
        ("power-line", "cable_mm", "service-cable", 6),
    ],
)
def test_thin_things_are_as_thin_as_told(
    family: str, parameter: str, mesh: str, sides: int
) -> None:
    given = {"shape": "two-flights"} if family == "stairwell" else {}
    thin = build(family, 1, {parameter: 5.0 if sides == 4 else 10.0, **given}).meshes[f"{mesh}.ply"]
    # As above, for any number of sides: cos(π/n)/2; ends and bends add a little area.
    radius_m = thin.volume / thin.area * 2 / np.cos(np.pi / sides)
    assert 2000 * radius_m == pytest.approx(5.0 if sides == 4 else 10.0, rel=0.015)


def test_branches_taper_from_what_is_told_to_twigs() -> None:
    limbs = grow(np.random.default_rng(1), (1, 2, 3), (1, 0, 0), 2.0, 0.01, 2, 4)
    assert len(limbs) == 1 + 4 + 16
    assert limbs[0].path[0].tolist() == [1, 2, 3]
    assert limbs[0].radii[0] == 0.01
    assert all(np.all(np.diff(limb.radii) <= 0) for limb in limbs)
    assert min(limb.radii.min() for limb in limbs) == pytest.approx(TWIG_RADIUS_M)
    steps = np.linalg.norm(np.diff(limbs[0].path, axis=0), axis=1)
    assert steps.sum() == pytest.approx(2.0)


def test_trees_are_closed_and_leaves_are_of_their_size() -> None:
    rng = np.random.default_rng(2)
    grown = tree(rng, 6.0, 0.15, 6, 1.0, 1.5)
    assert wood(grown).is_watertight
    foliage = leaves(rng, grown, 0.06, 5)
    lengths = np.linalg.norm(foliage.vertices[2::4] - foliage.vertices[::4], axis=1)
    assert 0.06 * 0.6 <= lengths.min() < lengths.max() <= 0.06 * 1.3
    assert foliage.area_faces.min() > 0


def test_things_stand_on_the_ground_that_is_drawn() -> None:
    ground = rolling(np.random.default_rng(3), 0.2, bank_start_m=8.0)
    mesh = ground.mesh((-2, 12), (-4, 4), 0.5)
    corner = mesh.vertices[37]
    assert ground.on(corner[0], corner[1]) == pytest.approx(tuple(corner))
    before = mesh.vertices[mesh.vertices[:, 0] < 8]
    assert np.abs(before[:, 2]).max() <= 0.2
    assert ground.on(corner[0], corner[1], 0.3)[2] == pytest.approx(corner[2] - 0.3)
    assert (mesh.face_normals[:, 2] > 0).all()


def test_a_bank_rises_by_its_slope_to_its_height() -> None:
    still = Ground(0.0, np.array([[1e-9, 0.0]]), np.array([np.pi / 2]), 8.0, 1.5, 5.0)
    assert still.height([7, 8, 10, 40], 0).tolist() == pytest.approx([0, 0, 3, 5], abs=1e-6)


def test_a_prism_is_closed_and_as_large_as_told() -> None:
    wedge = prism([(0, 0), (2, 0), (2, 1)], 0.5)
    assert wedge.is_watertight
    assert fault(wedge) is None
    assert wedge.volume == pytest.approx(0.5)
    assert wedge.bounds.tolist() == [[0, -0.25, 0], [2, 0.25, 1]]


def test_angles_are_seen_at_their_distance() -> None:
    assert aside(3.0, 45.0) == pytest.approx(3.0)
    assert aside(3.0, -10.0) == pytest.approx(-3 * np.tan(np.pi / 18))


def test_windows_are_thin_panes_of_glass() -> None:
    scene = draw_scene("street-canyon", 1, {"vehicle": "car"})
    panes = [t for t in scene.objects if t.name.startswith(("pane", "car windows"))]
    assert len(panes) > 10
    assert all(isinstance(pane.material.bsdf, ThinPane) for pane in panes)


def test_materials_of_the_file_join_those_drawn() -> None:
    text = """
family: street-canyon
seed: 1
parameters: {vehicle: none}
materials:
  chalk: {reflectance: 0.8, source: test}
objects:
  - {name: ball, shape: sphere, radius_m: 0.1, material: chalk, translate_m: [2, 2, 1.5]}
"""
    things = {thing.name: thing for thing in make_scene(text, Path(), "text").objects}
    assert things["ball"].material.reflectance == 0.8
    assert isinstance(things["pane-1"].material.bsdf, ThinPane)


@pytest.mark.parametrize("profile", ["round", "horseshoe"])
def test_a_niche_opens_the_lining_and_is_as_deep_as_told(profile: str) -> None:
    given = {"profile": profile, "radius_m": 1.8}
    plain = build("tunnel", 2, {**given, "niches": 0}).meshes["lining.ply"]
    niched = build("tunnel", 2, {**given, "niches": 1}).meshes["lining.ply"]
    assert niched.bounds[1, 1] - plain.bounds[1, 1] == pytest.approx(0.6)
    assert plain.bounds[1, 1] == pytest.approx(1.8, rel=0.005)


def test_stairs_end_on_the_landing() -> None:
    made = build("stairwell", 4, {"shape": "two-flights", "steps": 9, "rise_m": 0.18})
    things = {thing["name"]: thing for thing in made.objects}
    landing = things["landing"]
    top = landing["translate_m"][2] + landing["size_m"][2] / 2
    assert top == pytest.approx(10 * 0.18)
    # One more rise than steps: the last one is onto the landing.
    assert made.meshes["flight.ply"].bounds[1, 2] == pytest.approx(9 * 0.18)


@pytest.mark.parametrize("profile", ["round", "horseshoe"])
def test_niches_of_a_tunnel_have_a_floor(profile: str) -> None:
    lining = build("tunnel", 1, {"niches": 2, "profile": profile}).meshes["lining.ply"]
    deep = lining.bounds[1, 1]
    starts = np.unique(lining.vertices[lining.vertices[:, 1] == deep, 0])[::2]
    assert len(starts) == 2
    for start in starts:
        above = [(start + 0.6, deep - back, 0.5) for back in (0.1, 0.3, 0.55)]
        assert lining.ray.intersects_any(above, [(0, 0, -1)] * 3).all()


@pytest.mark.parametrize("seed", range(3))
def test_braces_end_at_standards_and_the_bracket_of_the_rope_lies_on_a_rail(seed: int) -> None:
    drawn = build("scaffold", seed, {"braces": 1.0})
    tubes, rope = drawn.meshes["tubes.ply"], drawn.meshes["rope.ply"]
    brace_x = -0.1 - TUBE_DIAMETER_M / 2
    braces = tubes.vertices[np.abs(tubes.vertices[:, 0] - brace_x) < 0.005]
    assert braces[:, 2].max() < tubes.bounds[1, 2]
    middle = rope.bounds.mean(axis=0)
    lowest = rope.bounds[1, 2] - TUBE_DIAMETER_M
    start, end = (0.05, middle[1], lowest + 0.01), (0.05, middle[1], lowest - 0.02)
    inside = tubes.ray.intersects_location([start], np.subtract([end], [start]))[0]
    assert np.abs(inside[:, 2] - lowest).min() < 0.005


#: How far the triangles of steep ground may be from its height.
CHORD_M = 0.05


@pytest.mark.parametrize(
    ("family", "seed"),
    [("power-line", 0), ("power-line", 30), ("forest-trail", 0), ("forest-trail", 31)],
)
def test_trunks_on_a_slope_are_in_the_ground_all_around(family: str, seed: int) -> None:
    scene = draw_scene(family, seed, {"behind": "slope"} if family == "power-line" else {})
    ground = next(thing.mesh for thing in scene.objects if thing.name == "ground")
    trees = [thing.mesh for thing in scene.objects if thing.name.startswith("tree ")]
    assert trees
    for tree_ in trees:
        foot = tree_.vertices[:12]  # the first ring of the trunk
        upwards = np.tile((0.0, 0.0, 1.0), (12, 1))
        assert ground.ray.intersects_any(foot - (0, 0, CHORD_M), upwards).all()


@pytest.mark.parametrize("seed", range(6))
def test_every_brick_of_a_pile_lies_on_another(seed: int) -> None:
    bricks = build("scaffold", seed, {}).meshes["stack-of-bricks.ply"]
    positions = np.array(bricks.vertices).reshape(-1, 8, 3).mean(axis=1)
    for y in np.unique(positions[:, 1].round(3)):
        heights = np.sort(positions[np.abs(positions[:, 1] - y) < 0.01, 2])
        np.testing.assert_allclose(np.diff(heights), 0.066, atol=1e-6)
