"""What open worlds are made of: land to the horizon, bars, trees, houses, hulls, charts."""

import numpy as np
import pytest

from spisim.scene import Scene, draw_scene
from spisim.scene.families import FAMILIES, SceneBuilder
from spisim.scene.rays import first_hits
from spisim.scene.soundness import MAX_DISTANCE_M, fault
from spisim_worlds.parts.boats import hull
from spisim_worlds.parts.charts import CHARTS, chart
from spisim_worlds.parts.houses import house
from spisim_worlds.parts.lattice import TRIANGLE, boom
from spisim_worlds.parts.shapes import bars, block, spread
from spisim_worlds.parts.stairs import add_straight, add_winding
from spisim_worlds.parts.terrain import (
    HORIZON_M,
    add_shore,
    hills,
    patchwork,
    terrain,
    waves,
)
from spisim_worlds.parts.woods import TREES, in_view, tree_line

OPEN = sorted(name for name, family in FAMILIES.items() if family.min_spots < 4)
NEAR = ((-3.0, 20.0), (-8.0, 8.0))


def land(seed: int = 0):
    rng = np.random.default_rng(seed)
    rolling, far = waves(rng, (8, 40)), hills(rng, 300.0, 200.0)
    return terrain(lambda x, y: rolling(x, y) + far(x, y), NEAR, 1.0)


def ground_of(where, kinds=None, materials=("grass",)) -> SceneBuilder:
    builder = SceneBuilder((0, 0, 5), (1, 0, 5))
    where.add(builder, materials, kinds)
    return builder


def test_heights_are_those_of_the_mesh() -> None:
    where = land()
    (mesh,) = ground_of(where).meshes.values()
    rng = np.random.default_rng(1)
    x, y = rng.uniform(-30, 60, 40), rng.uniform(-40, 40, 40)
    down = np.tile((0.0, 0.0, -1.0), (40, 1))
    above = np.stack([x, y, np.full(40, 500.0)], axis=1)
    hits = [
        first_hits(eye, ray[None], mesh.triangles)[0] for eye, ray in zip(above, down, strict=True)
    ]
    np.testing.assert_allclose(where.height(x, y), 500 - np.array(hits), atol=1e-6)
    position = where.on(3.0, 2.0, 0.5)
    assert position == pytest.approx((3.0, 2.0, float(where.height(3.0, 2.0)) - 0.5))


def test_land_goes_to_the_horizon_and_no_farther_than_light_is_traced() -> None:
    where = land()
    for line in (where.x_m, where.y_m):
        assert (np.diff(line) > 0).all()
        assert -MAX_DISTANCE_M < line[0] < -0.9 * HORIZON_M
        assert 0.9 * HORIZON_M < line[-1] < MAX_DISTANCE_M
    near = np.diff(where.x_m[(where.x_m >= -3) & (where.x_m <= 20)])
    np.testing.assert_allclose(near, 1.0)


def test_hills_begin_where_told_and_flat_land_has_none() -> None:
    relief = hills(np.random.default_rng(2), 300.0, 200.0)
    angle = np.linspace(0, 2 * np.pi, 200)
    ring = np.stack([np.cos(angle), np.sin(angle)])
    assert (relief(*(299 * ring)) == 0).all()
    high = relief(*(5000 * ring))
    assert (high >= 0).all()
    assert 50 < high.max() < 400
    assert (hills(np.random.default_rng(2), 300.0, 0.0)(*(5000 * ring)) == 0).all()


def test_patches_share_out_all_of_the_land() -> None:
    where = land()
    kinds = patchwork(np.random.default_rng(3), where, 3, 5.0)
    builder = ground_of(where, kinds, ("grass", "gravel", "asphalt"))
    (whole,) = ground_of(where).meshes.values()
    parts = list(builder.meshes.values())
    assert len(parts) == 3
    assert sum(part.area for part in parts) == pytest.approx(whole.area)
    assert [thing["material"] for thing in builder.objects] == ["grass", "gravel", "asphalt"]


def test_water_is_level_and_all_that_lies_lower() -> None:
    where = land(4)
    builder = SceneBuilder((0, 0, 5), (1, 0, 5))
    kinds = np.zeros((len(where.x_m) - 1, len(where.y_m) - 1), int)
    flooded = add_shore(builder, where, 0.1, ["gravel"], kinds)
    material = {thing["material"]: builder.meshes[thing["mesh"]] for thing in builder.objects}
    np.testing.assert_allclose(material["water"].vertices[:, 2], 0.1)
    assert material["gravel"].vertices[:, 2].max() > 0.1
    assert float(flooded.z_m.min()) == 0.1


def test_a_road_lies_on_the_land() -> None:
    where = land(5)
    path = np.column_stack([np.linspace(2, 18, 60), np.linspace(-2, 3, 60)])
    road = where.draped(path, 3.0, 0.02)
    x, y, z = road.vertices.T
    np.testing.assert_allclose(z - where.height(x, y), 0.02, atol=1e-9)
    assert road.area > 3 * 16


def test_what_is_in_view_is_between_two_distances_and_beside_a_heading() -> None:
    positions = in_view(np.random.default_rng(6), land(), 200, 4.0, 40.0, 10.0, 30.0)
    distance = np.hypot(positions[:, 0], positions[:, 1])
    angle = np.degrees(np.arctan2(positions[:, 1], positions[:, 0]))
    assert ((distance >= 4) & (distance <= 40)).all()
    assert ((angle >= 20) & (angle <= 40)).all()


