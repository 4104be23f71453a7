"""The compiled reconstruction: the same per frame, in a batch, and as one call; its methods."""

import gc
from dataclasses import replace
from weakref import ref

import numpy as np
import pytest

from captures import full_capture, make_spots
from images import natural_image
from reconstruction import (
    Capture,
    InputError,
    Reconstructor,
    first_patterns,
    make_plan,
    reconstruct,
)
from reconstruction.depth import DEPTH_METHODS, DepthEstimate
from reconstruction.image import IMAGE_METHODS, Estimate, Imaging
from reconstruction.operators import expose
from reconstruction.ranging import RANGING_METHODS, Ranges, ranging_method

USUAL = dict.fromkeys(("image", "ranging", "depth"), "usual")
"""Methods that `reconstruct` takes."""


def frames_of(capture: Capture, frames: int) -> Capture:
    """Frames that differ in light and noise, the second with saturated readings."""
    rng = np.random.default_rng(0)
    assert capture.spots is not None
    counts = np.concatenate([capture.buckets.counts * (1 + k) for k in range(frames)])
    saturated = np.zeros(counts.shape, dtype=bool)
    saturated[1, 20:30] = True
    taps = np.concatenate([capture.spots.taps] * frames)
    return replace(
        capture,
        buckets=replace(
            capture.buckets, counts=counts + rng.normal(0, 50, counts.shape), saturated=saturated
        ),
        spots=replace(
            capture.spots,
            taps=taps + rng.normal(0, 300, taps.shape),
            saturated=np.zeros(taps.shape, dtype=bool),
        ),
        truth=None,
    )


def assert_alike(result, expected):
    """Two results have the same methods in the same order, and the same numbers."""
    for name in ("unit", "recording", "frame", "patterns"):
        assert getattr(result, name) == getattr(expected, name)
    for group in ("images", "depths"):
        one, other = getattr(result, group), getattr(expected, group)
        assert list(one) == list(other)
        for name in one:
            assert one[name].dtype == np.float32
            np.testing.assert_array_equal(one[name], other[name], err_msg=name)
    assert list(result.rangings) == list(expected.rangings)
    for name, ranges in result.rangings.items():
        assert ranges.status == expected.rangings[name].status
        np.testing.assert_array_equal(ranges.range_m, expected.rangings[name].range_m)
        np.testing.assert_array_equal(ranges.sigma_m, expected.rangings[name].sigma_m)
    assert result.timings_s.keys() == expected.timings_s.keys()


# Frame by frame


def test_called_per_frame_in_any_order_it_equals_the_function(capture):
    several = frames_of(capture, 4)
    reconstructor = Reconstructor(several.setup, **USUAL)
    for frame in (2, 0, 1, 3, 1):
        assert_alike(reconstructor(several.frame(frame)), reconstruct(several, frame))


def test_a_batch_equals_single_calls(capture):
    several = frames_of(capture, 4)
    reconstructor = Reconstructor(several.setup, image="all", depth="all")
    batch = reconstructor.batch(several.batch(1, 4))
    assert [result.frame for result in batch] == [1, 2, 3]
    for result in batch:
        assert_alike(result, reconstructor(several.frame(result.frame)))
    with pytest.raises(InputError, match="got 3 frames, expected one; `batch` takes several"):
        reconstructor(several.batch(1, 4))


def test_a_batch_of_least_squares_is_a_product_for_all_frames(capture):
    several = frames_of(capture, 40)
    reconstructor = Reconstructor(several.setup, image="least-squares", ranging=(), depth=())
    for result in reconstructor.batch(several.batch(0, 40)):
        alone = reconstructor(several.frame(result.frame))
        for outcome, expected in ((result.image, alone.image), (result.sigma, alone.sigma)):
            np.testing.assert_allclose(outcome, expected, rtol=1e-5, atol=1e-5 * alone.image.max())


def test_frames_and_captures_of_all_kinds_are_reconstructed_alike():
    whole = full_capture()
    for capture in (whole, *(replace(whole, spots=make_spots(m)) for m in ("pulsed", "dtof"))):
        reconstructor = Reconstructor(capture.setup, **USUAL)
        for frame in (0, 1):
            assert_alike(reconstructor(capture.frame(frame)), reconstruct(capture, frame))


