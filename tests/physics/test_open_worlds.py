"""Sky, far walls and fog without end: what meets nothing is a reading, what is far a true one."""

import re
import warnings
from dataclasses import replace

import numpy as np
import pytest
import trimesh

import spisim
import worlds
from reconstruction import capture_warnings, evaluate, read_capture, reconstruct, write_capture
from reconstruction.ranging import RANGED
from spisim.atmosphere import Atmosphere, henyey_greenstein
from spisim.atmosphere.precipitation import rain
from spisim.simulation import simulate
from spisim.simulation.light import LightSequence, solve
from spisim.simulation.measurement.spots import spot_light
from spisim.transport import ground_truth
from spisim.transport.world import FOG_DEPTHS, fog_ball
from spisim_app.report.capture import write_report

PAPER = spisim.load_instrument("paper")
SMALL = PAPER.model_copy(
    update={
        "projector": PAPER.projector.model_copy(update={"shape": (16, 16)}),
        "plan": PAPER.plan.model_copy(update={"patterns": 64}),
    }
)


def board(name, x, y, z, half=0.2):
    """A square across the optical axis, `half` to either side of a point."""
    sheet = trimesh.Trimesh(
        [[-half, -half, 0], [half, -half, 0], [half, half, 0], [-half, half, 0]],
        [[0, 1, 2], [0, 2, 3]],
    )
    return worlds.surface(name, sheet.apply_translation((x, y, z)), 0.5)


def open_world(**options):
    """A post at 4 m that spot 0 meets, one at 13 m for spot 1, a hill at 3 km for 2, and sky."""
    beams = SMALL.lasers.directions
    at = [beam / beam[2] for beam in beams]
    return worlds.scene(
        board("post", *(4.0 * at[0])),
        board("trap", *(13.0 * at[1])),
        board("hill", *(3000.0 * at[2]), half=60.0),
        **options,
    )


def test_truth_of_what_meets_nothing_is_nan_and_of_what_is_far_is_its_range():
    truth = ground_truth(open_world(), SMALL)
    slant = 1 / SMALL.lasers.directions[:, 2]
    np.testing.assert_allclose(truth.spot_range_m, [4, 13, 3000, np.nan] * slant, rtol=1e-6)
    assert truth.spot_object == ("post", "trap", "hill", None)
    sky = truth.object_id == -1
    assert 0.5 < sky.mean() < 1
    for field in (truth.range_m, truth.depth_m, truth.reflectance):
        np.testing.assert_array_equal(np.isnan(field), sky)


@pytest.mark.parametrize("range_m", [3.0, 38.0, 300.0, 3000.0, 9000.0])
def test_light_of_a_wall_at_any_range_is_that_of_the_closed_form(range_m):
    """ρ cos θ A / π r² of a diffuse wall across the axis, cos of the aperture besides."""
    wall = worlds.scene(worlds.plane(range_m, half_size_m=0.5 * range_m))
    light = solve(wall, SMALL, spp=4)
    cosine = SMALL.lasers.directions[:, 2]
    detector = SMALL.tof.detector
    spots = range_m / cosine[:, None] * SMALL.lasers.directions
    back = np.linalg.norm(spots - SMALL.ranging.detector_positions_m, axis=1)
    home = range_m / back  # against the wall's normal
    aperture = np.ones(4) if not SMALL.ranging.shared else home
    expected = 0.5 * home * aperture * detector.aperture_area_m2 / (np.pi * back**2)
    total = light.spot_histogram.sum(axis=1)
    np.testing.assert_allclose(total, expected, rtol=2e-3)
    mean_m = light.spot_histogram @ light.path_length_m / total
    np.testing.assert_allclose(mean_m, range_m / cosine + back, atol=1e-3 + 2e-6 * range_m)
    spread_m = np.sqrt(light.spot_histogram @ light.path_length_m**2 / total - mean_m**2)
    assert spread_m.max() < max(0.05, 5e-4 * range_m)
    assert light.path_length_m.size < 7000


def test_fog_before_a_far_hill_leaves_zeros_and_no_nan():
    fog = {"extinction_per_m": 0.5, "g": 0.8}
    light = solve(open_world(**fog), SMALL, spp=4)
    assert light.dropped == 0
    for values in (light.image, light.image_error, light.spot_histogram):
        assert np.isfinite(values).all()
    assert light.spot_histogram[2, light.path_length_m > 5000].sum() < 1e-30