def test_copies_are_turned_scaled_and_put_where_told() -> None:
    one = block((2, 1, 1), (0, 0, 0))
    many = spread(one, [(0, 0, 0), (10, 0, 0)], [0, 90], [1, 2])
    assert many.is_watertight
    assert many.volume == pytest.approx(2 + 16)
    second = many.vertices[8:]
    np.testing.assert_allclose(np.ptp(second, axis=0), (2, 4, 2), atol=1e-9)
    np.testing.assert_allclose(second.mean(axis=0), (10, 0, 0), atol=1e-9)


@pytest.mark.parametrize("sections", [4, 6, 64])
def test_bars_are_closed_prisms_between_their_ends(sections: int) -> None:
    segments = [[(0, 0, 0), (0, 0, 3)], [(1, 1, 1), (4, 5, 1)]]
    result = bars(segments, 0.1, sections)
    across = 0.5 * sections * np.sin(2 * np.pi / sections) * 0.01
    assert fault(result) is None
    assert result.is_watertight
    assert result.volume == pytest.approx((3 + 5) * across)


def test_a_boom_reaches_from_end_to_end() -> None:
    mesh = boom((0, 0, 0), (0, 0, 10), (1.0, 0.25), 8, 0.05)
    assert fault(mesh) is None
    assert mesh.bounds[:, 2] == pytest.approx((0, 10), abs=0.1)
    low = mesh.vertices[mesh.vertices[:, 2] < 0.01]
    assert np.abs(low[:, :2]).max() == pytest.approx(1.0, abs=0.06)
    assert len(boom((0, 0, 0), (9, 0, 0), (1, 1), 8, 0.05, TRIANGLE).faces) < len(mesh.faces)


@pytest.mark.parametrize("kind", sorted(TREES))
def test_trees_are_one_metre_high_and_stand_on_the_ground(kind: str) -> None:
    grown = TREES[kind](np.random.default_rng(7), 400, 0.03, "leaves-green")
    whole = np.vstack([grown.wood.vertices, grown.foliage.vertices])
    assert -0.1 < whole[:, 2].min() < 0
    assert 0.85 < whole[:, 2].max() < 1.25
    assert np.hypot(whole[:, 0], whole[:, 1]).max() < 0.8


def test_the_edge_of_a_wood_follows_the_land() -> None:
    where = land(8)
    mesh = tree_line(np.random.default_rng(8), where, [(60, 50), (70, -50)], 15.0, 40.0)
    x, y, z = mesh.vertices.T
    above = z - where.height(x, y)
    assert 10 < above.max() < 20
    assert above.min() > -8


@pytest.mark.parametrize("pitch_deg", [0.0, 35.0])
def test_houses_are_closed(pitch_deg: float) -> None:
    made = house(10.0, 8.0, 5.5, pitch_deg)
    assert all(fault(mesh) is None for mesh in made)
    rise = 4 * np.tan(np.radians(pitch_deg))
    assert made.roof.bounds[1, 2] == pytest.approx(5.5 + rise + 0.22, abs=0.05)


def test_a_hull_floats_upright_and_closed() -> None:
    made = hull(40.0, 8.0, 4.0, 2.0)
    assert fault(made) is None
    assert made.volume > 0
    assert made.bounds[0, 2] == pytest.approx(-2.0)
    assert np.ptp(made.bounds[:, 1]) == pytest.approx(8.0, rel=0.02)


@pytest.mark.parametrize("kind", CHARTS)
def test_patterns_stay_on_their_boards(kind: str) -> None:
    board, pattern = chart(np.random.default_rng(9), kind, 0.6, 0.4)
    assert fault(board) is None
    assert (pattern.bounds[0, 1:] >= (-0.32, -0.22)).all()
    assert (pattern.bounds[1, 1:] <= (0.32, 0.22)).all()
    assert pattern.bounds[0, 0] < 0 <= board.bounds[0, 0]


@pytest.mark.parametrize("seed", range(4))
def test_steps_are_closed_and_the_drone_is_above_them(seed: int) -> None:
    for add, sizes in ((add_winding, ()), (add_straight, (0.28, 1.2))):
        builder = SceneBuilder((0, 0, 0), (1, 0, 0))
        eye, aim = add(builder, np.random.default_rng(seed), 0.17, *sizes, "concrete", "brick")
        steps = builder.meshes["steps.ply"]
        assert fault(steps) is None
        assert steps.volume > 0
        assert np.linalg.norm(aim - eye) > 0.5
        below = first_hits(eye, np.array([[0.0, 0, -1]]), steps.triangles)[0]
        assert 0.8 < below < 2.2


def fraction_of_sky(scene: Scene) -> float:
    angles = np.tan(np.radians(np.linspace(-9.5, 9.5, 12)))
    x, y = np.meshgrid(angles, angles)
    rays = np.stack([x.ravel(), y.ravel(), np.ones(x.size)], axis=1) @ scene.drone_pose[:3, :3].T
    triangles = np.concatenate([thing.mesh.triangles for thing in scene.objects])
    return float(np.isinf(first_hits(scene.drone_pose[:3, 3], rays, triangles)).mean())


@pytest.mark.slow
@pytest.mark.parametrize("family", ["bridge", "facade", "field", "forest-edge", "valley-line"])
def test_open_families_show_sky_in_some_views_and_none_in_others(family: str) -> None:
    fractions = [fraction_of_sky(draw_scene(family, seed)) for seed in range(10)]
    assert max(fractions) > 0.1
    assert min(fractions) < 0.05


def test_the_open_families_are_those_whose_spots_may_meet_nothing() -> None:
    new = {
        "forest-edge",
        "valley-line",
        "landing-approach",
        "facade",
        "bridge",
        "field",
        "shipyard",
    }
    assert new <= set(OPEN)
    assert {"power-line", "street-canyon"} <= set(OPEN)
    assert "warehouse" not in OPEN