def test_results_follow_the_readings_of_their_frame(capture):
    several = frames_of(capture, 3)
    first, second, third = Reconstructor(several.setup).batch(several.batch(0, 3))
    assert third.image.mean() == pytest.approx(3 * first.image.mean(), rel=0.01)
    assert second.patterns == several.plan.sampled - 5
    assert first.patterns == third.patterns == several.plan.sampled
    assert len({result.recording for result in (first, second, third)}) == 3


def test_a_setup_serves_another_recording_of_the_same_instrument(capture):
    one, other = frames_of(capture, 2), frames_of(capture, 3)
    assert_alike(Reconstructor(one.setup, **USUAL)(other.frame(2)), reconstruct(other, 2))


@pytest.mark.parametrize("lost", [1, 10])
def test_a_failed_reading_takes_no_compiling(capture, lost):
    """All that is compiled serves whichever readings are usable; nothing is kept of them."""
    plan = capture.plan
    imaging = Imaging(plan)
    every = np.ones(plan.exposures, dtype=bool)
    first = imaging.of(every)
    for k in range(1, 6):
        without = every.copy()
        without[k : k + lost] = False
        result = imaging.of(without)
        assert result.decoder is first.decoder
        assert result.solver("edge-preserving") is first.solver("edge-preserving")
        assert result.patterns < first.patterns


@pytest.mark.parametrize("lost", [1, 10, 60])
def test_with_failed_readings_an_image_is_that_of_a_plan_without_them(lost):
    """Whatever the failed readings hold, up to how contrasts are averaged over."""
    image = natural_image(32, 4)
    plan = make_plan((32, 32), 128, polarity="signed")
    rng = np.random.default_rng(lost)
    variance = np.full(plan.exposures, (0.02 * np.ptp(image) * 32) ** 2)
    signal = expose(plan, image) + np.sqrt(variance) * rng.standard_normal(plan.exposures)
    usable = np.ones(plan.exposures, dtype=bool)
    usable[1 + rng.choice(plan.exposures - 1, lost, replace=False)] = False
    outliers = np.where(usable, signal, 1e9)
    some = Imaging(plan).of(usable)
    fewer = Imaging(plan.only(usable)).of(usable[usable])
    assert some.patterns == fewer.patterns == plan.exposures - lost
    for method in ("least-squares", "zero-filled", "pursuit", "total-variation"):
        result, expected = (
            readings.solver(method)(readings.decode(*reported))
            for readings, reported in (
                (some, (outliers, variance)),
                (fewer, (signal[usable], variance[usable])),
            )
        )
        error = np.abs(result.image - expected.image).max() / np.ptp(expected.image)
        assert error < 0.01, method
        if expected.sigma is not None:
            np.testing.assert_allclose(result.sigma, expected.sigma, rtol=0.02)


def test_what_is_compiled_goes_with_its_reconstructor(capture):
    reconstructor = Reconstructor(capture.setup, image="least-squares", ranging=(), depth=())
    operator = ref(reconstructor._imaging.of(capture.buckets.usable[0]).decoder.operator)
    reconstructor(capture.frame(0))
    del reconstructor
    gc.collect()
    assert operator() is None


# Methods by name


def test_the_usual_methods_are_those_that_fit(capture):
    result = reconstruct(capture)
    assert list(result.images) == ["edge-preserving", "pursuit", "zero-filled"]
    assert list(result.rangings) == ["cw"]
    assert list(result.depths) == ["anchored", "nearest"]
    assert result.image is result.images["edge-preserving"]
    assert result.depth_m is result.depths["anchored"]
    alone = Reconstructor(capture.setup)(capture.frame(0))
    assert list(alone.images) == ["edge-preserving", "zero-filled"]
    assert (list(alone.rangings), list(alone.depths)) == (["cw"], ["anchored"])
    bare = reconstruct(replace(capture, spots=None, optics=None, truth=None))
    assert bare.rangings == bare.depths == {}
    assert bare.ranges is bare.depth_m is bare.range_m is bare.range_over_depth is None


