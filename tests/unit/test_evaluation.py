"""Metrics against truth: known values, gaps in the truth, and numbers that JSON can hold."""

import json
from dataclasses import replace

import numpy as np
import pytest

from reconstruction import (
    Capture,
    InputError,
    Result,
    evaluate,
    first_patterns,
    make_plan,
    reconstruct,
)
from reconstruction.capture import Buckets, FrameTruth, Provenance, Truth
from reconstruction.evaluation import depth_metrics, image_metrics, no_range
from reconstruction.evaluation.comparison import FIGURES
from reconstruction.operators import expose
from reconstruction.ranging import Alternative, Ranges

IMAGE = np.arange(1.0, 9).reshape(2, 4)
TRUTH = FrameTruth(IMAGE, IMAGE / 50, IMAGE, IMAGE, IMAGE, np.array([1.0, 2.0, 3.0, 4.0]))


def make_capture(*truths, frames=1, still=False):
    """Frames of which the next is always twice as bright, with the truths of the first."""
    plan = make_plan((2, 4))
    counts = expose(plan, IMAGE * 2.0 ** np.arange(frames)[:, None, None])
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=counts,
            saturated=np.zeros(counts.shape, dtype=bool),
            exposure_time_s=np.nan,
            pattern_period_s=np.nan,
            electrons_per_count=1.0,
            offset_counts=0.0,
            noise_electrons=0.0,
            excess_noise_factor=1.0,
            dead_time_s=0.0,
        ),
        spots=None,
        optics=None,
        provenance=Provenance("simulation", "test", "", ""),
        truth=Truth.of(truths or [TRUTH], still=still),
    )


CAPTURE = make_capture()


def make_result(**changes):
    ranges = Ranges(
        range_m=np.array([1.5, 2.0, np.nan, 4.0]),
        sigma_m=np.array([0.1, 0.1, np.nan, 0.1]),
        signal_electrons=np.ones(4),
        background_electrons=np.ones(4),
        status=("ok", "ok", "ambiguous", "ok"),
        alternatives=((), (), (Alternative(2.5, 0.1, 0.75), Alternative(3.5, 0.2, 0.25)), ()),
    )
    values = {
        "images": {"pursuit": IMAGE, "zero-filled": IMAGE + 1},
        "sigmas": {},
        "rangings": {"cw": ranges},
        "depths": {"anchored": IMAGE * 1.1, "nearest": IMAGE * 1.5},
        "range_over_depth": None,
        "timings_s": {},
        "unit": "electron",
        "recording": CAPTURE.frame(0).digest(CAPTURE.setup),
        "frame": 0,
        "patterns": 8,
    }
    return Result(**(values | changes))


def test_image_metrics_have_their_textbook_values():
    metrics = image_metrics(IMAGE + 2, IMAGE)
    assert metrics["correlation"] == pytest.approx(1)
    assert metrics["nrmse"] == pytest.approx(2 / np.sqrt(np.mean(IMAGE**2)))
    assert metrics["psnr_db"] == pytest.approx(20 * np.log10(8 / 2))
    assert image_metrics(-IMAGE, IMAGE)["correlation"] == pytest.approx(-1)


def test_gain_is_over_the_better_of_the_plain_and_a_flat_image():
    spread = IMAGE.var()
    for noise, better in ((0.5, 0.25), (2.0, 4.0), (9.0, spread)):
        plain = IMAGE + noise * np.array([1, -1, 1, -1])
        result = image_metrics(IMAGE + 0.25, IMAGE, plain)
        assert result["gain_db"] == pytest.approx(10 * np.log10(better / 0.25**2))
    assert image_metrics(np.full_like(IMAGE, IMAGE.mean()), IMAGE, IMAGE + 9)["gain_db"] == 0
    assert image_metrics(IMAGE + 1, IMAGE)["gain_db"] is None
    figures = evaluate(make_result(), CAPTURE)["images"]
    assert figures["zero-filled"]["gain_db"] == 0
    assert figures["pursuit"]["gain_db"] is None  # it is perfect


