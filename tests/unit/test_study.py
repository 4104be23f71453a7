"""Studies: plans, statistics, metrics, tables, plots, the page."""

import csv
import io
import math
from collections.abc import Iterator
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
import yaml

from datasets import make_set
from reconstruction import Capture, InputError, evaluate, reconstruct
from spisim.dataset.records import Outcome, Record, failure
from spisim.dataset.sample import load
from spisim.study import METRICS, load_study
from spisim.study.evaluation import Evaluation, Evaluator, evaluate_all, evaluation_of, kept_at
from spisim.study.labels import axis_label, condition_label, value_label
from spisim.study.plan import PlannedStudy
from spisim.study.plots import study_plots
from spisim.study.profile import CENTRES_M, EDGES_M, depth_profile
from spisim.study.profile_plot import profile_of, profile_plot
from spisim.study.report import write_report
from spisim.study.results import (
    ALL_SCENES,
    Results,
    differences_csv,
    results_csv,
    results_of,
    summary_csv,
)
from spisim.study.statistics import estimate

STUDIES = Path(__file__).parents[2] / "studies"
PLAN: dict[str, Any] = {
    "name": "Walls <in> fog",
    "scenes": [{"scene": "target-plane"}],
    "vary": {"scene.fog.visibility_m": {"grid": [20, 100]}},
    "spp": 8,
    "study": {"x": "scene.fog.visibility_m", "rounds": 2, "metrics": ["range_bias_m"]},
}


def planned(folder: Path, study: dict[str, Any] | None = None, **changes: Any) -> PlannedStudy:
    fields = {**PLAN, **changes, "study": {**PLAN["study"], **(study or {})}}
    (folder / "plan.yaml").write_text(yaml.safe_dump(fields, sort_keys=False))
    return load_study(folder / "plan.yaml")


# Plans


def test_rounds_run_through_all_combinations(tmp_path: Path) -> None:
    study = planned(tmp_path, study={"rounds": 3})
    assert study.data_set.plan.size == 6
    assert study.conditions == [(20,), (100,)]


def test_what_is_compared_may_change_without_new_samples(tmp_path: Path) -> None:
    one = planned(tmp_path)
    other = planned(tmp_path, study={"metrics": ["valid_spots"], "rounds": 5})
    assert one.data_set.digest == other.data_set.digest
    assert "study" not in one.data_set.fields


def test_fields_that_change_together_and_instruments_are_grids(tmp_path: Path) -> None:
    study = planned(
        tmp_path,
        study={"x": "scene.fog.visibility_m", "groups": ["instrument", "scene.rain.rate_mm_per_h"]},
        instrument={"grid": ["paper", "fga015"]},
        vary={
            "scene.fog": None,
            "weather": {
                "grid": [
                    {},
                    {"scene.fog": {"visibility_m": 50, "kind": "haze-l"}},
                    {"scene.rain": {"rate_mm_per_h": 4}},
                ]
            },
        },
    )
    samples = [study.data_set.sample(index) for index in range(6)]
    assert study.conditions == [
        (visibility, instrument, rain)
        for instrument in ("paper", "fga015")
        for visibility, rain in ((None, None), (50, None), (None, 4))
    ]
    scenes = [yaml.safe_load(sample.scene_text) for sample in samples]
    assert ["fog" in scene for scene in scenes] == [False, True, False] * 2
    assert [scene.get("rain") for scene in scenes[:3]] == [None, None, {"rate_mm_per_h": 4}]
    areas = [
        yaml.safe_load(sample.instrument_text)["detector"]["sensor"]["photoactive_area_mm2"]
        for sample in samples
    ]
    assert areas[0] == areas[1] == areas[2] != areas[3] == areas[4] == areas[5]


@pytest.mark.parametrize("name", ["fog-and-rain", "depth"])
def test_the_studies_that_are_shipped_can_be_run(name: str) -> None:
    study = load_study(STUDIES / f"{name}.yaml")
    small = study.quick()
    assert study.study.rounds >= 5
    assert small.data_set.plan.size < study.data_set.plan.size / 3
    assert study.conditions[0][1:] == (None,) * len(study.study.groups)  # clear air is first
    assert len(set(study.conditions)) == len(study.conditions)


