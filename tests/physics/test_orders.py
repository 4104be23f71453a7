"""Light split into unscattered, single and multiple: of image, phasors, cube and spots."""

from dataclasses import replace

import numpy as np
import pytest

import spisim
import worlds
from reconstruction.base.errors import InputError
from spisim.atmosphere import HenyeyGreenstein, explicit
from spisim.simulation.light import solve
from spisim.transport.engine.estimator import spot_histogram, transport_image
from spisim.transport.engine.outputs import Outputs
from spisim.transport.engine.sampling import PathBudget
from spisim.transport.engine.tally import PathLengthBins
from spisim.transport.world import build_world

SEEDS = worlds.seeds(8)
END = worlds.detector([0.05, 0.0, 0.0], area_m2=2e-6, half_angle_deg=14)
BINS = PathLengthBins(200, 0.1)
EVERYTHING = Outputs(frequencies_hz=(0.0, 15e6), bins=BINS)
EXTINCTION_PER_M = 0.1
WALL_M, WALL_REFLECTANCE = 5.0, 0.5


def foggy(position):
    return replace(position, atmosphere=explicit(EXTINCTION_PER_M, 0.98, HenyeyGreenstein(0.7)))


@pytest.fixture(scope="module")
def split():
    """Whole sums, and the same paths' sums with parts."""
    world, view = build_world(foggy(worlds.scene(*worlds.room()))), worlds.projector(shape=(4, 4))
    return [
        transport_image(world, view, END, PathBudget(256), seed=SEEDS[0], outputs=outputs).mean
        for outputs in (EVERYTHING, replace(EVERYTHING, orders=True))
    ]


def test_parts_of_image_phasors_and_cube_add_up_to_what_is_found_without_parts(split):
    whole, parts = split
    assert set(whole) == {"image", "phasors", "histogram"}
    for name, values in whole.items():
        np.testing.assert_array_equal(parts[name], values)
        largest = np.abs(values).max()
        np.testing.assert_allclose(
            parts[f"{name}_orders"].sum(axis=0), values, atol=1e-12 * largest
        )


def test_every_part_of_phasors_and_cube_is_that_of_the_image(split):
    parts = split[1]
    image = parts["image_orders"]
    assert (image > 0).all()
    np.testing.assert_allclose(parts["histogram_orders"].sum(axis=-1), image, rtol=1e-6)
    np.testing.assert_allclose(parts["phasors_orders"][..., 0, 0], image, rtol=1e-6)


def spots(position, seed):
    beams = worlds.beams([0, 0, 1], [0.1, 0, 1])
    ends = worlds.detector([[0.05, 0, 0], [0.05, 0, 0]], area_m2=2e-6, half_angle_deg=14)
    return spot_histogram(
        build_world(position), beams, ends, BINS, PathBudget(2**12), seed=seed
    ).mean


def test_in_clear_air_all_light_of_the_spots_is_unscattered():
    mean = spots(worlds.scene(*worlds.room()), SEEDS[0])
    unscattered, *rest = mean["histogram_orders"]
    assert (mean["histogram"].sum(axis=-1) > 0).all()
    np.testing.assert_array_equal(unscattered, mean["histogram"])
    assert not np.any(rest)


def test_spots_in_fog_have_all_parts_and_the_unscattered_is_the_weakened_echo_of_the_wall():
    position = foggy(worlds.scene(worlds.plane(WALL_M, WALL_REFLECTANCE)))
    runs = [spots(position, seed) for seed in SEEDS]
    parts = np.array([run["histogram_orders"] for run in runs])
    assert (parts.sum(axis=-1) > 0).all()
    np.testing.assert_allclose(parts.sum(axis=1), [run["histogram"] for run in runs], rtol=1e-12)
    point = WALL_M * np.array([[0, 0, 1], [0.1, 0, 1]])
    out, home = (np.linalg.norm(point - end, axis=1) for end in ([0, 0, 0], [0.05, 0, 0]))
    cosine = WALL_M / home
    closed = WALL_REFLECTANCE / np.pi * 2e-6 * (cosine / home) ** 2
    closed *= np.exp(-EXTINCTION_PER_M * (out + home))
    np.testing.assert_allclose(parts[:, 0].sum(axis=-1).mean(axis=0), closed, rtol=1e-6)


def test_solve_tells_of_every_part_by_rows_and_columns():
    outputs = replace(EVERYTHING, orders=True)
    paper = spisim.load_instrument("paper")
    light = solve(foggy(worlds.scene(*worlds.room())), paper, spp=8, outputs=outputs)
    extra, (height, width) = light.extra, light.image.shape
    bins = light.path_length_m.size
    assert {name: values.shape for name, values in extra.items()} == {
        "orders": (3, height, width),
        "phasors": (2, height, width),
        "phasor_orders": (3, 2, height, width),
        "cube": (height, width, BINS.count),
        "cube_orders": (3, height, width, BINS.count),
        "cube_path_length_m": (BINS.count,),
        "spot_orders": (3, 4, bins),
    }
    for whole, parts in (
        (light.image, extra["orders"]),
        (extra["phasors"], extra["phasor_orders"]),
        (extra["cube"], extra["cube_orders"]),
        (light.spot_histogram, extra["spot_orders"]),
    ):
        largest = np.abs(whole).max()
        np.testing.assert_allclose(parts.sum(axis=0), whole, rtol=0, atol=1e-12 * largest)
    scale = {"rtol": 0, "atol": 1e-6 * light.image.max()}
    np.testing.assert_allclose(extra["cube"].sum(axis=-1), light.image, **scale)
    np.testing.assert_allclose(extra["phasors"][0], light.image, **scale)
    np.testing.assert_allclose(extra["phasor_orders"][:, 0], extra["orders"], **scale)
    np.testing.assert_allclose(extra["cube_orders"].sum(axis=-1), extra["orders"], **scale)


@pytest.mark.parametrize("width_m", [0.0, -0.1, np.inf, np.nan])
def test_path_length_bins_without_a_width_are_refused(width_m):
    with pytest.raises(InputError, match=r"width_m .* positive and finite"):
        PathLengthBins.up_to(80.0, width_m)


def test_a_single_path_length_bin_is_refused():
    with pytest.raises(InputError, match="near 1: at least 2"):
        PathLengthBins(1, 0.1)
