"""Metrics of a study, and that captures are evaluated once."""

import re
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace
from typing import Any

import numpy as np
import pytest

from datasets import make_set
from reconstruction import Capture, InputError, evaluate, reconstruct
from spisim.dataset.folder import Layout
from spisim.dataset.records import Outcome, failure
from spisim.dataset.study import QUANTITIES
from spisim.dataset.study.evaluation import Evaluation, Evaluator, evaluate_all, evaluation_of
from spisim.dataset.study.metrics import CENTRES_M, EDGES_M, Metric, depth_profile, named_methods


def test_metrics_are_those_of_the_evaluation(capture: Capture) -> None:
    assert capture.truth is not None
    result = reconstruct(capture)
    reported = evaluate(result, capture)
    outcome = evaluation_of(capture).metrics
    assert set(QUANTITIES) < set(outcome)
    default = next(iter(result.images))
    assert outcome["image_correlation"] == reported["images"][default]["correlation"]
    assert outcome[f"image_correlation[{default}]"] == outcome["image_correlation"]
    for method, figures in reported["images"].items():
        assert outcome[f"image_psnr_db[{method}]"] == figures["psnr_db"]
    for method, figures in reported["depths"].items():
        assert outcome[f"depth_within_25[{method}]"] == figures["within_25_percent"]
    assert outcome["depth_mae_m"] == next(iter(reported["depths"].values()))["mae_m"]
    assert (outcome["valid_spots"], outcome["lost_spots"], outcome["saturated"]) == (4, 0, 0)


def test_unknown_metrics_are_told_with_the_nearest_names() -> None:
    assert Metric.of("depth_mae_m[nearest]") == Metric("depth_mae_m", "nearest")
    assert Metric.of("saturated") == Metric("saturated", None)
    for name, message in {
        "depth_mea_m": "unknown metric 'depth_mea_m': did you mean 'depth_mae_m'",
        "saturated[nearest]": "unknown metric 'saturated[nearest]': did you mean 'saturated'",
        "depth_mae_m[nearst]": "unknown depth method 'nearst': did you mean 'nearest'",
        "image_nrmse[]": "unknown image method ''",
        "image_nrmse[pursuit:dtc]": "unknown dictionary 'dtc': did you mean 'dct'",
        "range_bias_m[zero-filled]": "unknown ranging method 'zero-filled'",
    }.items():
        with pytest.raises(InputError, match=re.escape(message)):
            Metric.of(name)


def test_named_methods_are_evaluated_beside_the_usual_ones(capture: Capture) -> None:
    names = ["image_nrmse[zero-filled]", "depth_mae_m", "image_nrmse[pursuit:dct]"]
    methods = named_methods(names)
    assert methods == (("images", "zero-filled"), ("images", "pursuit:dct"))
    usual, result = evaluation_of(capture).metrics, evaluation_of(capture, methods).metrics
    assert result["image_nrmse[pursuit:dct]"] == usual["image_nrmse[pursuit]"]
    assert {name: result[name] for name in usual} == usual


def test_range_metrics_are_over_the_spots_that_have_a_range(capture: Capture) -> None:
    truth = capture.truth
    assert truth is not None
    assert capture.spots is not None
    shifted = replace(truth, spot_range_m=np.add(truth.spot_range_m, [0.1, -0.3, 0.2, 9.0]))
    lost = capture.spots.saturated.copy()
    lost[0, 3] = True
    spots = replace(capture.spots, saturated=lost)
    result = evaluation_of(replace(capture, truth=shifted, spots=spots)).metrics
    assert (result["valid_spots"], result["lost_spots"]) == (3, 1)
    assert result["range_bias_m"] == pytest.approx(0.0, abs=1e-6)
    assert result["range_error_m"] == pytest.approx(0.2, abs=1e-6)
    all_lost = replace(capture.spots, saturated=np.ones_like(lost))
    no_return = evaluation_of(replace(capture, spots=all_lost)).metrics
    assert no_return["valid_spots"] == 0
    assert no_return["range_bias_m"] is no_return["depth_mae_m"] is None


def test_saturated_is_the_share_of_readings(capture: Capture) -> None:
    saturated = capture.buckets.saturated.copy()
    saturated[0, 64:96] = True
    buckets = replace(capture.buckets, saturated=saturated)
    assert (
        evaluation_of(replace(capture, buckets=buckets)).metrics["saturated"]
        == 32 / capture.plan.exposures
    )


def test_a_capture_without_truth_is_refused(capture: Capture) -> None:
    with pytest.raises(InputError, match="no truth to compare with"):
        evaluation_of(replace(capture, truth=None))