@pytest.mark.slow
@pytest.mark.filterwarnings("ignore::spisim.scene.SceneWarning")  # fog is denser than natural
@pytest.mark.parametrize("name", ["fog-and-rain", "depth"])
def test_every_view_of_the_studies_that_are_shipped_can_be_made(name: str) -> None:
    study = load_study(STUDIES / f"{name}.yaml")
    samples = map(study.data_set.sample, range(study.data_set.plan.size))
    views = {(s.scene_name, *s.parameters["scene.drone.turn_deg"]): s for s in samples}
    assert len(views) == len(study.plan.scenes) * study.study.rounds
    for sample in views.values():
        load(sample)


def test_a_quick_setting_changes_what_it_names(tmp_path: Path) -> None:
    quick = {"noise": 0.1, "study": {"rounds": 1}, "vary": {"scene.fog.kind": "haze-l"}}
    small = planned(tmp_path, study={"quick": quick}).quick()
    assert small.plan.effort == {"transport_noise": 0.1}
    assert small.study.rounds == 1
    assert small.study.metrics == ("range_bias_m",)
    assert list(small.plan.vary) == ["scene.fog.visibility_m", "scene.fog.kind"]


BAD: list[tuple[dict[str, Any], str]] = [
    (
        {"study": {"metrics": ["depth_mea_m"]}},
        r"study: unknown metric .*did you mean 'depth_mae_m'",
    ),
    ({"study": {"metrics": []}}, r"study.metrics: should have at least 1 items"),
    ({"study": {"metrics": ["saturated", "saturated"]}}, r"saturated is given twice"),
    ({"study": {"x": "scene.fog.visibility"}}, r"did you mean 'scene.fog.visibility_m'"),
    ({"study": {"x": "scene.fog.kind"}}, r"'scene.fog.kind' is not among the grids"),
    ({"study": {"groups": [""]}}, r"study.groups\[0\]: .*at least 1 character"),
    ({"study": {"groups": ["scene.fog.visibility_m"]}}, r"visibility_m is given twice"),
    ({"study": {"grups": []}}, r"unknown field 'grups': did you mean 'groups'"),
    ({"study": {"rounds": 0}}, r"study.rounds"),
    ({"vary": {}}, r"needs a grid to compare"),
    ({"vary": {"scene.fog.visibility_m": {"uniform": [20, 30]}}}, r"needs a grid to compare"),
    ({"samples": 4}, r"samples follow from study.rounds"),
    ({"keep": {"truth": False}}, r"needs keep.truth"),
    (
        {"vary": {"scene.fog.visibility_m": {"grid": [{"uniform": [20, 30]}, 50]}}},
        r"'scene.fog.visibility_m' is drawn; it needs the same values in all rounds",
    ),
    ({"instrument": 7}, r"instrument: should be a name, or a grid of names"),
    ({"instrument": {"grid": ["paper", 7]}}, r"instrument: should be a name, or a grid of names"),
    (
        {"instrument": {"grid": ["paper", "fga015"]}},
        r"do not tell all combinations apart; add instrument to groups",
    ),
    (
        {"vary": {"weather": {"grid": [{"fog": None}]}}},
        r"weather should begin with scene. or instrument., or each of its values be a mapping",
    ),
    (
        {
            "vary": {"scene.ambient.sky_klx": {"grid": [0, 1]}},
            "study": {"x": "scene.ambient.sky_klx", "x_scale": "log"},
        },
        r"x_scale log needs positive numbers; scene.ambient.sky_klx has 0",
    ),
]


@pytest.mark.parametrize(("changes", "message"), BAD)
def test_bad_plans_are_refused(tmp_path: Path, changes: dict[str, Any], message: str) -> None:
    with pytest.raises(InputError, match=message) as caught:
        planned(tmp_path, **changes)
    assert str(tmp_path / "plan.yaml") in str(caught.value)


def test_a_plan_without_a_study_or_a_quick_setting_is_told(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"study\.quick is missing"):
        planned(tmp_path).quick()
    (tmp_path / "set.yaml").write_text(yaml.safe_dump({**PLAN, "study": None}))
    with pytest.raises(InputError, match="study: should be a mapping of fields"):
        load_study(tmp_path / "set.yaml")
    bad = planned(tmp_path, study={"quick": {"nois": 0.1}})
    with pytest.raises(
        InputError, match=r"study.quick: unknown field 'nois': did you mean 'noise'"
    ):
        bad.quick()
    with pytest.raises(InputError, match=r"study.quick.vary: should be a mapping of fields; found"):
        planned(tmp_path, study={"quick": {"vary": None}}).quick()


