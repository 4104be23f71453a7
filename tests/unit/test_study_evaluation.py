"""Metrics of a study, and that captures are evaluated once."""

from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest

from datasets import make_set
from reconstruction import Capture, InputError, evaluate, reconstruct
from spisim.dataset.records import Outcome, failure
from spisim.study import METRICS
from spisim.study.evaluation import Evaluation, Evaluator, evaluate_all, evaluation_of, kept_at
from spisim.study.profile import CENTRES_M, EDGES_M, depth_profile


def test_metrics_are_those_of_the_evaluation(capture: Capture) -> None:
    assert capture.truth is not None
    told = evaluate(reconstruct(capture), capture.truth)
    found = evaluation_of(capture).metrics
    assert set(found) == set(METRICS)
    assert found["image_correlation"] == told["image"]["correlation"]
    assert found["image_zero_filled_psnr_db"] == told["image"]["zero_filled"]["psnr_db"]
    assert found["depth_mae_m"] == told["depth"]["anchored"]["mae_m"]
    assert found["depth_nearest_within_25"] == told["depth"]["nearest"]["within_25_percent"]
    assert found["depth_dense_mae_m"] is None
    assert (found["valid_spots"], found["saturated"]) == (4, 0)


def test_range_metrics_are_over_the_spots_that_have_a_range(capture: Capture) -> None:
    truth = capture.truth
    assert truth is not None
    assert capture.spots is not None
    shifted = replace(truth, spot_range_m=np.add(truth.spot_range_m, [0.1, -0.3, 0.2, 9.0]))
    lost = capture.spots.saturated.copy()
    lost[0, 3] = True
    spots = replace(capture.spots, saturated=lost)
    found = evaluation_of(replace(capture, truth=shifted, spots=spots)).metrics
    assert found["valid_spots"] == 3
    assert found["range_bias_m"] == pytest.approx(0.0, abs=1e-6)
    assert found["range_error_m"] == pytest.approx(0.2, abs=1e-6)
    all_lost = replace(capture.spots, saturated=np.ones_like(lost))
    nothing = evaluation_of(replace(capture, spots=all_lost)).metrics
    assert nothing["valid_spots"] == 0
    assert nothing["range_bias_m"] is nothing["depth_mae_m"] is None


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
    depth = capture.truth.depth_m.copy()
    depth[0] = np.nan
    depth[1, :2] = 1.0  # four pixels of two frames are too few
    truth = replace(capture.truth, depth_m=depth)
    result = replace(reconstruct(capture), depth_m=np.full_like(depth, 3.0), depth_nearest_m=None)
    profile = depth_profile([result, replace(result, depth_m=np.full_like(depth, 6.0))], truth)
    bins = np.histogram(depth[np.isfinite(depth)], EDGES_M)[0]
    assert sorted(bins[bins > 0])[0] == 2
    assert profile["anchored"] == [4.5 if pixels > 2 else None for pixels in bins]
    assert profile["nearest"] == [None] * CENTRES_M.size


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

    kept_at(folder, 1).unlink()
    kept_at(folder, 2).write_text('{"key": "of an older reconstruction"}')
    kept_at(folder, 0).write_text(kept_at(folder, 0).read_text()[:40])
    _, third = evaluate_all(folder, Counting)
    assert third == first
    assert asked[1] == [0, 1, 2]


def test_a_capture_that_cannot_be_reconstructed_is_told(capture: Capture, tmp_path: Path) -> None:
    dark = np.ones_like(capture.buckets.saturated)
    blind = replace(capture, buckets=replace(capture.buckets, saturated=dark))
    folder = make_set(tmp_path / "walls", blind, done=1, failed=0)
    _, found = evaluate_all(folder, InProcess)
    assert not found[0].metrics
    assert "every pattern rests on a saturated reading" in str(found[0].error)


def test_a_capture_that_takes_its_worker_with_it_is_told_and_tried_again(
    capture: Capture, tmp_path: Path
) -> None:
    folder = make_set(tmp_path / "walls", capture, done=1, failed=0)
    _, found = evaluate_all(folder, Deadly)
    assert found[0] == Evaluation({}, error="evaluation: worker killed by SIGKILL")
    _, found = evaluate_all(folder, InProcess)
    assert found[0].error is None


def test_a_capture_is_known_by_its_content(capture: Capture, tmp_path: Path) -> None:
    """Metrics belong to the capture that the manifest tells of, not to its place."""
    folder = make_set(tmp_path / "walls", capture, done=1, failed=0)
    _, found = evaluate_all(folder, InProcess)
    other = make_set(tmp_path / "others", replace(capture, provenance=replace(
        capture.provenance, scene="name: other")), done=1, failed=0)  # fmt: skip
    kept_at(other, 0).parent.mkdir(parents=True)
    kept_at(other, 0).write_bytes(kept_at(folder, 0).read_bytes().replace(b"4.0", b"1.0"))
    _, again = evaluate_all(other, InProcess)
    assert again == found
