"""Spots that a detector sees in mirrors: light of lasers that meets a mirror last."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh
from scipy.constants import c

import worlds
from spisim.atmosphere import HenyeyGreenstein, Isotropic, explicit
from spisim.scene import Material, Volume
from spisim.scene.bsdf import Conductor, Mirror, Plastic, ThinPane
from spisim.transport.engine.estimator import spot_histogram
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.world import build_world

SEEDS = worlds.seeds(8)
AREA = 1e-5
EYE = np.array([0.05, 0.02, 0.0])
AHEAD, ONTO = np.array([0.0, 0, 1]), np.array([-1.0, 0, 2])  # one laser meets the mirror
BINS = PathLengthBins(1500, 0.02)
WAVE = np.exp(2j * np.pi * 10e6 / c * BINS.centres_m)
#: A mirror's side faces x = -1; walls reach from one end to the other, mirrored about it.
SIDE, LOW, HIGH = -1.0, np.array([-5.0, -5.0, -4.0]), np.array([3.0, 3.0, 8.0])


def smooth(bsdf, reflectance=1.0):
    return Material("smooth", reflectance, "test", bsdf)


WHITE, PANE = smooth(Mirror()), smooth(ThinPane(1.5), 0.08)


def sheet(corners, material):
    mesh = trimesh.Trimesh(corners, [[0, 1, 2], [0, 2, 3]], process=False)
    return replace(worlds.surface("sheet", mesh, 0.0), material=material)


def across(axis, material):
    """A sheet at -1 across x or y, which divides everything."""
    beside = 1 - axis
    corners = np.full((4, 3), SIDE)
    corners[:, beside] = np.array([LOW, HIGH, HIGH, LOW])[:, beside]
    corners[:, 2] = [LOW[2], LOW[2], HIGH[2], HIGH[2]]
    return sheet(corners, material)


def image_of(point, *axes):
    """In the sheets across these axes."""
    turned = np.array(point, dtype=float)
    turned[list(axes)] = 2 * SIDE - turned[list(axes)]
    return turned


def fresnel(cosine, ior):
    """Unpolarised reflectance of one face."""
    inner = np.sqrt(1 - (1 - cosine**2) / ior**2)
    upright = (cosine - ior * inner) / (cosine + ior * inner)
    parallel = (ior * cosine - inner) / (ior * cosine + inner)
    return (upright**2 + parallel**2) / 2


def spots(position, headings, eyes, paths, seeds=SEEDS, **options):
    """(seeds, 3 orders, bins), of all lasers together."""
    lasers = worlds.beams(*headings)
    ends = worlds.detector(eyes, area_m2=AREA, half_angle_deg=60)
    world = build_world(position)
    result = [
        spot_histogram(
            world, lasers, ends, BINS, PathBudget(paths, min_launches=1), seed=seed, **options
        )
        for seed in seeds
    ]
    return np.array([each.mean["histogram_orders"].sum(axis=1) for each in result])


def tilted(bsdf=WHITE):
    """A mirror through (-1, 0, 4) that turns towards the detector, and its matrix."""
    normal, along = np.array([[0.94, 0, -0.34], [0.34, 0, 0.94]]) / np.hypot(0.94, 0.34)
    middle = np.array([SIDE, 0, 4.0])
    corners = [middle - s * along + [0, t, 0] for s, t in ((4, -3), (4, 3), (0, 3), (0, -3))]
    turn = np.eye(3) - 2 * np.outer(normal, normal)
    return sheet(corners, bsdf), lambda point: middle + turn @ (point - middle)


def once(cosine):
    return 2 * fresnel(cosine, 1.5) / (1 + fresnel(cosine, 1.5))


FOLDS = {
    "beside": ((across(0, smooth(Mirror(), 0.9)),), lambda p: image_of(p, 0), lambda c: 0.9),
    "tilted": ((tilted()[0],), tilted()[1], lambda c: 1.0),
    "corner": ((across(0, WHITE), across(1, WHITE)), lambda p: image_of(p, 0, 1), lambda c: 1.0),
    "pane": ((across(0, PANE),), lambda p: image_of(p, 0), once),
    "coat": (
        (across(0, smooth(Plastic(1.4), 0.3)),),
        lambda p: image_of(p, 0),
        lambda c: fresnel(c, 1.4),
    ),
}


@pytest.mark.parametrize("name", FOLDS)
def test_a_spot_in_a_mirror_is_that_of_the_image_of_the_detector(name) -> None:
    """R ρ/π · A cos cos / d² of a wall in clear air, at the length of the way by the mirror."""
    mirrors, image, reflectance = FOLDS[name]
    wall, position = worlds.plane(4.0, 0.5), np.array([0.2, 0.1, 4.0])
    result = spots(worlds.scene(wall, *mirrors), [position], EYE, 512, max_vertices=1).sum(axis=1)
    eye, axis = image(EYE), image(EYE + AHEAD) - image(EYE)
    gap_m = np.linalg.norm(position - eye)
    towards = (position - eye) / gap_m
    closed = reflectance(towards[0]) * 0.5 / np.pi * towards[2] * (axis @ towards)
    closed *= AREA / gap_m**2
    length_m = np.linalg.norm(position) + gap_m
    near = np.abs(BINS.centres_m - length_m) < 0.021
    peaks = result[:, near].sum(axis=1)
    if name == "corner":  # one of three images at random
        assert abs(worlds.z_score_exact(peaks, closed)) < 4
    else:
        assert peaks.mean() == pytest.approx(closed, rel=1e-4, abs=0)
    mean_m = result.mean(axis=0)[near] @ BINS.centres_m[near] / peaks.mean()
    assert mean_m == pytest.approx(length_m, abs=1e-3)


def walls(extinction_per_m, sides):
    """Walls about the mirrors, with fog from 1 m on, as wide on either side of them."""
    box = trimesh.creation.box(HIGH - LOW)
    box.apply_translation((LOW + HIGH) / 2)
    size, centre = HIGH - LOW - 0.2, (LOW + HIGH) / 2
    size[2], centre[2] = 6.9, 4.45
    fog = explicit(extinction_per_m, 0.95, Isotropic())
    return worlds.scene(
        worlds.surface("walls", box, 0.5),
        *sides,
        volumes=(Volume("fog", fog, worlds.box_pose(size, centre)),),
    )


@pytest.mark.parametrize(
    ("heading", "axes", "material"),
    [
        pytest.param(AHEAD, (0,), WHITE, id="beside"),
        pytest.param(ONTO, (0,), WHITE, id="onto", marks=pytest.mark.slow),
        pytest.param(AHEAD, (0, 1), WHITE, id="corner", marks=pytest.mark.slow),
        pytest.param(ONTO, (0, 1), WHITE, id="onto a corner", marks=pytest.mark.slow),
        pytest.param(AHEAD, (0,), PANE, id="pane", marks=pytest.mark.slow),
        pytest.param(ONTO, (0,), PANE, id="onto a pane", marks=pytest.mark.slow),
    ],
)
def test_all_light_of_a_folded_room_is_that_of_the_unfolded_one(heading, axes, material) -> None:
    """A perfect mirror that divides a room and its fog: with it a detector receives what it and its
    images do without it, however often that is scattered and mirrored. A pane loses nothing and
    only exchanges the sides: detector and image receive together what they do without it."""
    images = [EYE]
    for axis in axes:
        images += [image_of(eye, axis) for eye in images]
    eyes = images if material is PANE else images[:1]
    sides = [across(axis, material) for axis in axes]
    folded = spots(walls(0.3, sides), [heading] * len(eyes), eyes, 2048)
    unfolded = spots(walls(0.3, []), [heading] * len(images), images, 2048)
    readings = [
        np.hstack([each.sum(axis=2), *((each @ WAVE).real, (each @ WAVE).imag)])
        for each in (folded, unfolded)
    ]
    assert np.all(np.abs(worlds.z_score(*readings)) < 4)
    once = folded[:, 1].sum(axis=1)  # 10 % of which is missing without the images
    assert once.std() < 0.02 * once.mean()


@pytest.mark.parametrize(
    "heading",
    [
        pytest.param(AHEAD, id="beside", marks=pytest.mark.slow),
        pytest.param(ONTO, id="onto"),
        pytest.param(np.array([-1.0, 0.2, 1]), id="onto at 45 degrees", marks=pytest.mark.slow),
    ],
)
def test_fog_on_a_beam_is_seen_in_a_mirror_too(heading) -> None:
    """Light that the fog scatters once, before and after the beam meets the mirror, by quadrature.

    Unfolded: the beam goes on, and is seen by the detector and its image; what is on the other side
    than an end has met the mirror once more.
    """
    retained, extinction_per_m, albedo, g = 0.9, 0.2, 0.95, 0.5
    side = across(0, smooth(Mirror(), retained))
    low, high = LOW + 0.1, HIGH - 0.1
    low[2] = 1.0
    fog = explicit(extinction_per_m, albedo, HenyeyGreenstein(g))
    volume = Volume("fog", fog, worlds.box_pose(high - low, (low + high) / 2))
    result = spots(worlds.scene(side, volumes=(volume,)), [heading], EYE, 2**12)[:, 1]

    beam = heading / np.linalg.norm(heading)
    far_m = np.min(np.where(beam > 0, high, low)[beam != 0] / beam[beam != 0])
    edges = np.linspace(1 / beam[2], far_m, 100_001)
    along_m = (edges[1:] + edges[:-1]) / 2
    position = along_m[:, None] * beam
    in_fog = 1 - 1 / position[:, 2]  # of the ways there and back
    behind = position[:, 0] < SIDE
    expected = np.zeros(4)
    for eye, met in ((EYE, 2 * behind), (image_of(EYE, 0), np.ones_like(behind, int))):
        back_m = np.linalg.norm(eye - position, axis=1)
        bend = (eye - position) @ beam / back_m
        phase = (1 - g**2) / (4 * np.pi * (1 + g**2 - 2 * g * bend) ** 1.5)
        cosine = position[:, 2] / back_m
        length_m = along_m + back_m
        light = retained**met * albedo * extinction_per_m * phase * cosine * AREA / back_m**2
        light *= np.exp(-extinction_per_m * in_fog * length_m) * (cosine > 0.5)
        light *= edges[1] - edges[0]
        wave = np.exp(2j * np.pi * 10e6 / c * length_m) @ light
        near = light[(length_m > 4) & (length_m < 8)].sum()
        expected += [light.sum(), wave.real, wave.imag, near]
    wave, bins = result @ WAVE, BINS.centres_m
    near = result[:, (bins > 4) & (bins < 8)].sum(axis=1)
    readings = np.column_stack([result.sum(axis=1), wave.real, wave.imag, near])
    assert np.all(np.abs(worlds.z_score_exact(readings, expected)) < 4)
    assert readings[:, 0].std() < 0.03 * expected[0]


@pytest.mark.slow
def test_a_smooth_coat_is_a_mirror_of_glass() -> None:
    """Over a black body, of any light: to the last of its reflections by Fresnel's formulae."""
    coat, glass = smooth(Plastic(1.5), 0.0), smooth(Conductor(1.5, 1e-6))
    first, second = (
        spots(walls(0.3, [across(0, each)]), [ONTO], EYE, 256, SEEDS[:1]).sum(axis=2)
        for each in (coat, glass)
    )
    np.testing.assert_allclose(first, second, rtol=1e-3)


