"""The true range of a spot is the mode of its own path histogram in clear air."""

from dataclasses import replace

import numpy as np
import pytest
import trimesh

import spisim
import worlds
from spisim.instrument.views import InstrumentView
from spisim.scene import Material, Scene, SceneObject
from spisim.scene.bsdf import (
    DIFFUSE,
    Bsdf,
    Clear,
    Conductor,
    Dielectric,
    Diffuse,
    Mirror,
    Plastic,
    Principled,
    Retroreflector,
    RoughConductor,
    RoughDielectric,
    RoughPlastic,
    ThinPane,
)
from spisim.simulation.light.spots import bins_of, ranging_histogram
from spisim.transport import ground_truth
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.world import build_world

INSTRUMENT = spisim.load_instrument("paper")
METAL = {"eta": 1.44, "k": 16.0}
MODELS = {
    "diffuse": Diffuse(),
    "plastic": Plastic(),
    "rough plastic": RoughPlastic(0.2),
    "mirror": Mirror(),
    "metal": Conductor(**METAL),
    "rough metal": RoughConductor(0.3, **METAL),
    "glass": Dielectric(),
    "frosted glass": RoughDielectric(0.3),
    "pane": ThinPane(),
    "principled": Principled(0.3, 0.5),
    "tape": Retroreflector(0.3),
}


def sheet(name: str, distance_m: float, bsdf: Bsdf = DIFFUSE, **options) -> SceneObject:
    """A plane across the view, a little turned, so that no mirror dazzles a detector."""
    thing = worlds.plane(distance_m, tilt_rad=0.3, half_size_m=4.0)
    thing.mesh.visual = trimesh.visual.TextureVisuals(uv=[[0, 0], [1, 0], [1, 1], [0, 1]])
    return replace(thing, name=name, material=Material(name, 0.5, "test", bsdf, **options))


def peaks_m(scene: Scene) -> np.ndarray:
    """Range of the mode of each spot's histogram; nan where it is empty."""
    placed, world = InstrumentView.placed(scene, INSTRUMENT), build_world(scene)
    bins, budget = bins_of(INSTRUMENT, world, placed), PathBudget(128, min_launches=1)
    seed = np.random.SeedSequence(0)
    result = ranging_histogram(world, placed, bins, budget, seed=seed, max_vertices=1)
    histogram = result.mean["histogram"]
    peak_m = bins.centres_m[np.argmax(histogram, axis=1)] / 2
    return np.where(histogram.max(axis=1) > 0, peak_m, np.nan)