def test_depth_profiles_are_means_of_the_pixels_in_a_bin(capture: Capture) -> None:
    assert capture.truth is not None
    depth = capture.truth.at(0).depth_m.copy()
    depth[0] = np.nan
    depth[1, :2] = 1.0  # four pixels of two frames are too few
    truth: Any = SimpleNamespace(at=lambda frame: SimpleNamespace(depth_m=depth))
    lost = np.full_like(depth, np.nan)
    depths = {"first": np.full_like(depth, 3.0), "lost": lost}, {"first": np.full_like(depth, 6.0)}
    results: Any = [SimpleNamespace(frame=k, depths=each) for k, each in enumerate(depths)]
    profile = depth_profile(results, truth)
    bins = np.histogram(depth[np.isfinite(depth)], EDGES_M)[0]
    assert sorted(bins[bins > 0])[0] == 2
    assert profile["first"] == [4.5 if pixels > 2 else None for pixels in bins]
    assert profile["lost"] == [None] * CENTRES_M.size


# What was evaluated is kept


class InProcess:
    """An executor without processes."""

    def __init__(self, make: Evaluator) -> None:
        self.make = make

    def __enter__(self) -> "InProcess":
        return self

    def __exit__(self, *exception: object) -> None:
        pass

    def run(self, indices: Any) -> Iterator[Outcome]:
        return (self.make(index) for index in indices)


class Deadly(InProcess):
    """An executor whose processes all die."""

    def run(self, indices: Any) -> Iterator[Outcome]:
        return (failure(index, "worker killed by SIGKILL") for index in indices)


def test_captures_are_evaluated_once_and_again_when_they_change(
    capture: Capture, tmp_path: Path
) -> None:
    folder = make_set(tmp_path / "walls", capture, done=3, failed=1)
    asked: list[list[int]] = []

    class Counting(InProcess):
        def run(self, indices: Any) -> Iterator[Outcome]:
            asked.append(list(indices))
            return super().run(indices)

    data, first = evaluate_all(folder, Counting)
    assert [record.index for record in data.records] == [0, 1, 2]
    assert first[1].metrics == evaluation_of(data[1].capture).metrics
    _, second = evaluate_all(folder, Counting)
    assert second == first
    assert asked == [[0, 1, 2]]

    Layout(folder).metrics(1).unlink()
    Layout(folder).metrics(2).write_text('{"key": "of an older reconstruction"}')
    Layout(folder).metrics(0).write_text(Layout(folder).metrics(0).read_text()[:40])
    _, third = evaluate_all(folder, Counting)
    assert third == first
    assert asked[1] == [0, 1, 2]


def test_a_capture_that_cannot_be_reconstructed_is_told(capture: Capture, tmp_path: Path) -> None:
    dark = np.ones_like(capture.buckets.saturated)
    blind = replace(capture, buckets=replace(capture.buckets, saturated=dark))
    folder = make_set(tmp_path / "walls", blind, done=1, failed=0)
    _, result = evaluate_all(folder, InProcess)
    assert not result[0].metrics
    assert "every pattern has a saturated reading" in str(result[0].error)


def test_a_capture_that_takes_its_worker_with_it_is_told_and_tried_again(
    capture: Capture, tmp_path: Path
) -> None:
    folder = make_set(tmp_path / "walls", capture, done=1, failed=0)
    _, result = evaluate_all(folder, Deadly)
    assert result[0] == Evaluation({}, error="evaluation: worker killed by SIGKILL")
    _, result = evaluate_all(folder, InProcess)
    assert result[0].error is None


def test_a_capture_is_known_by_its_content(capture: Capture, tmp_path: Path) -> None:
    """Metrics belong to the capture that the manifest tells of, not to its place."""
    folder = make_set(tmp_path / "walls", capture, done=1, failed=0)
    _, result = evaluate_all(folder, InProcess)
    other = make_set(tmp_path / "others", replace(capture, provenance=replace(
        capture.provenance, scene="name: other")), done=1, failed=0)  # fmt: skip
    retained = Layout(other).metrics(0)
    retained.parent.mkdir(parents=True)
    retained.write_bytes(Layout(folder).metrics(0).read_bytes().replace(b"4.0", b"1.0"))
    _, again = evaluate_all(other, InProcess)
    assert again == result


def test_bins_of_depth_have_their_centres_within_them() -> None:
    np.testing.assert_allclose(CENTRES_M / EDGES_M[:-1], EDGES_M[1:] / CENTRES_M)
