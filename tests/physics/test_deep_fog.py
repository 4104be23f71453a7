"""Light through fog of optical depth 20, and back from a wall behind it, against other solutions.

A distant projector lights a slab of fog evenly along its normal. What one place receives over what
falls onto the slab is then the fraction of a ray's light that the slab returns or lets pass, which
has a closed form for isotropic fog that absorbs nothing, and photons in one dimension elsewhere.
"""

import numpy as np
import pytest

import worlds
from spisim.atmosphere import Atmosphere, henyey_greenstein
from spisim.scene import Volume
from spisim.transport.engine.estimator import Strategy
from spisim.transport.world import World, build_world

DEPTH, HALF_M, FAR_M, AREA_M2 = 20.0, 240.0, 20_000.0, 1e-6
#: Deep slabs let H(1) / √3 / (τ + 2 q) pass, up to exp(-τ): H(1) = 2.9078, q = 0.71045
#: (S. Chandrasekhar, Radiative Transfer (1950); H. C. van de Hulst, Multiple Light Scattering
#: (1980)).
PASSED = 2.9078 / np.sqrt(3) / (DEPTH + 2 * 0.71045)

pytestmark = pytest.mark.slow


def slab(wall: float, albedo: float = 1.0, g: float = 0.0) -> World:
    """Fog of 1 per m from 0 to 20 m ahead, and a wall half a metre behind it."""
    fog = Atmosphere(1.0, albedo, henyey_greenstein(g), "test")
    pose = worlds.box_pose((2 * HALF_M, 2 * HALF_M, DEPTH), (0, 0, DEPTH / 2))
    behind = worlds.plane(DEPTH + 0.5, wall, half_size_m=HALF_M)
    return build_world(worlds.scene(behind, volumes=(Volume("slab", fog, pose),)))


def received(world: World, forward: bool, spp: int = 512) -> np.ndarray:
    """Light on a plane behind the fog or before it, over that onto the fog; (runs,)."""
    place, facing = (DEPTH + 0.25, -1) if forward else (-1, 1)
    end = worlds.detector([0, 0, place], [0, 0, facing], AREA_M2)
    half_deg = np.degrees(np.arctan(HALF_M / FAR_M))
    view = worlds.projector(2 * half_deg, (8, 8), worlds.pose_at((0, 0, -FAR_M)))
    onto_it = AREA_M2 / (view.pixel_area * FAR_M**2)  # of each pixel's power
    runs = [
        worlds.image(world, view, end, spp, seed, strategy=Strategy.DETECTOR).sum() / onto_it
        for seed in worlds.seeds(6)
    ]
    return np.array(runs)


@pytest.mark.parametrize(
    ("wall", "forward", "exact", "spp"),
    [(0.0, True, PASSED, 1024), (0.0, False, 1 - PASSED, 512), (1.0, False, 1.0, 1024)],
    ids=["passed", "returned", "returned with a white wall"],
)
def test_fog_that_absorbs_nothing(wall: float, forward: bool, exact: float, spp: int) -> None:
    """With a white wall behind it everything returns, 2 % after over a thousand scatterings."""
    runs = received(slab(wall), forward, spp)
    assert abs(worlds.z_score_exact(runs, exact)) < 4
    assert runs.std(ddof=1) / np.sqrt(len(runs)) < min(0.02 * exact, 0.003)


def photons_returned(count: int, wall: float, albedo: float, g: float, rng) -> float:
    """Fraction that photons in one dimension return, in double precision."""
    depth, cosine, weight, returned = np.zeros(count), np.ones(count), np.ones(count), 0.0
    while weight.size:
        depth = depth + cosine * rng.exponential(size=depth.size)
        returned += weight[depth < 0].sum()
        at_wall = depth >= DEPTH
        ahead = (1 - g**2) / (1 - g + 2 * g * rng.random(depth.size))
        ahead = (1 + g**2 - ahead**2) / (2 * g)  # Henyey & Greenstein's cosine
        turned = np.cos(2 * np.pi * rng.random(depth.size))
        scattered = cosine * ahead + np.sqrt((1 - cosine**2) * (1 - ahead**2)) * turned
        cosine = np.where(at_wall, -np.sqrt(rng.random(depth.size)), scattered)
        weight = weight * np.where(at_wall, wall, albedo)
        survives = (depth >= 0) & (rng.random(depth.size) < np.minimum(10 * weight, 1))
        weight = np.where(weight < 0.1, 0.1, weight)
        depth = np.minimum(depth, DEPTH)
        depth, cosine, weight = depth[survives], cosine[survives], weight[survives]
    return returned / count


def test_fog_that_absorbs_and_scatters_forward() -> None:
    """As fog does: the wall adds a fifth to what returns."""
    numbers = {"albedo": 0.995, "g": 0.85}
    rng = np.random.default_rng(1)
    exact = {
        wall: np.array([photons_returned(20_000, wall, rng=rng, **numbers) for _ in range(8)])
        for wall in (0.0, 0.8)
    }
    runs = {wall: received(slab(wall, **numbers), forward=False) for wall in exact}
    for wall, returned in runs.items():
        assert abs(worlds.z_score(returned, exact[wall])) < 4
    assert runs[0.8].mean() > 1.05 * runs[0.0].mean()


def test_both_ends_together_see_what_a_beam_sends_back() -> None:
    """A beam from afar, seen from there: H(1)² / 8 less 4/3 (√3/4 H(1))² / (τ + 2 q) of a white
    diffuser's light."""
    world = slab(0.0)
    ends = worlds.detector([[0, 0, -1000]] * 4, [[0, 0, 1]] * 4, AREA_M2, half_angle_deg=4)
    lasers = worlds.beams(*[[0, 0, 1]] * 4, origin=(0, 0, -1000))
    runs = [
        worlds.histogram(world, lasers, ends, (100, 50.0), 1024, seed).sum(axis=1).mean()
        for seed in worlds.seeds(8)
    ]
    white = AREA_M2 / np.pi / 1000**2
    exact = 2.9078**2 / 8 - np.sqrt(3) / 4 * 2.9078 * PASSED
    assert abs(worlds.z_score_exact(np.array(runs) / white, exact)) < 4
    assert np.mean(runs) / white == pytest.approx(exact, rel=0.08)
