"""Learned depth of recordings, and when the network is not asked."""

from dataclasses import replace

import numpy as np
import pytest

import worlds
from fourspots import spots_at
from instruments import changed, some_of
from reconstruction import Capture, Reconstructor, write_capture
from reconstruction.capture import Optics, Setup
from reconstruction.cli import main
from reconstruction.depth import (
    DISTANCES_M,
    Context,
    Corridor,
    DepthEstimate,
    View,
    depth_method,
    nearest_obstacle_m,
    pixel_rays,
)
from reconstruction.depth.methods import learned
from reconstruction.depth.network import FEATURES, DepthNetwork, load
from reconstruction.depth.network_input import (
    Anchors,
    NetworkInput,
    four_spots,
    inputs_of,
)
from reconstruction.depth.observer import Observer, brightness_noise
from reconstruction.image import Imaging
from reconstruction.operators import make_plan
from reconstruction.ranging import FogOptics, measure_ranges
from spisim.simulation import simulate


@pytest.fixture(scope="module")
def capture():
    position = worlds.scene(worlds.plane(4.0, 0.5))
    return simulate(position, changed("paper"), light="surrogate", seed=1).capture


def solved(capture: Capture, view=None, setup: Setup | None = None):
    """The learned map and the anchored one, of a view or that of the capture."""
    setup = setup or capture.setup
    context = Context(setup, Imaging(setup.plan))
    view = view or view_of(capture)
    return [depth_method(name, setup).compile(context)(view) for name in ("learned", "anchored")]


def view_of(capture, **changes):
    frame = capture.frame(0)
    result = Reconstructor(capture.setup, image="edge-preserving", depth=())(frame)
    return replace(View(result.image.astype(np.float64), result.ranges, frame), **changes)


def test_a_wall_is_where_it_is(capture):
    result, _ = solved(capture)
    assert result.note is None
    assert np.nanmedian(result.depth_m) == pytest.approx(4.0, rel=0.05)
    assert np.mean(np.isfinite(result.depth_m)) > 0.99
    assert result.sigma.shape == result.no_return.shape == result.depth_m.shape
    assert ((result.no_return >= 0) & (result.no_return <= 1)).all()


def test_a_dark_wall_is_not_taken_for_a_bright_one_beyond_the_unambiguous_range():
    dark = worlds.scene(worlds.plane(5.0, 0.05))
    capture = simulate(dark, changed("fog"), light="surrogate", seed=1).capture
    view = view_of(capture)
    np.testing.assert_allclose(view.ranges.range_m[view.ranges.valid], 5.05, rtol=0.02)
    for result in solved(capture, view):
        assert np.nanmedian(result.depth_m) == pytest.approx(5.0, rel=0.05)
    free = solved(capture, view)[0].free
    assert free[DISTANCES_M > 6.0].max() < 0.5


@pytest.mark.parametrize(
    ("order", "why"),
    [
        ([0, 1, 2], None),
        ([0, 1, 2, 3, 0], None),
        ([0, 3], "spots off a line = 0, trained for"),
        ([1], "spots off a line = 0, trained for"),
    ],
)
def test_the_network_is_asked_about_three_spots_or_more(capture, order, why):
    some = replace(capture, spots=some_of(capture.spots, order), truth=None)
    result, plain = solved(some, view_of(some))
    if why is None:
        assert result.note is None
        assert np.nanmedian(result.depth_m) == pytest.approx(4.0, rel=0.05)
    else:
        assert f"anchored on the spots, not learned: {why}" in result.note
        np.testing.assert_array_equal(result.depth_m, plain.depth_m)
    assert result.free is not None or why


def test_a_spot_that_is_missing_looks_like_one_of_unknown_range(capture):
    """To the numbers that the network gets: three spots, or four of which one has no range."""
    three = replace(capture, spots=some_of(capture.spots, [0, 1, 2]), truth=None)
    unknown = np.arange(4) == 3
    frames = [Observer.of(each.setup)(view_of(each)) for each in (three, capture)]
    result, expected = (
        inputs_of(
            replace(
                frame,
                plain=Anchors(*(np.where(unknown[:count], np.nan, each) for each in frame.plain)),
                fitted=Anchors(*(np.full(count, np.nan),) * 2),
                extinction_per_m=np.nan,
            )
        ).numbers
        for frame, count in zip(frames, (3, 4), strict=True)
    )
    np.testing.assert_allclose(result, expected, atol=5e-3)