@pytest.mark.parametrize(
    ("image", "names"),
    [
        ("zero-filled", ["zero-filled"]),
        (["zero-filled", "pursuit", "zero-filled"], ["zero-filled", "pursuit"]),
        ("pursuit:dct", ["pursuit:dct", "zero-filled"]),
        (("pursuit", "pursuit:dct"), ["pursuit", "pursuit:dct", "zero-filled"]),
    ],
)
def test_image_methods_are_chosen_by_name_the_first_is_the_default_the_plain_one_is_there(
    capture, image, names
):
    result = reconstruct(capture, image=image)
    assert list(result.images) == names
    assert result.image is result.images[names[0]]
    usual = reconstruct(capture).images
    for name, outcome in result.images.items():
        np.testing.assert_array_equal(outcome, usual[name.partition(":")[0]])


def test_all_are_all_that_there_are_the_usual_first(capture):
    result = reconstruct(capture, image="all", ranging="all", depth="all")
    assert list(result.images)[:3] == ["edge-preserving", "pursuit", "zero-filled"]
    assert set(result.images) == set(IMAGE_METHODS) - {"recursive"}  # which needs earlier frames
    assert next(iter(result.rangings)) == "cw"
    assert list(result.depths)[:2] == ["anchored", "nearest"]  # of unlike recordings not learned
    assert "dense" not in result.depths  # there are no taps of every pattern


def test_depth_methods_are_chosen_by_name_the_first_is_the_default(capture):
    result = reconstruct(capture, depth=("nearest", "anchored"), ranging="cw")
    usual = reconstruct(capture)
    assert list(result.depths) == ["nearest", "anchored"]
    np.testing.assert_array_equal(result.depth_m, usual.depths["nearest"])
    assert reconstruct(capture, depth=()).depths == {}
    without = reconstruct(capture, ranging=())
    assert without.rangings == without.depths == {}


@pytest.mark.parametrize(
    ("methods", "message"),
    [
        ({"image": "persuit"}, "unknown image method 'persuit': did you mean 'pursuit'"),
        ({"image": ["pursuit", "zero_filled"]}, "'zero_filled': did you mean 'zero-filled'"),
        ({"image": "pursuit:dtc"}, "unknown dictionary 'dtc': did you mean 'dct'"),
        ({"image": "pursuit:"}, "unknown dictionary ''"),
        ({"image": "zero-filled:dct"}, "'zero-filled' uses no dictionary, got 'dct'"),
        ({"image": ()}, "no image method is named"),
        ({"ranging": "pulsd"}, "unknown ranging method 'pulsd': did you mean 'pulsed'"),
        ({"ranging": "pulsed"}, "'pulsed' reads 'pulsed' spots, not those of 'cw'; allowed: cw"),
        ({"depth": "nearst"}, "unknown depth method 'nearst': did you mean 'nearest'"),
        ({"depth": ["anchored", "dense"]}, "depth method 'dense' needs pattern taps, which the"),
    ],
)
def test_methods_that_there_are_not_or_that_do_not_suit_are_refused(capture, methods, message):
    with pytest.raises(InputError, match=message):
        Reconstructor(capture.setup, **methods)


def test_what_a_depth_method_needs_is_told(capture):
    bare = replace(capture, spots=None, optics=None, truth=None)
    for method in ("anchored", "nearest"):
        with pytest.raises(InputError, match=f"'{method}' needs optics and spots, which the rec"):
            reconstruct(bare, depth=method)
    with pytest.raises(InputError, match="'anchored' needs optics, which"):
        reconstruct(replace(capture, optics=None), depth="anchored")


@pytest.mark.parametrize(
    ("method", "fitting", "enough"),
    [
        ("cw", "cw, fog, fog-carried", ["cw"]),
        ("pulsed", "fog, fog-carried, pulsed", ["pulsed"]),
        ("dtof", "dtof, fog, fog-carried, returns", ["dtof", "returns"]),
    ],
)
def test_ranging_methods_read_their_own_kind(method, fitting, enough):
    capture = replace(full_capture(), spots=make_spots(method))
    assert list(reconstruct(capture, ranging="all").rangings) == enough
    for other in {"cw", "pulsed", "dtof"} - {method}:
        with pytest.raises(InputError, match=f"not those of '{method}'; allowed: {fitting}$"):
            ranging_method(other, capture.spots)


def test_all_rangings_are_those_that_know_enough(capture):
    assert list(reconstruct(capture, ranging="all").rangings) == ["cw"]
    with pytest.raises(InputError, match="spots/detector_axes is unknown"):
        reconstruct(capture, ranging="fog")