def middle(values: np.ndarray) -> np.ndarray:
    return values[values.shape[0] // 2, values.shape[1] // 2]


@pytest.mark.parametrize("opacity", [None, 0.02])
@pytest.mark.parametrize("name", MODELS)
def test_a_spot_is_at_the_mode_of_its_histogram(name: str, opacity: float | None) -> None:
    """Of any surface, as opaque as may be, before a sheet of which nothing is there and a wall."""
    thing = sheet("thing", 4.0, MODELS[name], opacity=opacity)
    scene = worlds.scene(thing, sheet("nothing", 5.0, opacity=0.0), sheet("wall", 6.0))
    truth, peak_m = ground_truth(scene, INSTRUMENT, subpixels=1), peaks_m(scene)
    if np.isnan(peak_m).all():  # it mirrors the light away, and lets none pass
        assert isinstance(MODELS[name], Mirror | Conductor | Dielectric)
        assert opacity is None
        assert set(truth.spot_object) == {"thing"}
    else:
        np.testing.assert_allclose(truth.spot_range_m, peak_m, atol=0.02)
    seen = truth.object_names[middle(truth.object_id)]
    assert seen in truth.spot_object
    assert middle(truth.range_m) == pytest.approx({"thing": 4.0, "wall": 6.0}[seen], abs=0.1)


@pytest.mark.parametrize(
    ("sheets", "nearest_m"),
    [
        ([sheet("a", 2.0, opacity=0.0), sheet("b", 3.0, opacity=0.0)], 6.0),
        ([sheet("a", 2.0, opacity=0.0), sheet("b", 3.0, ThinPane())], 3.0),
        ([sheet("a", 2.0, opacity=0.05), sheet("b", 3.0, opacity=0.0)], 2.0),
    ],
    ids=["nothing", "pane", "net"],
)
def test_what_sends_no_light_back_is_in_the_corridor_if_it_is_there(sheets, nearest_m) -> None:
    """A spot is at the wall; a drone meets the pane or the net first."""
    scene = worlds.scene(*sheets, sheet("wall", 6.0))
    truth = ground_truth(scene, INSTRUMENT)
    np.testing.assert_allclose(truth.spot_range_m, peaks_m(scene), atol=0.02)
    assert set(truth.spot_object) == {"wall"}
    assert truth.corridor_m == pytest.approx(nearest_m - 0.3 * np.tan(0.3), abs=1e-3)
    assert np.all(truth.coverage == 1)
    np.testing.assert_allclose(truth.reflectance, 0.5)
    bare = ground_truth(worlds.scene(sheet("wall", 6.0)), INSTRUMENT)
    np.testing.assert_allclose(truth.depth_m, bare.depth_m, atol=1e-4)


def test_a_spot_is_where_its_detector_sees_it() -> None:
    """From 1 cm beside the laser a field of 1.2° of 9 mm sees no net nearer than 0.53 m."""
    for distance_m, nearest in ((0.5, "wall"), (0.6, "net")):
        scene = worlds.scene(sheet("net", distance_m, opacity=0.9), sheet("wall", 3.0))
        truth = ground_truth(scene, INSTRUMENT, subpixels=1)
        np.testing.assert_allclose(truth.spot_range_m, peaks_m(scene), atol=0.02)
        assert set(truth.spot_object) == {nearest}
        assert truth.object_names[middle(truth.object_id)] == "net"


def test_pixels_see_through_the_holes_of_a_mask() -> None:
    board = np.indices((8, 8)).sum(axis=0) % 2
    mask = sheet("mask", 3.0, opacity=board.astype(np.float32))
    scene = worlds.scene(mask, sheet("wall", 6.0))
    truth = ground_truth(scene, INSTRUMENT, subpixels=1)
    assert set(np.unique(truth.object_id)) == {0, 1}
    peak_m = peaks_m(scene)
    np.testing.assert_allclose(truth.spot_range_m, peak_m, atol=0.02)


@pytest.mark.parametrize("name", [name for name in MODELS if not isinstance(MODELS[name], Clear)])
def test_the_reflectance_is_that_of_the_texture_whatever_the_model(name: str) -> None:
    texture = np.full((1, 1), 0.6, np.float32)
    thing = sheet("thing", 4.0, MODELS[name], texture=texture)
    truth = ground_truth(worlds.scene(thing), INSTRUMENT, subpixels=1)
    np.testing.assert_allclose(truth.reflectance, 0.5 * 0.6, rtol=1e-5)


def test_nothing_is_seen_of_what_is_not_there_or_reflects_no_light() -> None:
    for thing in (sheet("a", 3.0, opacity=0.0), sheet("a", 3.0, ThinPane())):
        truth = ground_truth(worlds.scene(thing), INSTRUMENT)
        assert np.isnan(truth.spot_range_m).all()
        assert np.isnan(truth.range_m).all()
        assert set(truth.spot_object) == {None}


def test_bins_are_fine_at_a_far_wall_behind_what_is_not_there() -> None:
    scene = worlds.scene(sheet("nothing", 3.0, opacity=0.0), worlds.plane(150.0))
    truth = ground_truth(scene, INSTRUMENT, subpixels=1)
    np.testing.assert_allclose(truth.spot_range_m, peaks_m(scene), atol=0.02)