def test_reflectance_is_that_of_the_wall(capture):
    view = view_of(capture)
    result = Observer.of(capture.setup)(view)
    cosines = view.frame.spots.directions[:, 2]
    # By one frequency the air is not known to be clear, which takes ranges off by some per cent.
    np.testing.assert_allclose(np.exp(result.log_reflectance), 0.5 * cosines, rtol=0.12)
    assert result.max_range_m == pytest.approx(10.0, rel=1e-3)


def test_light_lost_in_known_fog_is_put_back_on_the_way_out_and_back(capture):
    view = view_of(capture)
    plain = measure_ranges(capture.spots)
    result = [
        Observer.of(capture.setup)(
            replace(view, ranges=replace(plain, fog=FogOptics(extinction_per_m, 1e-3, 0.1)))
        ).log_reflectance
        for extinction_per_m in (0.0, 0.05)
    ]
    np.testing.assert_allclose(result[1] - result[0], 2 * 0.05 * plain.range_m, rtol=1e-6)


def test_ranges_that_know_of_fog_are_not_made_again(capture):
    view = view_of(capture)
    fog = FogOptics(0.05, 1e-3, 0.1)
    plain = measure_ranges(capture.spots)
    reported = replace(plain, range_m=plain.range_m * 1.5, fog=fog)
    result = Observer.of(capture.setup)(replace(view, ranges=reported))
    np.testing.assert_allclose(result.fitted.log_depth - result.plain.log_depth, np.log(1.5))
    assert result.extinction_per_m == 0.05
    unsure = replace(reported, fog=fog._replace(log_sigma=0.6))
    result = Observer.of(capture.setup)(replace(view, ranges=unsure))
    assert np.isnan(result.extinction_per_m)


def test_what_is_unlike_all_it_learned_from_gets_the_anchored_map(capture, monkeypatch):
    with np.load(learned.WEIGHTS, allow_pickle=False) as weights:
        strict = DepthNetwork(dict(weights) | {"limits": np.zeros((2, len(FEATURES)))})
    monkeypatch.setattr(learned, "shipped", lambda: strict)
    result, plain = solved(capture)
    assert "anchored on the spots, not learned: patterns over pixels = " in result.note
    assert result.no_return is None
    np.testing.assert_array_equal(result.depth_m, plain.depth_m)


def test_patterns_are_counted_not_their_exposures(capture):
    """512 patterns with their complements are 12.5 % of 64 × 64 pixels, not 25 %."""
    for polarity in ("differential", "single-ended"):
        setup = replace(capture.setup, plan=make_plan((64, 64), 512, polarity=polarity))
        assert depth_method("learned", setup).out_of_distribution(setup) is None
        assert Observer.of(setup).fraction == 1 / 8


COLLINEAR = spots_at([[-0.6, 0.1], [-0.2, 0.1], [0.2, 0.1], [0.6, 0.1]])
OUTSIDE = spots_at([[-0.5, -0.5], [0.5, -0.5], [-0.5, 0.5], [1.6, 0.5]])


@pytest.mark.parametrize(
    ("towards", "said"), [(COLLINEAR, "spots off a line = "), (OUTSIDE, "farthest spot = ")]
)
def test_spots_in_a_line_or_outside_the_image_are_told(capture, towards, said):
    spots = replace(capture.spots, directions=towards)
    moved = replace(capture, spots=spots)
    result, plain = solved(moved, view_of(moved))
    assert f"not learned: {said}" in result.note
    np.testing.assert_array_equal(result.depth_m, plain.depth_m)


@pytest.mark.parametrize(
    "change",
    [{"tan_half_width": 1.2, "tan_half_height": 1.2}, {"tan_half_width": 0.02}],
)
def test_fields_that_it_never_saw_are_told(capture, change):
    wide = replace(capture, optics=replace(capture.optics, **change))
    result, _ = solved(wide, view_of(wide))
    assert "not learned: " in result.note


def without_noise(capture):
    """A recording that does not state how many electrons a count is."""
    unknown = replace(capture.buckets, electrons_per_count=np.nan, noise_electrons=np.nan)
    return replace(capture, buckets=unknown)


@pytest.fixture(scope="module")
def sky():
    """Nothing within a kilometre."""
    far = worlds.scene(worlds.plane(1e3))
    return simulate(far, changed("fog"), light="surrogate", seed=1).capture