def test_perfect_and_featureless_images_have_no_number_where_there_is_none():
    assert image_metrics(IMAGE, IMAGE)["psnr_db"] is None
    assert image_metrics(np.ones((2, 4)), IMAGE)["correlation"] is None


def test_depth_metrics_have_their_textbook_values():
    metrics = depth_metrics(np.array([1.1, 2.2, 6.0]), np.array([1.0, 2.0, 3.0]))
    assert metrics["mae_m"] == pytest.approx((0.1 + 0.2 + 3) / 3)
    assert metrics["rmse_m"] == pytest.approx(np.sqrt((0.01 + 0.04 + 9) / 3))
    assert metrics["median_relative"] == pytest.approx(0.1)
    assert metrics["within_25_percent"] == pytest.approx(2 / 3)


def test_pixels_that_hit_nothing_do_not_count():
    depth_m = IMAGE.copy()
    depth_m[0, 0] = np.nan
    estimate = IMAGE * 1.1
    estimate[0, 0] = 1e6
    assert depth_metrics(estimate, depth_m)["median_relative"] == pytest.approx(0.1)
    assert depth_metrics(estimate, np.full((2, 4), np.nan))["mae_m"] is None
    assert depth_metrics(estimate, np.full((2, 4), np.nan))["coverage"] is None


def test_coverage_is_the_share_of_what_is_hit_that_has_a_depth():
    truth = np.array([1.0, 2.0, 3.0, np.nan])
    metrics = depth_metrics(np.array([1.0, np.nan, np.nan, 4.0]), truth)
    assert metrics["coverage"] == pytest.approx(1 / 3)
    assert metrics["mae_m"] == 0
    reported = depth_metrics(np.full(4, np.nan), truth)
    available = {name: value for name, value in reported.items() if value is not None}
    assert available == {"coverage": 0, "nothing_share": 0.25, "invented": 0, "free_recall": 0}


def test_every_map_that_there_is_gets_metrics():
    dense = make_result(depths={"dense": IMAGE * 1.2})
    assert evaluate(dense, CAPTURE)["depths"].keys() == {"dense"}
    every = make_result(depths=dict.fromkeys(("anchored", "nearest", "dense", "new"), IMAGE))
    assert evaluate(every, CAPTURE)["depths"].keys() == every.depths.keys()


def test_evaluate_compares_all_images_maps_and_rangings():
    metrics = evaluate(make_result(), CAPTURE)
    assert metrics["frame"] == 0
    assert metrics["images"]["pursuit"]["nrmse"] == 0
    assert metrics["images"]["zero-filled"]["nrmse"] > 0
    assert metrics["depths"]["anchored"]["median_relative"] == pytest.approx(0.1)
    assert metrics["depths"]["nearest"]["within_25_percent"] == 0
    (spots,) = metrics["spots"].values()
    assert spots[0].pop("alternatives") == []
    assert spots[0] == pytest.approx(
        {"range_m": 1.5, "true_m": 1.0, "error_m": 0.5, "sigma_m": 0.1, "status": "ok"}
    )
    no_return = dict.fromkeys(("range_m", "error_m", "sigma_m"))
    alternatives = [
        {"range_m": 2.5, "sigma_m": 0.1, "weight": 0.75},
        {"range_m": 3.5, "sigma_m": 0.2, "weight": 0.25},
    ]
    assert spots[2] == no_return | {
        "true_m": 3,
        "status": "ambiguous",
        "alternatives": alternatives,
    }