def test_an_unknown_ranging_method_is_told_even_without_spots(capture):
    with pytest.raises(InputError, match="unknown ranging method 'cv'"):
        reconstruct(replace(capture, spots=None), ranging="cv")


# Methods of others


class Giving:
    """A method of any station that gives what it is told to give."""

    title = "test"
    needs = ()

    def __init__(self, value):
        self.value = value

    def compile(self, *_):
        return lambda *_: self.value


def register(monkeypatch, registry, **methods):
    for name, method in methods.items():
        monkeypatch.setitem(registry._loaded, name, method)


def depths(depth_m=1.0, **reported):
    return DepthEstimate(
        depth_m * np.ones((16, 16)) if np.isscalar(depth_m) else depth_m, **reported
    )


GREY = np.full((16, 16), 3, dtype=np.int16)


def test_methods_of_others_stand_beside_ours(capture, monkeypatch):
    register(monkeypatch, IMAGE_METHODS, grey=Giving(Estimate(GREY)))
    nowhere = DepthEstimate(np.full((16, 16), np.nan), no_return=np.ones((16, 16)), note="all sky")
    register(monkeypatch, DEPTH_METHODS, nowhere=Giving(nowhere), never=Giving(None))
    result = reconstruct(capture, image=["grey", "pursuit"], depth=["nowhere", "never", "anchored"])
    assert list(result.images) == ["grey", "pursuit", "zero-filled"]
    assert (result.image == 3).all()
    assert result.image.dtype == np.float32
    assert list(result.depths) == ["nowhere", "anchored"]
    assert np.isnan(result.depth_m).all()
    assert (result.no_return == 1).all()
    assert result.log_depth_sigma is None
    assert result.warnings == ["depth 'nowhere' is all sky"]
    assert {"image grey", "depth never"} <= result.timings_s.keys()


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (
            np.ones((16, 15)),
            r"returned float64 of shape \(16, 15\); expected real numbers of shape \(16, 16\)",
        ),
        (np.ones(256), r"returned float64 of shape \(256,\)"),
        (np.ones((16, 16)) * 1j, r"returned complex128 of shape \(16, 16\); expected real numbers"),
        (np.ones((16, 16), dtype=bool), "returned bool of shape"),
        (None, r"returned object of shape \(\)"),
        (np.where(np.eye(16) > 0, np.nan, 1.0), "returned values that are not finite"),
        (np.where(np.eye(16) > 0, np.inf, 1.0), "returned values that are not finite"),
    ],
)
def test_an_image_method_that_gives_no_image_is_named(capture, monkeypatch, value, message):
    register(monkeypatch, IMAGE_METHODS, odd=Giving(Estimate(value)))
    with pytest.raises(InputError, match=f"image method 'odd' {message}"):
        reconstruct(capture, image=["pursuit", "odd"])


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.ones((16, 16)), "returned ndarray, not an Estimate"),
        (Estimate(np.ones((16, 16)), np.ones(16)), r"as sigma, returned .* shape \(16,\)"),
        (Estimate(np.ones((16, 16)), np.full((16, 16), np.inf)), "not finite"),
    ],
)
def test_an_image_method_that_gives_no_estimate_is_named(capture, monkeypatch, value, message):
    register(monkeypatch, IMAGE_METHODS, odd=Giving(value))
    with pytest.raises(InputError, match=f"image method 'odd'.* {message}"):
        reconstruct(capture, image="odd")


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.ones((16, 16)), "returned ndarray, not a DepthEstimate"),
        (
            depths(np.ones((15, 16))),
            r"returned float64 of shape \(15, 16\); expected real numbers of shape \(16, 16\)",
        ),
        (depths(np.ones((16, 16)) * 1j), r"returned complex128 of shape \(16, 16\)"),
        (depths(np.full((16, 16), "far")), r"returned <U3 of shape"),
        (depths(np.full((16, 16), np.inf)), "returned values that are not finite"),
        (depths(np.zeros((16, 16))), "returned a depth of 0 m"),
        (depths(sigma=np.ones(16)), r"as sigma, returned .* shape \(16,\)"),
        (depths(sigma=np.full((16, 16), -0.1)), "a sigma that is negative or nan"),
        (depths(sigma=np.full((16, 16), np.nan)), "a sigma that is negative or nan"),
        (depths(no_return=np.ones((1, 16))), r"as no_return, returned .* shape \(1, 16\)"),
        (depths(no_return=np.full((16, 16), 1.1)), "probabilities of no return outside 0..1"),
        (depths(no_return=np.full((16, 16), np.nan)), "probabilities of no return outside 0..1"),
    ],
)
def test_a_depth_method_that_gives_no_depths_is_named(capture, monkeypatch, value, message):
    register(monkeypatch, DEPTH_METHODS, odd=Giving(value))
    with pytest.raises(InputError, match=f"depth method 'odd'.* {message}"):
        reconstruct(capture, depth="odd")


