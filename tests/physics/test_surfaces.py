"""Surfaces other than matt ones: mirrors, panes, masks, textures, gloss, against Mitsuba.

Mitsuba follows paths from the detector alone and connects them to the projector. Light that a
mirror throws onto a wall it never finds: where a surface is a mirror, it is compared with the
detector's strategy, which has the same blind spot, and closed forms take care of the rest.
"""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import worlds
from reconstruction.operators import expose, illumination, make_plan
from spisim.scene import Material, SceneObject
from spisim.scene.bsdf import (
    Mirror,
    Principled,
    Retroreflector,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinPane,
)
from spisim.transport.engine import weights
from spisim.transport.engine.estimator import Strategy
from spisim.transport.engine.walk import MAX_VERTICES
from spisim.transport.world import build_world

# isort: split
import drjit as dr

SEEDS = worlds.seeds(8)
BASELINE = worlds.detector([0.3, 0.1, 0.0], area_m2=2e-6, half_angle_deg=20)
SHAPE = (16, 16)


def sheet(material, distance=3.0, half_size=0.4, centre=(0.0, 0.0), tilt=0.0, uv=False):
    """Square sheet across the view, with texture coordinates if wanted."""
    thing = worlds.plane(distance, tilt_rad=tilt, half_size_m=half_size)
    mesh = thing.mesh.copy()
    mesh.apply_translation([*centre, 0])
    if uv:
        corners = np.array([[0, 0], [1, 0], [1, 1], [0, 1]], dtype=float)
        mesh.visual = trimesh.visual.TextureVisuals(uv=corners)
    return SceneObject("sheet", mesh, material)


def made_of(bsdf=None, reflectance=0.6, **pictures):
    options = {} if bsdf is None else {"bsdf": bsdf}
    return Material("m", reflectance, "test", **options, **pictures)


def checks():
    board = np.indices((8, 8)).sum(axis=0) % 2
    return (0.2 + 0.8 * board).astype(np.float32)


CASES = {
    "pane": sheet(made_of(ThinPane(1.5)), half_size=3),
    "tilted pane": sheet(made_of(ThinPane(1.5)), half_size=3, tilt=0.5),
    "mask": sheet(made_of(opacity=0.4)),
    "holes": sheet(made_of(opacity=(checks() > 0.5).astype(np.float32)), uv=True),
    "texture": sheet(made_of(texture=checks()), uv=True),
    "rough plastic": sheet(made_of(RoughPlastic(0.3)), tilt=0.1),
    "rough metal": sheet(made_of(RoughConductor(0.4, 0.2, 3.9)), tilt=0.2),
    "frosted glass": sheet(made_of(RoughDielectric(0.5, 1.5))),
    "principled": sheet(made_of(Principled(0.4, 0.3, 0.5)), tilt=0.1),
    "tape": sheet(made_of(Retroreflector(0.3, 0.1)), tilt=0.1),
    "mirror": sheet(made_of(Mirror(), 0.9), tilt=0.6),
}


MIRRORING = ("pane", "tilted pane", "mirror")


@pytest.mark.parametrize(
    ("name", "extinction"),
    [
        pytest.param(name, 0.0, marks=[pytest.mark.slow] if name == "pane" else [])
        for name in CASES  # one pane, the tilted one, is enough in the fast tier
    ]
    + [pytest.param(name, 0.1, marks=pytest.mark.slow) for name in CASES if name not in MIRRORING],
)
def test_against_the_reference_engine(name, extinction, reference):
    fog = worlds.bank(extinction, albedo=0.95, g=0.8)
    position = worlds.scene(worlds.room()[0], CASES[name], volumes=fog)
    plan = make_plan(SHAPE, 4, polarity="single-ended")
    world, view = build_world(position), worlds.projector(shape=SHAPE)
    strategy, spp = (Strategy.DETECTOR, 384) if name in MIRRORING else (Strategy.BOTH, 64)
    images = [worlds.image(world, view, BASELINE, spp, s, strategy=strategy) for s in SEEDS]
    ours = expose(plan, np.array(images))[:, :-1]
    patterns = [illumination(plan, k) for k in range(plan.exposures - 1)]
    runs, samples = (20, 2**14) if extinction else (len(SEEDS), 2**15)
    mitsuba = reference(
        f"{name}, extinction {extinction}, by Mitsuba",
        lambda runs: worlds.mitsuba_readings(position, view, BASELINE, patterns, runs, samples),
        runs,
    )
    assert np.all(np.abs(mitsuba.z_score(ours)) < 4)
    # The engine knows every surface: a few of its paths find what many have found.
    few = worlds.mitsuba_readings(position, view, BASELINE, patterns[:1], range(8), samples=2**12)
    assert abs(mitsuba.z_score(few)[0]) < 5
    assert np.all(ours.std(axis=0) < 0.1 * ours.mean(axis=0))


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mask", "holes", "rough metal", "frosted glass"])
def test_either_end_alone_agrees(name):
    position = worlds.scene(worlds.room()[0], CASES[name])
    world, view = build_world(position), worlds.projector(shape=SHAPE)
    totals = {
        strategy: [
            worlds.image(world, view, BASELINE, spp, s, strategy=strategy).sum() for s in SEEDS
        ]
        for strategy, spp in zip(Strategy, (256, 512, 512), strict=True)
    }
    for other in (Strategy.PROJECTOR, Strategy.DETECTOR):
        assert abs(worlds.z_score(totals[other], totals[Strategy.BOTH])) < 4