# Statistics


@pytest.mark.parametrize("units", [10, 30])
def test_intervals_cover_the_true_mean_as_often_as_they_say(units: int) -> None:
    rng = np.random.default_rng(units)
    trials = 1500
    hits = 0
    for _ in range(trials):
        found = estimate(rng.normal(3.0, 2.0, units).tolist(), range(units))
        assert found.low is not None
        assert found.high is not None
        hits += found.low <= 3.0 <= found.high
    assert abs(hits / trials - 0.95) < 3 * math.sqrt(0.95 * 0.05 / trials)


def test_an_interval_of_dependent_values_is_that_of_their_units() -> None:
    """Five views of each scene tell no more of other scenes than their means do."""
    rng = np.random.default_rng(3)
    scenes = rng.normal(size=8)
    repeated = estimate(np.repeat(scenes, 5).tolist(), np.repeat(np.arange(8), 5).tolist())
    single = estimate(scenes.tolist(), range(8))
    assert (repeated.n, repeated.units) == (40, 8)
    assert (repeated.low, repeated.high) == pytest.approx((single.low, single.high), rel=1e-12)


def test_intervals_of_clustered_values_cover_and_those_that_ignore_clusters_do_not() -> None:
    rng = np.random.default_rng(5)
    trials, scenes, views = 600, 10, 5
    labels = np.repeat(np.arange(scenes), views).tolist()
    hits = {"scenes": 0, "samples": 0}
    for _ in range(trials):
        values = np.repeat(rng.normal(size=scenes), views) + 0.5 * rng.normal(size=scenes * views)
        for name, units in (("scenes", labels), ("samples", list(range(scenes * views)))):
            found = estimate(values.tolist(), units)
            assert found.low is not None
            assert found.high is not None
            hits[name] += found.low <= 0 <= found.high
    spread = math.sqrt(0.95 * 0.05 / trials)
    assert abs(hits["scenes"] / trials - 0.95) < 3 * spread
    assert hits["samples"] / trials < 0.75


def test_estimates_of_few_values() -> None:
    assert estimate([], []) == replace(estimate([], []), n=0, units=0, mean=None, low=None)
    one = estimate([2.0], ["a"])
    assert (one.n, one.mean, one.median, one.low, one.high) == (1, 2.0, 2.0, None, None)
    two = estimate([1.0, 3.0], ["a", "b"])
    assert (two.mean, two.low, two.high) == (2.0, 1.0, 3.0)
    assert not two.settled  # too few to say so
    assert estimate([1.0, 1.2, 0.9, 1.1, 1.0], range(5)).settled
    assert not estimate([1.0, -1.2, 0.9, -1.1, 0.1], range(5)).settled


def test_the_mean_weighs_samples_and_the_same_values_give_the_same_interval() -> None:
    values, units = [1.0, 1.0, 4.0, 6.0, 3.0], ["a", "a", "b", "c", "d"]
    found = estimate(values, units)
    assert found.mean == 3.0
    assert found.median == 3.0
    assert found.low is not None
    assert found.high is not None
    assert found.low < 3.0 < found.high
    assert found == estimate(values, units)


# Metrics


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


# Tables


def record(index: int, scene: str, parameters: dict[str, Any], error: str | None = None) -> Record:
    return Record(
        index=index,
        status="failed" if error else "done",
        scene=scene,
        parameters=parameters,
        file=f"samples/000/{index:06}.h5",
        bytes=1,
        sha256="0",
        sidecars={},
        seconds=1.0,
        stage_seconds={},
        peak_memory_mb=1.0,
        attempts=1,
        error=error,
        finished="",
    )


METHODS = ["depth_mae_m", "depth_nearest_mae_m", "valid_spots"]