def test_fog_of_a_far_horizon_shows_near_things_as_without_it():
    """The image of a wall in fog does not know of a hill behind it."""
    fog = {"extinction_per_m": 0.05, "g": 0.8}
    wall = worlds.plane(6.0, half_size_m=30.0)
    hill = board("hill", 0, 0, 5000, half=900.0)
    near, far = (
        solve(worlds.scene(*things, **fog), SMALL, spp=64, seed=3)
        for things in ((wall,), (wall, hill))
    )
    error = np.hypot(near.image_error, far.image_error)
    z = (far.image - near.image) / error
    assert abs(z.mean()) < 5 / np.sqrt(z.size)
    assert np.sqrt(np.mean(z**2)) < 1.6  # 8 estimates each, so that z has wide tails
    np.testing.assert_allclose(
        far.spot_histogram.sum(axis=1), near.spot_histogram.sum(axis=1), rtol=0.02
    )


def test_light_over_other_path_lengths_at_other_times_is_put_together():
    """A hill that comes nearer has other bins at every key time."""
    keys = tuple(
        solve(worlds.scene(worlds.plane(z, half_size_m=200.0)), SMALL, spp=2) for z in (60.0, 90.0)
    )
    ends_s = np.array([0.0, SMALL.frame_time_s])
    whole = spot_light(SMALL, LightSequence(ends_s, keys), 1)
    first, last = (spot_light(SMALL, LightSequence(np.zeros(1), (key,)), 1) for key in keys)
    assert (np.diff(whole.path_length_m) > 0).all()
    for weighted in (lambda light: light.echo_per_s.sum(axis=2), _paths):
        np.testing.assert_allclose(
            weighted(whole), (weighted(first) + weighted(last)) / 2, rtol=1e-4
        )


def _paths(light):
    """Path lengths, each as often as its echo."""
    return light.echo_per_s @ light.path_length_m


@pytest.mark.parametrize("preset", ["paper", "fog", "fog-spad"])
@pytest.mark.parametrize("extinction_per_m", [0.0, 0.04])
def test_an_open_world_goes_through_the_whole_chain(tmp_path, preset, extinction_per_m):
    carried = spisim.load_instrument(preset)
    carried = carried.model_copy(
        update={"projector": carried.projector.model_copy(update={"shape": (16, 16)}),
                "plan": carried.plan.model_copy(update={"patterns": 64})}
    )  # fmt: skip
    scene = open_world(extinction_per_m=extinction_per_m, g=0.8)
    simulation = simulate(scene, carried, spp=8, seed=1)
    path = tmp_path / "open.h5"
    write_capture(simulation.capture, path)
    capture = read_capture(path)
    result = reconstruct(capture)
    metrics = evaluate(result, capture)
    for spots in metrics["spots"].values():
        assert spots[0]["status"] in RANGED
        assert spots[3]["true_m"] is None
        assert spots[3]["error_m"] is None
    if extinction_per_m == 0:
        for ranges in result.rangings.values():
            assert np.isnan(ranges.range_m[2:]).all()
        ranges = result.rangings[capture.spots.method]
        assert ranges.status[2:] == ("no signal", "no signal")
        reported = capture_warnings(capture)
        assert any("spot 3 is too weak" in line for line in reported)
        trapped = result.ranges.valid[1]
        beyond = any("spot 1 lies at 13" in line for line in reported)
        assert beyond == (trapped and preset not in ("fog", "fog-spad"))
    with warnings.catch_warnings():
        warnings.simplefilter("error")
        write_report(
            tmp_path / "open.html",
            capture,
            result,
            metrics=metrics,
            transport=simulation.transport,
        )
    assert not re.search(r">\s*-?nan\b", (tmp_path / "open.html").read_text())


def test_drops_before_the_sky_are_seen_by_the_lasers():
    scene = replace(open_world(), precipitation=(rain(10.0),))
    few = SMALL.model_copy(update={"plan": SMALL.plan.model_copy(update={"patterns": 4})})
    capture = simulate(scene, few, spp=4, seed=0).capture
    assert capture.spots is not None
    assert np.isfinite(capture.spots.readings).all()


def test_fog_without_end_is_bounded():
    air = Atmosphere(0.1, 1.0, henyey_greenstein(0.8), "test")
    near, radius_m = fog_ball(replace(worlds.scene(worlds.plane(5, half_size_m=5)), atmosphere=air))
    assert radius_m < 30
    centre, radius_m = fog_ball(replace(open_world(), atmosphere=air))
    assert radius_m == FOG_DEPTHS / 0.1
    np.testing.assert_array_equal(centre, np.zeros(3))
    assert near[2] == pytest.approx(2.5)