@pytest.mark.slow
@pytest.mark.parametrize("name", ["mirror", "tilted pane"])
def test_one_end_and_what_only_the_other_finds_is_all_light_in_fog(name, monkeypatch):
    """Beside a mirror each end alone is blind to some paths; together they miss none."""
    position = worlds.scene(
        worlds.room()[0], CASES[name], extinction_per_m=0.05, g=0.7, albedo=0.95
    )
    world, view = build_world(position), worlds.projector(shape=SHAPE)

    def totals(strategy, spp):
        return np.array(
            [worlds.image(world, view, BASELINE, spp, s, strategy=strategy).sum() for s in SEEDS]
        )

    everything = totals(Strategy.BOTH, 1024)
    outward = totals(Strategy.PROJECTOR, 2048)
    unique = weights.alone._replace(
        fraction=lambda others, vertex: dr.select(others == 0, 1.0, 0.0)
    )
    monkeypatch.setattr(weights, "alone", unique)
    only_inward = totals(Strategy.DETECTOR, 2048)
    assert abs(worlds.z_score(outward + only_inward, everything)) < 4
    assert only_inward.mean() > 0.01 * everything.mean()


def test_a_mirror_folds_the_path():
    """Beam to a mirror at 45°, on to a wall beside: the path is that to the wall's image."""
    mirror = sheet(made_of(Mirror(), 0.9), distance=3.0, half_size=0.3, tilt=np.pi / 4)
    wall = worlds.surface("wall", trimesh.creation.box((0.02, 4, 4)), 0.5)
    wall.mesh.apply_translation([-2.01, 0, 3])
    world = build_world(worlds.scene(mirror, wall))
    beside = worlds.detector([0, 0, 1.0], [-1, 0, 0.8], area_m2=1e-10, half_angle_deg=60)
    histogram = worlds.histogram(
        world, worlds.beams([0, 0, 1]), beside, (1000, 0.02), 256, SEEDS[0]
    )
    first = np.flatnonzero(histogram[0])[:2]
    weights = histogram[0, first]
    back = np.hypot(2.0, 2.0)
    assert first @ weights / weights.sum() * 0.02 == pytest.approx(3 + 2 + back, abs=1e-3)
    cos_wall, cos_detector = 2.0 / back, (2 * 1 + 2 * 0.8) / back / np.hypot(1, 0.8)
    closed = 0.9 * 0.5 * 1e-10 * cos_wall * cos_detector / (np.pi * back**2)
    assert weights.sum() == pytest.approx(closed, rel=1e-3, abs=0)


@pytest.mark.parametrize("observation_deg", [0.1, 0.5, 1.0, 2.0])
def test_wall_of_tape(observation_deg):
    """Beam straight onto tape: the detector beside it sees GGX's lobe about the beam, and the body.

    P_d = P A cos²δ / r² · (R / (4 π α² cos δ (cos²(δ/2) + sin²(δ/2) / α²)²) · cos^(5/2) δ + ρ / π)
    """
    distance, returned, roughness, area = 4.0, 0.15, 0.0054, 1e-10
    delta = np.radians(observation_deg)
    aside = distance * np.tan(delta)
    wall = sheet(made_of(Retroreflector(returned, roughness), 0.4), distance, half_size=2)
    world = build_world(worlds.scene(wall))
    beside = worlds.detector([aside, 0, 0], area_m2=area, half_angle_deg=20)
    result = worlds.histogram(world, worlds.beams([0, 0, 1]), beside, (1000, 0.02), 64, SEEDS[0])
    facets = np.cos(delta / 2) ** 2 + (np.sin(delta / 2) / roughness) ** 2
    lobe = returned / (4 * np.pi * (roughness * facets) ** 2 * np.cos(delta))
    scattered = lobe * np.cos(delta) ** 2.5 + 0.4 / np.pi
    closed = scattered * area * np.cos(delta) ** 4 / distance**2
    assert result.sum() == pytest.approx(closed, rel=2e-3, abs=0)


@pytest.mark.parametrize("maximum", [1, MAX_VERTICES])
def test_a_pane_weakens_both_ways_by_its_transmittance(maximum):
    """It is no vertex: light that the wall behind it scatters once passes it twice."""
    # Tilted, or it would mirror the projector into the detector
    pane = sheet(made_of(ThinPane(1.5)), distance=2.0, half_size=5, tilt=0.1)
    bare = worlds.scene(worlds.plane(5.0, 0.5))
    glazed = replace(bare, objects=(*bare.objects, pane))
    view, eye = worlds.projector(1.0, (2, 2)), worlds.detector(half_angle_deg=1.0)
    with_pane, without = (
        worlds.image(build_world(position), view, eye, 256, SEEDS[0], max_vertices=maximum)
        for position in (glazed, bare)
    )
    reflected = 0.04
    transmitted = 1 - 2 * reflected / (1 + reflected)
    assert with_pane.mean() / without.mean() == pytest.approx(transmitted**2, rel=0.02)


def test_white_room_keeps_light_finite_and_a_white_furnace_stays_white():
    """Closed sphere of reflectance 0.9 with a rough metal ball inside: no energy is made."""
    ball = worlds.surface("ball", trimesh.creation.icosphere(3, 0.5), 0.9)
    shiny = replace(ball, material=made_of(RoughConductor(0.3, 0.2, 3.9), 0.95))
    shell = worlds.sphere(2.0, 0.9)
    wall = worlds.detector([0.0, 0.0, -1.99], [0.0, 0.0, 1.0])
    view = worlds.projector(20, (2, 2), worlds.pose_at([0, 0, -1.5]))
    totals = [
        [
            worlds.image(build_world(worlds.scene(shell, thing)), view, wall, 1024, s).mean()
            for s in SEEDS
        ]
        for thing in (ball, shiny)
    ]
    # An upper bound: the same power in the sphere without anything that absorbs more than its wall
    bound = 1e-6 * 0.95 / (4 * np.pi * 4.0 * (1 - 0.95))
    for runs in totals:
        assert 0 < np.mean(runs) < bound