def made(folder: Path, lost: tuple[int, ...] = ()) -> Results:
    """Ten rounds that differ by far more than the fogs do; some samples lost.

    In fog of 20 m the anchored depth is worse by 0.5 m than in fog of 100 m, the nearest spot's
    equal.
    """
    study = planned(folder, study={"metrics": METHODS, "rounds": 10})
    records, evaluations = [], {}
    rounds = np.random.default_rng(1).uniform(1, 9, 10)
    for index in range(20):
        near = index % 2 == 0
        parameters = {"scene": "target-plane", "scene.fog.visibility_m": 20 if near else 100}
        failed = "a laser <hits> nothing" if index in lost else None
        records.append(record(index, "target-plane", parameters, failed))
        if not failed:
            depth = float(rounds[index // 2]) + (0.5 if near else 0.0)
            values = dict.fromkeys(METRICS) | dict(
                zip(METHODS, (depth, 2 * depth, 4.0), strict=True)
            )
            evaluations[index] = Evaluation(values)
    return results_of(study, records, evaluations)


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_every_sample_and_every_combination_has_a_row(tmp_path: Path) -> None:
    results = made(tmp_path, lost=(7,))
    rows = table(results_csv(results))
    assert [row["index"] for row in rows] == [str(index) for index in range(20)]
    assert [row["round"] for row in rows] == [str(index // 2) for index in range(20)]
    assert rows[7]["error"] == "a laser <hits> nothing"
    assert rows[7]["depth_mae_m"] == ""
    assert float(rows[6]["depth_nearest_mae_m"]) == 2 * float(rows[6]["depth_mae_m"])
    means = table(summary_csv(results))
    assert [(row["scene.fog.visibility_m"], row["metric"]) for row in means] == [
        (visibility, name) for visibility in ("20", "100") for name in METHODS
    ]
    assert [row["n"] for row in means] == ["10"] * 3 + ["9"] * 3
    for row in means:
        assert float(row["low"]) <= float(row["mean"]) <= float(row["high"])
    expected = [float(row["depth_mae_m"]) for row in rows if row["scene.fog.visibility_m"] == "20"]
    assert float(means[0]["mean"]) == pytest.approx(np.mean(expected))
    assert float(means[0]["median"]) == pytest.approx(np.median(expected))


def test_differences_are_between_samples_of_the_same_round(tmp_path: Path) -> None:
    """Rounds differ by metres, but within each fog costs the same half a metre."""
    results = made(tmp_path, lost=(7,))
    found = {
        (row["scene.fog.visibility_m"], row["metric"], row["minus_metric"]): row
        for row in table(differences_csv(results))
    }
    fog = found["100", "depth_mae_m", "depth_mae_m"]
    assert fog["minus_scene.fog.visibility_m"] == "20"
    assert [float(fog[name]) for name in ("mean", "low", "high")] == pytest.approx([-0.5] * 3)
    assert fog["n"] == "9"  # the lost sample's partner counts no more
    summary = results.summaries[(100,), "depth_mae_m"].estimate
    assert summary.low is not None
    assert summary.high is not None
    assert summary.high - summary.low > 2
    method = found["100", "depth_mae_m", "depth_nearest_mae_m"]
    assert float(method["mean"]) == pytest.approx(-float(summary.mean or 0))
    assert ("20", "depth_mae_m", "depth_mae_m") not in found
    assert len(found) == 3 + 2


def test_scenes_are_the_units_where_there_are_several(tmp_path: Path) -> None:
    study = planned(
        tmp_path,
        study={"rounds": 3},
        scenes=[{"scene": "target-plane"}, {"scene": "target-tilted-plane"}],
        every_scene=True,
    )
    records, evaluations = [], {}
    for index in range(12):
        sample = study.data_set.sample(index)
        records.append(record(index, sample.scene_name, dict(sample.parameters)))
        value = 1.0 if sample.scene_name == "target-plane" else 3.0
        evaluations[index] = Evaluation(dict.fromkeys(METRICS) | {"range_bias_m": value})
    found = results_of(study, records, evaluations).summaries[(20,), "range_bias_m"].estimate
    assert (found.n, found.units, found.low, found.high) == (6, 2, 1.0, 3.0)


def test_all_scenes_stand_together_beside_each(tmp_path: Path) -> None:
    study = planned(
        tmp_path,
        study={"rounds": 2, "x": "scene", "groups": ["scene.fog.visibility_m"]},
        scenes=[{"scene": "target-plane"}, {"scene": "target-tilted-plane"}],
        every_scene=True,
    )
    records, evaluations = [], {}
    for index in range(8):
        sample = study.data_set.sample(index)
        records.append(record(index, sample.scene_name, dict(sample.parameters)))
        evaluations[index] = Evaluation(dict.fromkeys(METRICS) | {"range_bias_m": float(index)})
    results = results_of(study, records, evaluations)
    names = ("target-plane", "target-tilted-plane", ALL_SCENES)
    assert results.conditions == [(name, fog) for name in names for fog in (20, 100)]
    means = [results.summaries[each, "range_bias_m"].estimate.mean for each in results.conditions]
    assert means == [2.0, 3.0, 4.0, 5.0, 3.0, 4.0]  # indices 0 and 4, 1 and 5, …
    differences = {each.condition: each for each in results.differences}
    assert {c: d.minus_condition for c, d in differences.items()} == {
        (name, 100): (name, 20) for name in names
    }
    assert all(each.estimate.mean == 1.0 for each in differences.values())


# Labels, plots, page


def test_labels_have_units() -> None:
    assert axis_label("scene.fog.visibility_m") == "fog visibility, m"
    assert axis_label("scene.rain.rate_mm_per_h") == "rain rate, mm/h"
    assert axis_label("instrument.lasers.power_w") == "lasers power, W"
    assert axis_label("scene.parameters.distance_m") == "distance, m"
    assert axis_label("scene") == "scene"
    assert value_label("scene.fog.kind", "haze-l") == "haze-l"
    assert value_label("scene.rain.rate_mm_per_h", 5) == "rain rate 5 mm/h"
    assert value_label("scene.drone.offset_m", (0.5, 0, 0)) == "drone offset (0.5, 0, 0) m"


def test_a_combination_without_values_has_the_name_of_the_reference(tmp_path: Path) -> None:
    study = planned(tmp_path, study={"reference": "clear air"}).study
    assert condition_label(study, (None,)) == "clear air"
    assert condition_label(study, (20,)) == "fog visibility 20 m"


def test_methods_share_a_plot_and_plots_are_the_same_each_time(tmp_path: Path) -> None:
    results = made(tmp_path)
    plots = study_plots(results)
    assert [plot.metrics for plot in plots] == [tuple(METHODS[:2]), tuple(METHODS[2:])]
    for plot, again in zip(plots, study_plots(results), strict=True):
        assert plot.png.startswith(b"\x89PNG")
        assert plot.svg == again.svg
        assert plot.png == again.png


def test_a_depth_profile_is_over_the_scenes_that_have_such_a_depth(tmp_path: Path) -> None:
    results = made(tmp_path)
    rows = [row for row in results.groups()[()] if row.parameters["scene.fog.visibility_m"] == 20]
    values = [1.0 + row.round for row in rows]
    known: list[Any] = [None] * CENTRES_M.size
    profiled = []
    for row, value in zip(rows, values, strict=True):
        anchored = list(known)
        anchored[4] = value
        anchored[5] = value if row.round < 2 else None
        profiled.append(replace(row, profile={"anchored": anchored, "nearest": known}))
    profile = profile_of(profiled, "anchored")
    assert list(profile) == [CENTRES_M[4]]  # two rounds are not enough for the next
    assert (profile[CENTRES_M[4]].mean, profile[CENTRES_M[4]].n) == (5.5, 10)
    assert profile_of(profiled, "nearest") == {}
    plot = profile_plot(replace(results, rows=profiled))
    assert plot.svg == profile_plot(replace(results, rows=profiled)).svg


def test_the_page_needs_no_other_file_and_escapes_what_it_shows(tmp_path: Path) -> None:
    results = made(tmp_path, lost=(1, 3, 5, 7, 9, 11))
    write_report(tmp_path / "report.html", results, study_plots(results))
    page = (tmp_path / "report.html").read_text()
    assert page.count("data:image/svg+xml;base64,") == 2
    assert "http" not in page.replace("http-equiv", "")
    assert "<in>" not in page
    assert "<hits>" not in page
    assert "6 samples failed" in page
    assert "more than half of the samples have none in fog visibility 100 m" in page
    assert "rest on 4 independent scenes or rounds" in page


def test_a_combination_of_which_nothing_is_left_is_shown_without_marks(tmp_path: Path) -> None:
    results = made(tmp_path, lost=tuple(range(1, 20, 2)))
    assert results.summaries[(100,), "depth_mae_m"].estimate.n == 0
    write_report(tmp_path / "report.html", results, study_plots(results))
    assert "<td>–</td>" in (tmp_path / "report.html").read_text()


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
