"""Metrics against truth: known values, gaps in the truth, and numbers that JSON can hold."""

import json
from dataclasses import replace

import numpy as np
import pytest

from reconstruction import Result, evaluate
from reconstruction.capture import Truth
from reconstruction.evaluation import depth_metrics, image_metrics
from reconstruction.ranging import Ranges

IMAGE = np.arange(1.0, 9).reshape(2, 4)


def make_truth(depth_m=IMAGE):
    return Truth(IMAGE, IMAGE / 50, IMAGE, depth_m, IMAGE, np.array([1.0, 2.0, 3.0, 4.0]))


def make_result(**changes):
    ranges = Ranges(
        range_m=np.array([1.5, 2.0, np.nan, 4.0]),
        sigma_m=np.array([0.1, 0.1, np.nan, 0.1]),
        signal_electrons=np.ones(4),
        background_electrons=np.ones(4),
        status=("ok", "ok", "saturated", "ok"),
    )
    values = {
        "image": IMAGE,
        "image_zero_filled": IMAGE + 1,
        "ranges": ranges,
        "range_m": IMAGE,
        "depth_m": IMAGE * 1.1,
        "depth_nearest_m": IMAGE * 1.5,
        "range_dense_m": None,
        "depth_dense_m": None,
        "timings_s": {},
        "unit": "electron",
        "recording": "",
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
    assert depth_metrics(np.full(4, np.nan), truth) == dict.fromkeys(
        ("mae_m", "rmse_m", "median_relative", "within_25_percent")
    ) | {"coverage": 0}


def test_every_map_that_there_is_gets_metrics():
    dense = make_result(depth_m=None, depth_nearest_m=None, depth_dense_m=IMAGE * 1.2)
    assert evaluate(dense, make_truth())["depth"].keys() == {"dense"}
    every = make_result(depth_dense_m=IMAGE * 1.2)
    assert evaluate(every, make_truth())["depth"].keys() == {"anchored", "nearest", "dense"}


def test_evaluate_compares_both_images_and_both_maps():
    metrics = evaluate(make_result(), make_truth())
    assert metrics["image"]["nrmse"] == 0
    assert metrics["image"]["zero_filled"]["nrmse"] > 0
    assert metrics["depth"]["anchored"]["median_relative"] == pytest.approx(0.1)
    assert metrics["depth"]["nearest"]["within_25_percent"] == 0
    assert metrics["spots"][0] == pytest.approx(
        {"range_m": 1.5, "true_m": 1.0, "error_m": 0.5, "sigma_m": 0.1, "status": "ok"}
    )
    nothing = dict.fromkeys(("range_m", "error_m", "sigma_m"))
    assert metrics["spots"][2] == nothing | {"true_m": 3, "status": "saturated"}


def test_the_noise_of_the_truth_is_relative_to_its_rms():
    truth = make_truth()
    assert evaluate(make_result(), truth)["truth"]["image_noise"] == pytest.approx(0.02)
    dark = replace(truth, image=np.zeros_like(IMAGE))
    assert evaluate(make_result(), dark)["truth"]["image_noise"] is None


def test_evaluate_is_ready_for_json_with_or_without_depth():
    for result in (
        make_result(),
        make_result(ranges=None, range_m=None, depth_m=None, depth_nearest_m=None),
    ):
        json.dumps(evaluate(result, make_truth()), allow_nan=False)
    assert evaluate(result, make_truth())["depth"] is None
    assert evaluate(result, make_truth())["spots"] == []
