"""Patchy fog: mean, contrast and correlation as asked, layers, plumes, drift with the wind."""

from functools import cache

import numpy as np
import pytest

import worlds
from reconstruction.base.errors import InputError
from spisim.atmosphere.structure import Structure
from spisim.scene import load_scene

SEEDS = range(60)
SCENE = """
name: bank
drone: {position_m: [0, 0, 1], look_at_m: [4, 0, 1]}
objects:
  - {name: wall, shape: rectangle, size_m: [9, 9], rotate_deg: [0, -90, 0], translate_m: [4, 0, 0],
     material: concrete}
volumes:
  - name: bank
    size_m: [2, 2, 2]
    translate_m: [2, 0, 1]
    extinction_per_m: 0.5
"""


def box(size_m, low_m=(0.0, 0.0, 0.0)):
    return worlds.box_pose(size_m, np.asarray(low_m) + np.asarray(size_m) / 2)


@cache
def patches(size_m, cells, contrast, length_m):
    """Fields (seeds, nz, ny, nx) of a cube before their mean is set."""
    fog = {"contrast": contrast, "correlation_length_m": length_m}
    return np.array(
        [Structure(seed=seed, **fog).patches(box((size_m,) * 3), (cells,) * 3) for seed in SEEDS]
    )


@pytest.mark.parametrize("contrast", [0.3, 1.0])
def test_mean_and_contrast_are_as_asked(contrast):
    fields = patches(12, 6, contrast, 1.0)
    each = fields.reshape(len(fields), -1)
    assert abs(worlds.z_score_exact(each.mean(axis=1), 1.0)) < 4
    square = (each**2).mean(axis=1)
    assert abs(worlds.z_score_exact(square, 1 + contrast**2)) < 4
    assert square.std() / np.sqrt(len(square)) < 0.1 * contrast**2


@pytest.mark.parametrize("length_m", [0.5, 2.0])
@pytest.mark.parametrize("axis", [0, 1, 2])
@pytest.mark.parametrize("part", [1.0, 0.5])
def test_correlation_is_1_over_e_at_its_length(length_m, axis, part):
    """And what a log-normal field then has at half of it."""
    contrast, size = 0.8, 10 * part * length_m
    fields = patches(size, 10, contrast, length_m)
    spread2 = np.log1p(contrast**2)
    of_gaussian = (np.log1p(contrast**2 / np.e) / spread2) ** (part**2)
    expected = np.expm1(spread2 * of_gaussian) / contrast**2
    along = np.moveaxis(fields, 3 - axis, -1)
    products = (along[..., 1:] * along[..., :-1]).mean(axis=(1, 2, 3)) - 1
    assert abs(worlds.z_score_exact(products / contrast**2, expected)) < 4
    if part == 1:
        assert expected == pytest.approx(1 / np.e)


def test_the_mean_over_the_box_is_1():
    for options in (
        {"contrast": 1.0, "correlation_length_m": 0.7},
        {"layer": {"top_m": 0.8, "edge_m": 0.2}},
        {"plume": {"source_m": [0, 1, 1], "direction": [1, 0, 0], "width_m": 0.3}, "contrast": 0.5},
    ):
        density = Structure.model_validate(options).density(box((4, 2, 2)))
        assert density.dtype == np.float32
        assert density.mean(dtype=float) == pytest.approx(1, abs=1e-6)
        assert density.min() >= 0


def test_the_wind_carries_patches_unchanged():
    """A box that moves along keeps its mass, cell by cell, where the wind is askew to it."""
    fog = Structure(contrast=1.0, correlation_length_m=0.5, wind_m_s=(1.5, -0.5, 0.2))
    time_s, shape = 3.0, (5, 6, 7)
    turned = box((2, 3, 4))
    turned[:3, :3] = np.array([[0.6, -0.8, 0], [0.8, 0.6, 0], [0, 0, 1]]) @ turned[:3, :3]
    along = turned.copy()
    along[:3, 3] += np.multiply(fog.wind_m_s, time_s)
    before, after = fog.patches(turned, shape), fog.patches(along, shape, time_s)
    np.testing.assert_allclose(after, before, rtol=1e-9)
    assert not np.allclose(fog.patches(turned, shape, time_s), before, rtol=0.1)


def test_a_layer_halves_at_its_top():
    density = Structure(layer={"top_m": 1.0, "edge_m": 0.1}).density(box((1, 1, 2)))
    heights = (np.arange(len(density)) + 0.5) / len(density) * 2
    expected = 1 / (1 + np.exp((heights - 1.0) / 0.1))
    profile = density.mean(axis=(1, 2))
    np.testing.assert_allclose(profile, expected / expected.mean(), rtol=1e-5)
    np.testing.assert_allclose(
        density, np.broadcast_to(profile[:, None, None], density.shape), 1e-5
    )


def test_what_crosses_each_section_of_a_plume_is_the_same():
    plume = {"source_m": [0, 0, 0], "direction": [2, 0, 0], "width_m": 0.2, "spread": 0.15}
    density = Structure(plume=plume).density(box((3, 6, 6), (0.0, -3.0, -3.0)))
    crossing = density.sum(axis=(0, 1), dtype=float)
    np.testing.assert_allclose(crossing / crossing.mean(), 1, rtol=1e-3)


def test_seeds_tell_fields_apart():
    first, same, other = (
        Structure(contrast=0.5, seed=seed).density(box((2, 2, 2))) for seed in (1, 1, 2)
    )
    np.testing.assert_array_equal(first, same)
    assert not np.allclose(first, other)


def test_a_scene_s_fog_drifts(tmp_path):
    structure = "    structure: {contrast: 0.5, correlation_length_m: 0.5, wind_m_s: [1, 0, 0]}\n"
    path = tmp_path / "bank.yaml"
    path.write_text(SCENE + structure)
    scene = load_scene(path)
    assert scene.moves
    (start,), (following,) = scene.volumes, scene.at(0.2).volumes
    assert start.density.shape == (16, 16, 16)
    np.testing.assert_array_equal(scene.at(0.1).at(0.1).volumes[0].density, following.density)
    shifted = start.structure.density(following.to_world, 0.2)
    np.testing.assert_array_equal(shifted, following.density)
    assert not np.allclose(start.density, following.density)


@pytest.mark.parametrize(
    ("structure", "parts"),
    [
        ("{contrast: -1}", ["structure.contrast", "greater than or equal to 0"]),
        ("{contrast: 0.5, correlation_length_m: 0.01}", ["volumes[0] (bank)", "at most 4194304"]),
        ("{layer: {top_m: -50, edge_m: 0.5}}", ["volumes[0] (bank)", "leaves nothing"]),
        (
            "{plume: {source_m: [0, 0, 0], direction: [0, 0, 0], width_m: 1}}",
            ["plume.direction should not be zero"],
        ),
        ("{contrat: 1}", ["'contrat'", "did you mean 'contrast'"]),
        ("{contrast: 1}\n    density: bank.npy", ["density or structure, not both"]),
    ],
)
def test_mistakes_are_told(tmp_path, structure, parts):
    path = tmp_path / "bank.yaml"
    path.write_text(SCENE + f"    structure: {structure}\n")
    with pytest.raises(InputError) as refusal:
        load_scene(path)
    for part in parts:
        assert part in str(refusal.value)