def without_map(capture, image):
    result, _ = solved(capture, view_of(capture, image=image))
    return np.isnan(result.depth_m).all() and result.free is None and result.note


@pytest.mark.parametrize("of", ["capture", "sky", "noise"])
def test_a_dark_image_that_is_no_open_sky_has_no_map(of, capture, sky):
    """One with echoes, one darker than noise explains, and one of unknown noise."""
    why = "no depth; not learned: the image is dark"
    if of == "capture":
        assert without_map(capture, np.zeros((64, 64))) == why
    elif of == "sky":
        noise = brightness_noise(view_of(sky))
        assert without_map(sky, np.full((64, 64), -2 * learned.DARK_SIGMAS * noise)) == why
    else:
        silent = without_noise(sky)
        assert without_map(silent, np.full((64, 64), -1e-3)) == why


@pytest.mark.parametrize("sigmas", [None, -1.0, 0.0])
def test_open_sky_has_no_depth_but_free_corridors(sigmas, sky):
    view = view_of(sky)
    if sigmas is not None:
        view = replace(view, image=np.full((64, 64), sigmas * brightness_noise(view)))
    assert not view.ranges.valid.any()
    result, _ = solved(sky, view)
    assert np.isnan(result.depth_m).all()
    assert result.note == f"no spot has a range: no depth; {learned.DARK_NOTE}"
    for free in (result.free, result.free_towards([0.1, 0.0, 1.0])):
        assert free[DISTANCES_M < 4.0].min() > 0.9
    whole = Reconstructor(sky.setup)(sky.frame(0))
    assert whole.free_probability[DISTANCES_M > 1.0].max() <= 0.5  # or the lens is covered
    assert np.median(result.no_return) > 0.2


def test_there_is_none_without_spots(capture):
    result, _ = solved(capture, view_of(capture, ranges=None))
    assert result is None


def test_other_kinds_of_spots_get_the_anchored_map():
    position = worlds.scene(worlds.plane(4.0, 0.5))
    capture = simulate(position, changed("spad"), light="surrogate", seed=1).capture
    result, plain = solved(capture)
    assert "not learned: trained for continuous-wave spots only" in result.note
    np.testing.assert_array_equal(result.depth_m, plain.depth_m)


@pytest.mark.parametrize("content", [None, b"weights"])
def test_weights_that_are_missing_or_none_are_told(capture, tmp_path, monkeypatch, content):
    file = tmp_path / "learned.npz"
    if content is not None:
        file.write_bytes(content)
    monkeypatch.setattr(learned, "shipped", lambda: load(file))
    result, plain = solved(capture)
    assert "contains no network weights" in result.note
    np.testing.assert_array_equal(result.depth_m, plain.depth_m)


def test_it_is_the_usual_method_of_recordings_like_those_learned_from(capture, monkeypatch):
    usual = ["learned", "anchored", "nearest"]
    assert list(Reconstructor(capture.setup, depth="usual")(capture.frame(0)).depths) == usual
    monkeypatch.setattr(learned, "WEIGHTS", learned.WEIGHTS.with_name("missing.npz"))
    learned.shipped.cache_clear()
    assert list(Reconstructor(capture.setup, depth="usual")(capture.frame(0)).depths) == usual[1:]
    learned.shipped.cache_clear()


def test_who_reconstructs_is_told_why_it_is_left_out(capture, tmp_path, capsys):
    spots = replace(capture.spots, directions=COLLINEAR)
    write_capture(replace(capture, spots=spots), tmp_path / "line.h5")
    reported = [str(tmp_path / "line.h5"), "-o", str(tmp_path / "told")]
    assert main(reported) == 0
    assert "depth, learned: not for this recording (spots off a line = " in capsys.readouterr().out
    assert (
        main([str(tmp_path / "line.h5"), "-o", str(tmp_path / "told"), "--depth", "nearest"]) == 0
    )
    assert "learned" not in capsys.readouterr().out