@pytest.mark.parametrize(
    ("alternatives", "words"),
    [
        ((), "fog"),
        ([(5.104, 0.8, 1.0)], "fog: 5.10 ± 0.80 m"),
        ([(2.312, 0.1, 0.7), (2.94, 0.1, 0.3)], "fog: 2.31 m (70 %), 2.94 m (30 %)"),
        ([(5.104, 0.8, 0.995), (9, 0.1, 0.005)], "fog: 5.10 ± 0.80 m"),
        ([(k, 0.1, 0.25) for k in range(1, 5)], "fog: 1.00 m (25 %), 2.00 m (25 %), 3.00 m (25 %)"),
    ],
)
def test_the_ranges_that_a_spot_may_have_are_told(alternatives, words):
    assert no_range("fog", [Alternative(*each) for each in alternatives]) == words


def test_the_error_of_the_truth_is_relative_to_its_rms():
    assert evaluate(make_result(), CAPTURE)["truth"]["image_error"] == pytest.approx(0.02)
    dark = make_capture(replace(TRUTH, image=np.zeros_like(IMAGE)))
    assert evaluate(make_result(), dark)["truth"]["image_error"] is None


def test_evaluate_is_ready_for_json_with_or_without_depth():
    for result in (
        make_result(),
        make_result(rangings={}, depths={}),
    ):
        json.dumps(evaluate(result, CAPTURE), allow_nan=False)
    assert evaluate(result, CAPTURE)["depths"] == {}
    assert evaluate(result, CAPTURE)["spots"] == {}


# What belongs together


def test_every_frame_is_held_against_its_own_truth():
    brighter = replace(TRUTH, image=2 * IMAGE, depth_m=IMAGE + 1)
    moving = make_capture(TRUTH, brighter, frames=2)
    metrics = [evaluate(reconstruct(moving, frame), moving) for frame in (0, 1)]
    assert [each["frame"] for each in metrics] == [0, 1]
    errors = [each["images"]["zero-filled"]["nrmse"] for each in metrics]
    assert errors == pytest.approx([0, 0], abs=1e-6)
    with_depth = replace(reconstruct(moving, 1), depths={"new": IMAGE + 1})
    assert evaluate(with_depth, moving)["depths"]["new"]["mae_m"] == 0


def test_one_truth_is_that_of_every_frame_where_nothing_moves():
    still = make_capture(TRUTH, frames=3, still=True)
    error = evaluate(reconstruct(still, 2), still)["images"]["zero-filled"]["nrmse"]
    assert error == pytest.approx(3, abs=1e-6)  # four times as bright as the truth


def test_a_frame_whose_truth_is_not_known_is_refused():
    moving = make_capture(TRUTH, TRUTH, frames=3)
    for frame in (0, 1):
        evaluate(reconstruct(moving, frame), moving)
    with pytest.raises(
        InputError, match="frame 2 has no truth; the capture holds that of frames 0, 1"
    ):
        evaluate(reconstruct(moving, 2), moving)


def test_a_result_of_another_frame_or_capture_is_refused():
    moving = make_capture(TRUTH, TRUTH, frames=2)
    result = reconstruct(moving, 1)
    with pytest.raises(InputError, match="not one of frame 0 of this capture"):
        evaluate(replace(result, frame=0), moving)
    with pytest.raises(InputError, match=r"frame 1: the capture has frames 0\.\.0"):
        evaluate(result, CAPTURE)
    for other in (
        replace(moving, plan=make_plan((2, 4), order="natural")),
        replace(moving, buckets=replace(moving.buckets, counts=moving.buckets.counts + 1)),
        first_patterns(moving, 5),
    ):
        with pytest.raises(InputError, match="not one of frame 1 of this capture"):
            evaluate(result, other)


def test_a_capture_without_truth_is_refused():
    with pytest.raises(InputError, match="contains no truth"):
        evaluate(make_result(), replace(CAPTURE, truth=None))


def test_figures_in_percent_are_those_of_a_hundred():
    for figures in FIGURES.values():
        for name, (_, factor, text) in figures.items():
            assert factor == (100 if "%" in text else 1), name