def test_where_there_is_no_depth_there_is_no_deviation(capture, monkeypatch):
    half = np.where(np.arange(16) < 8, 3.0, np.nan) * np.ones((16, 1))
    register(monkeypatch, DEPTH_METHODS, half=Giving(depths(half, sigma=np.full((16, 16), 0.1))))
    result = reconstruct(capture, depth="half")
    np.testing.assert_array_equal(np.isfinite(result.log_depth_sigma), np.isfinite(half))


def ranges(**changes):
    values = {
        "range_m": np.ones(4),
        "sigma_m": np.ones(4),
        "signal_electrons": np.ones(4),
        "background_electrons": np.ones(4),
        "status": ("ok",) * 4,
    }
    return Ranges(**values | changes)


@pytest.mark.parametrize(
    ("value", "message"),
    [
        (np.ones(4), "returned ndarray, not ranges of 4 spot"),
        (None, "returned NoneType, not ranges of 4 spot"),
        (ranges(status=("ok",) * 3), "not ranges of 4 spot"),
        (ranges(range_m=np.ones(3)), "not ranges of 4 spot"),
        (ranges(sigma_m=np.ones((4, 2))), "not ranges of 4 spot"),
        (ranges(alternatives=((),) * 3), "not ranges of 4 spot"),
        (ranges(range_m=np.array([1, np.nan, 1, 1])), "a range that is not finite as 'ok'"),
    ],
)
def test_a_ranging_method_that_gives_no_ranges_is_named(capture, monkeypatch, value, message):
    method = Giving(value)
    method.reads = type(capture.spots)
    register(monkeypatch, RANGING_METHODS, odd=method)
    with pytest.raises(InputError, match=f"ranging method 'odd' .*{message}"):
        reconstruct(capture, ranging="odd")


def test_a_range_may_be_missing_where_its_status_says_so(capture, monkeypatch):
    method = Giving(
        ranges(range_m=np.array([1, np.nan, 1, 1]), status=("ok", "no signal", "ok", "ok"))
    )
    method.reads = type(capture.spots)
    register(monkeypatch, RANGING_METHODS, new=method)
    result = reconstruct(capture, ranging=["new", "cw"])
    assert list(result.rangings) == ["new", "cw"]
    assert result.ranges is method.value
    assert set(np.unique(result.depths["nearest"] * result.range_over_depth).round(6)) == {1.0}


def test_a_method_that_cannot_use_the_patterns_is_refused_by_name_and_left_out_of_all(
    capture, monkeypatch
):
    class Choosy:
        title = "choosy"

        def compile(self, operator):
            raise InputError("image method 'choosy' needs patterns of another basis")

    register(monkeypatch, IMAGE_METHODS, choosy=Choosy())
    monkeypatch.setitem(IMAGE_METHODS._sources, "choosy", [])
    with pytest.raises(InputError, match="'choosy' needs patterns of another basis"):
        reconstruct(capture, image="choosy")
    assert "choosy" not in reconstruct(capture, image="all").images


# Noise


def noisy(plan, sigma):
    """Readings of an image with noise, and the variance of each."""
    image = 1e3 * natural_image(32, 6)
    variance = np.full(plan.exposures, sigma**2)
    readings = expose(plan, image) + np.random.default_rng(7).normal(0, sigma, plan.exposures)
    return image, readings, variance


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_one_unknown_variance_does_not_switch_off_the_denoising(polarity):
    plan = make_plan((32, 32), polarity=polarity)
    image, readings, variance = noisy(plan, 8e3)
    usable = Imaging(plan).of(np.ones(plan.exposures, dtype=bool))

    def error(variance):
        result = usable.solver("pursuit")(usable.decode(readings, variance)).image
        return np.sqrt(np.mean((result - image) ** 2))

    one_unknown = variance.copy()
    one_unknown[5] = np.nan
    given, unknown = usable.decode(readings, variance), usable.decode(readings, one_unknown)
    np.testing.assert_allclose(unknown.noise, given.noise, rtol=1e-9)
    np.testing.assert_allclose(unknown.values, given.values, rtol=1e-9)
    assert error(variance) < 0.8 * error(np.zeros(plan.exposures))
    assert error(one_unknown) == pytest.approx(error(variance))


