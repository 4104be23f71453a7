"""Where the details of drawn worlds are: on what they belong to, and no larger than it."""

import numpy as np
import pytest

from spisim.scene.families import SceneBuilder, build
from spisim_worlds import hovering_drone
from spisim_worlds.hovering_drone import Airframe
from spisim_worlds.parts import facade
from spisim_worlds.parts.boats import hull
from spisim_worlds.parts.facade import Front
from spisim_worlds.parts.stairs import RAILING_M, add_winding
from spisim_worlds.tunnel import _valve


@pytest.mark.parametrize("above_m", [-0.2, 0.2])
def test_the_other_drone_flies_as_much_higher_as_stated(above_m: float) -> None:
    drawn = build("hovering-drone", 1, {"above_m": above_m, "height_m": 2.0})
    (battery,) = (thing for thing in drawn.objects if thing["name"] == "battery")
    assert battery["translate_m"][2] == pytest.approx(2.0 + above_m)


@pytest.mark.parametrize("diagonal_m", [0.25, 0.75])
def test_antennas_are_as_large_as_the_body_that_carries_them(diagonal_m: float) -> None:
    size = Airframe(diagonal_m, 4)
    low, high = hovering_drone._antennas(size).bounds / size.hub
    assert (low > (-1.6, -0.6, 0.1)).all()
    assert (high < (-1.0, 0.6, 1.7)).all()


def test_spokes_of_a_valve_end_at_its_wheel() -> None:
    valve = _valve(0.05)
    wheel = valve.vertices[valve.vertices[:, 2] > 0.35]
    assert np.hypot(*wheel[:, :2].T).max() < 0.14 + 0.014 + 0.005


def test_panes_of_balconies_are_as_wide_and_as_deep_as_their_slabs() -> None:
    drawn = build("facade", 2, {"balconies": "glass"})
    slabs, panes = (drawn.meshes[f"{name}.ply"].bounds for name in ("balconies", "panels"))
    np.testing.assert_allclose(panes[0, :2], slabs[0, :2] + (0.04, 0.05), atol=1e-6)
    np.testing.assert_allclose(panes[1, :2], slabs[1, :2] - (0.04, 0), atol=1e-6)
    assert 0 < panes[1, 2] - slabs[1, 2] < 1.2


def test_rooms_reach_from_the_wall_of_a_facade_to_their_back_wall() -> None:
    rooms = facade._rooms(Front(1.0, 4, 2, 3.0, (1.2, 1.4), 0.9, ()))
    low, high = rooms.bounds
    assert low == pytest.approx((1.0 - 0.05, facade.WALL_M, -0.2))
    deep = facade.WALL_M + facade.ROOM_M + 0.1
    assert high == pytest.approx((13.0 + 0.05, deep, 2 * facade.STOREY_M))


@pytest.mark.parametrize("seed", range(4))
def test_rails_of_a_winding_stair_are_above_its_steps(seed: int) -> None:
    builder = SceneBuilder((0, 0, 0), (1, 0, 0))
    add_winding(builder, np.random.default_rng(seed), 0.17, "concrete", "brick")
    steps, rail = builder.meshes["steps.ply"], builder.meshes["rail-on-the-wall.ply"]
    above = rail.bounds[:, 2] - (0.17, steps.bounds[1, 2])
    assert above == pytest.approx((RAILING_M, RAILING_M), abs=0.03)


def test_a_bow_rakes_forward_from_its_foot_to_its_deck() -> None:
    made = hull(40.0, 8.0, 4.0, 2.0)
    levels = (-2.0, -1.0, 0.2 * 4.0)  # of all stations; above, the deck rises towards the bow
    ends = [made.vertices[np.isclose(made.vertices[:, 2], z), 0].max() for z in levels]
    assert ends == sorted(ends)
    assert ends[-1] < 20 < made.bounds[1, 0]


def test_bars_hang_level_before_the_end_wall_of_a_hall() -> None:
    drawn = build("racing-gates", 1, {"venue": "hall", "backdrop_m": 9.0})
    bars = drawn.meshes["wall-bars.ply"]
    assert (bars.bounds[:, 0] > 8.8).all()
    assert (bars.bounds[:, 0] < 9.0).all()
    assert np.ptp(bars.bounds[:, 1]) < 1.0


@pytest.mark.parametrize("seed", range(2))
def test_containers_stand_on_each_other_without_a_gap(seed: int) -> None:
    drawn = build("shipyard", seed, {})
    heights = [
        mesh.bounds[:, 2] for name, mesh in drawn.meshes.items() if name.startswith("containers")
    ]
    assert min(low for low, _ in heights) == pytest.approx(0.0, abs=1e-6)
    storeys = max(high for _, high in heights) / 2.59
    assert storeys == pytest.approx(round(storeys))


def test_wires_of_a_valley_end_above_the_land_behind_the_drone() -> None:
    drawn = build("valley-line", 1, {"line": "conductors", "line_deg": 0.0})
    wires = drawn.meshes["wires.ply"]
    end = wires.vertices[wires.vertices[:, 0] < wires.bounds[0, 0] + 1.0]
    lands = [mesh for name, mesh in drawn.meshes.items() if name.startswith("ground")]
    upwards = np.tile((0.0, 0.0, 1.0), (len(end), 1))
    assert not any(land.ray.intersects_any(end, upwards).any() for land in lands)


@pytest.mark.parametrize("seed", range(3))
def test_what_stands_beside_a_pad_is_near_it_but_not_on_it(seed: int) -> None:
    drawn = build("landing-pad", seed, {"standing": 8, "pad_m": 1.0})
    for name in ("crates", "drums", "cones", "gas-bottles"):
        away_m = np.hypot(*drawn.meshes[f"{name}.ply"].vertices[:, :2].T)
        assert away_m.min() > 0.5
        assert away_m.max() < 10


@pytest.mark.parametrize("seed", [2, 5])
def test_no_tree_grows_through_a_bridge(seed: int) -> None:
    drawn = build("bridge", seed, {"width_m": 14.0, "river_m": 20.0, "traffic": "none"})
    (deck,) = (thing for thing in drawn.objects if thing["name"] == "deck")
    angle = np.radians(deck["rotate_deg"][2])
    middle, across = np.array(deck["translate_m"][:2]), (-np.sin(angle), np.cos(angle))
    trees = [mesh for name, mesh in drawn.meshes.items() if name.startswith("tree-")]
    assert trees
    for tree in trees:
        assert np.abs((tree.vertices[:, :2] - middle) @ across).min() > 14.0 / 2