def test_measured_depths_join_by_inverse_variance():
    ours = DepthEstimate(
        np.array([[2.0, 5.0, 3.0]]), np.array([[0.2, 0.2, 0.2]]), np.array([[0.1, 0.9, 0.1]])
    )
    measured = DepthEstimate(np.array([[4.0, 5.0, np.nan]]), np.array([[0.1, 0.1, np.nan]]))
    result = learned.fused(ours, measured)
    total = 1 / 0.04 + 1 / 0.01
    mean = (np.log(2) / 0.04 + np.log(4) / 0.01) / total
    np.testing.assert_allclose(result.depth_m, [[np.exp(mean), 5.0, 3.0]])
    np.testing.assert_allclose(result.sigma, [[total**-0.5, total**-0.5, 0.2]])
    np.testing.assert_allclose(result.no_return, [[0.1, learned.MAX_NO_RETURN, 0.1]])


def test_the_corridor_is_judged_by_all_depths_and_their_deviations(capture):
    outcome, plain = solved(capture)
    assert plain.free is None
    assert outcome.free.shape == DISTANCES_M.shape
    result = Reconstructor(capture.setup, image="edge-preserving")(capture.frame(0))
    assert (result.free_probability <= outcome.free + 1e-6).all()
    assert result.obstacle_m == pytest.approx(nearest_obstacle_m(outcome.free), rel=0.05)
    corridor = Corridor(pixel_rays(capture.setup.optics, outcome.depth_m.shape))
    map_m = corridor.nearest_m(np.exp(np.log(outcome.depth_m)))
    assert nearest_obstacle_m(outcome.free, 0.5) == pytest.approx(map_m, rel=0.3)


def of_directions(capture, directions):
    """Spots that all meet the wall, which is 4 m away."""
    order = np.arange(len(directions)) % 4
    directions = np.asarray(directions, float) / np.linalg.norm(directions, axis=1, keepdims=True)
    spots = replace(some_of(capture.spots, order.tolist()), directions=directions)
    return replace(capture, spots=spots, truth=None)


def test_of_many_spots_the_network_sees_four_and_the_others_correct_its_map(capture):
    x, y = np.meshgrid([-0.12, -0.04, 0.04, 0.12], [-0.12, -0.04, 0.04, 0.12])
    many = of_directions(capture, np.stack([x.ravel(), y.ravel(), np.ones(16)], axis=1))
    four = of_directions(capture, many.spots.directions[[0, 3, 12, 15]])
    maps = [solved(each, view_of(each))[0] for each in (four, many)]
    assert maps[1].note is None
    assert np.nanmedian(maps[1].depth_m) == pytest.approx(4.0, rel=0.05)
    assert np.nanmedian(maps[1].sigma) < np.nanmedian(maps[0].sigma)


@pytest.mark.parametrize("lost", [[], [5, 10], [0, 1, 2, 5, 8]])
def test_the_four_are_those_with_ranges_next_to_the_middles_of_the_quarters(lost):
    row, column = np.mgrid[:4, :4].reshape(2, -1)
    pixel = np.stack([16 * row + 7.6 + row % 2, 16 * column + 7.5], axis=1)
    weight = np.ones(16)
    weight[lost] = 0
    result = four_spots(pixel, weight, (64, 64))
    assert len(set(result.tolist())) == 4
    assert not set(lost) & set(result.tolist())
    middles = 16 + 32 * np.array([(0, 0), (0, 1), (1, 0), (1, 1)])
    assert np.abs(pixel[result] + 0.5 - middles).max() < 17


def test_up_to_four_spots_are_all_taken():
    assert four_spots(np.zeros((3, 2)), np.zeros(3), (64, 64)).tolist() == [0, 1, 2]


@pytest.mark.parametrize(("ranged", "lost"), [(32, 2), (4, 3), (1, 3)])
def test_of_many_spots_some_without_an_echo_are_among_the_four_but_never_all(ranged, lost):
    """8 x 8 spots of which those below have ranges, those above do not."""
    y, x = np.mgrid[0.16:-0.16:8j, -0.16:0.16:8j].reshape(2, -1)
    directions = np.stack([x, y, np.ones(64)], axis=1)
    known = np.arange(64) < ranged
    anchors = Anchors(np.where(known, np.log(5.0), np.nan), np.where(known, 0.01, np.nan))
    frame = NetworkInput(
        image=np.ones((64, 64)),
        optics=Optics(0.18, 0.18),
        directions=directions / np.linalg.norm(directions, axis=1, keepdims=True),
        plain=anchors,
        fitted=anchors,
        lost=~known,
        log_reflectance=np.full(64, -1.0),
        noise=0.03,
        fraction=0.03,
        max_range_m=10.0,
    )
    few = learned.with_four_spots(frame)
    assert few.ranged
    assert few.lost.sum() == lost