@pytest.mark.parametrize("polarity", ["differential", "single-ended", "signed"])
def test_noise_of_which_nothing_is_known_is_estimated(polarity):
    plan = make_plan((32, 32), polarity=polarity)
    _, readings, variance = noisy(plan, 8e3)
    usable = Imaging(plan).of(np.ones(plan.exposures, dtype=bool))
    given = usable.decode(readings, variance)
    result = usable.decode(readings, np.full_like(variance, np.nan))
    assert np.median(result.noise / given.noise) == pytest.approx(1, abs=0.15)


def test_an_unknown_variance_is_the_median_of_the_others():
    plan = make_plan((8, 8), polarity="signed")
    variance = np.linspace(1, 9, plan.exposures)
    usable = Imaging(plan).of(np.ones(plan.exposures, dtype=bool))
    signal = np.arange(64.0)
    unknown = variance.copy()
    unknown[[3, 60]] = np.nan
    reported = unknown.copy()
    reported[[3, 60]] = np.nanmedian(unknown)
    result, expected = usable.decode(signal, unknown), usable.decode(signal, reported)
    np.testing.assert_array_equal(result.noise, expected.noise)


def test_frames_of_another_plan_and_ranging_without_spots_are_refused():
    capture = full_capture()
    reconstructor = Reconstructor(capture.setup)
    with pytest.raises(InputError, match=r"18 exposures.* compiled for 20"):
        reconstructor(first_patterns(capture, 9).frame(0))
    with pytest.raises(InputError, match="ranging method 'cw' needs spots"):
        Reconstructor(replace(capture, spots=None).setup, ranging="cw")


@pytest.mark.parametrize(
    ("image", "message"),
    [
        (np.full((4, 8), np.inf), "not finite"),
        (np.full((4, 8), np.nan), "not finite"),
        (np.zeros((8, 4)), r"shape \(8, 4\)"),
    ],
)
def test_images_that_are_none_are_refused_by_the_method_s_name(monkeypatch, image, message):
    class Odd:
        title = "odd"

        def compile(self, operator):
            return lambda coefficients: Estimate(image)

    monkeypatch.setitem(IMAGE_METHODS._loaded, "zero-filled", Odd())
    with pytest.raises(InputError, match=f"'zero-filled' returned .*{message}"):
        reconstruct(full_capture(), image="zero-filled")


def test_a_method_cannot_change_what_the_next_one_gets(monkeypatch):
    class Greedy:
        title = "greedy"

        def compile(self, operator):
            def solve(coefficients):
                coefficients.values[:] = 0
                return operator.min_norm(coefficients.values)

            return solve

    monkeypatch.setitem(IMAGE_METHODS._loaded, "pursuit", Greedy())
    with pytest.raises(ValueError, match="read-only"):
        reconstruct(full_capture(), image=["pursuit", "zero-filled"])


def test_all_may_stand_among_names_and_what_is_no_name_is_told():
    capture = full_capture()
    assert list(reconstruct(capture, image=["zero-filled", "all"]).images)[:3] == [
        "zero-filled",
        "edge-preserving",
        "pursuit",
    ]
    with pytest.raises(InputError, match="image: 3 is neither the name of a method nor a method"):
        Reconstructor(capture.setup, image=3)
    with pytest.raises(InputError, match="got Capture, expected `Frames`"):
        Reconstructor(capture.setup)(capture)


def test_a_status_of_one_s_own_is_refused(monkeypatch):
    class Vague:
        title = "vague"
        reads = type(full_capture().spots)

        def compile(self, *_):
            return lambda *_: Ranges(*np.ones((4, 4)), status=("fine",) * 4)

    monkeypatch.setitem(RANGING_METHODS._loaded, "cw", Vague())
    with pytest.raises(InputError, match="'cw' returned the status 'fine'; allowed: ok"):
        reconstruct(full_capture())
