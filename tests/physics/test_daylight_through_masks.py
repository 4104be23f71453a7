"""Sky and sun through surfaces that are partly there."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import spisim
import worlds
from spisim.scene import Ambient, Material, SceneObject
from spisim.transport.daylight import daylight_power
from spisim.transport.world import build_world

PAPER = spisim.load_instrument("paper")
SKY, SUN = Ambient(sky_klx=10.0), Ambient(sun_klx=20.0, sun_direction=(0.0, 0.0, -1.0))
SEEDS = worlds.seeds(20)


def sheet(height_m: float, reflectance: float, opacity=None) -> SceneObject:
    """A level sheet, 8 m wide, with texture coordinates."""
    thing = worlds.plane(height_m, half_size_m=4.0)
    thing.mesh.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]])
    return replace(thing, material=Material("sheet", reflectance, "test", opacity=opacity))


def received_w(ambient: Ambient, end, *things: SceneObject) -> np.ndarray:
    scene = worlds.scene(*things, ambient=ambient)
    scene = replace(scene, wavelength_nm=PAPER.wavelength_nm)
    world = build_world(scene)
    runs = [daylight_power(scene, PAPER, world, end, target=0.01, seed=seed) for seed in SEEDS]
    return np.array([each.power_w.sum() for each in runs])


@pytest.mark.parametrize("opacity", [0.0, 0.4])
def test_a_black_sheet_dims_the_sky_by_its_opacity(opacity: float) -> None:
    up = worlds.detector([0, 0, 1.0], [0, 0, 1.0], half_angle_deg=20)
    ground = sheet(0.0, 0.0)
    bare = received_w(SKY, up, ground)
    dimmed = received_w(SKY, up, ground, sheet(3.0, 0.0, opacity))
    assert dimmed.mean() == pytest.approx((1 - opacity) * bare.mean(), rel=0.01)


def test_a_board_of_holes_halves_the_sun_on_the_ground() -> None:
    down = worlds.detector([0, 0, 4.0], [0, 0, -1.0], half_angle_deg=20)
    ground = sheet(0.0, 0.5)
    board = (np.indices((64, 64)).sum(axis=0) % 2).astype(np.float32)
    bare = received_w(SUN, down, ground).mean()
    even = received_w(SUN, down, ground, sheet(5.0, 0.0, 0.3))
    np.testing.assert_allclose(even, 0.7 * bare, rtol=1e-6)
    holes, others = (received_w(SUN, down, ground, sheet(5.0, 0.0, b)) for b in (board, 1 - board))
    assert abs(worlds.z_score_exact(holes, bare / 2)) < 4
    assert holes.std(ddof=1) / np.sqrt(len(holes)) < 0.005 * bare
    np.testing.assert_allclose(holes + others, bare, rtol=1e-6)  # on the same paths