@pytest.mark.parametrize("extinction_per_m", [0.0, pytest.param(0.2, marks=pytest.mark.slow)])
def test_light_that_is_scattered_once_behind_a_pane_returns_through_it(extinction_per_m) -> None:
    """A pane is no vertex: what goes straight through both ways is scattered once at most."""
    fog = explicit(extinction_per_m, 0.95, Isotropic())
    volumes = (Volume("fog", fog, worlds.box_pose((5, 5, 4), (0, 0, 3))),)
    wall, pane = worlds.plane(4.0), replace(worlds.plane(0.9, half_size_m=3), material=PANE)
    bare, glazed = (
        worlds.scene(*things, volumes=volumes if extinction_per_m > 0 else ())
        for things in ((wall,), (wall, pane))
    )
    once_through = 1 - 0.08 / 1.04
    behind = BINS.centres_m > 1.9  # not what the pane reflects
    aside = np.array([0.05, 0.0, 1])  # beam that it does not reflect into the detector
    without, through = (
        spots(each, [aside], EYE, 4096, max_vertices=1)[:, :, behind].sum(axis=(1, 2))
        for each in (bare, glazed)
    )
    assert abs(worlds.z_score(once_through**2 * without, through)) < 4
    assert through.std() < 0.05 * through.mean()
