"""Tables, labels, plots and the page of a study."""

import csv
import io
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np
import pytest
from matplotlib import pyplot

from spisim.dataset.records import Record
from spisim.dataset.study import QUANTITIES
from spisim.dataset.study.evaluation import Evaluation
from spisim.dataset.study.metrics import CENTRES_M
from spisim.dataset.study.results import (
    ALL_SCENES,
    Results,
    differences_csv,
    results_csv,
    results_of,
    summary_csv,
)
from spisim_app.report.study import write_study
from spisim_app.report.study.labels import axis_label, condition_label, value_label
from spisim_app.report.study.plots import _over_numbers, study_plots
from spisim_app.report.study.profile_plot import profile_of, profile_plot
from studies import planned

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
        warnings=() if error else (f"spot {index % 2} is weak", "light is guessed"),
    )


METHODS = ["depth_mae_m", "depth_mae_m[nearest]", "valid_spots"]


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
            values = dict.fromkeys(QUANTITIES) | dict(
                zip(METHODS, (depth, 2 * depth, 4.0), strict=True)
            )
            evaluations[index] = Evaluation(values)
    return results_of(study, records, evaluations)


def test_where_spots_are_lost_how_many_are_left_is_told(tmp_path: Path) -> None:
    """The error of the others falls when the hard ones drop out."""
    study = planned(tmp_path, study={"metrics": ["range_error_m[cw]"], "rounds": 1})

    def results(left: float, spots: float = 4.0) -> Results:
        parameters = [
            {"scene": "target-plane", "scene.fog.visibility_m": visibility}
            for visibility in (20, 100)
        ]
        records = [record(index, "target-plane", each) for index, each in enumerate(parameters)]
        values = dict.fromkeys(QUANTITIES) | {"range_error_m[cw]": 0.1}
        counts = [
            {"valid_spots[cw]": valid, "lost_spots[cw]": spots - valid} for valid in (left, spots)
        ]
        evaluations = {index: Evaluation(values | each) for index, each in enumerate(counts)}
        return results_of(study, records, evaluations)

    assert results(4.0).metrics == results(9.0, 9.0).metrics == ("range_error_m[cw]",)
    assert results(1.0, 1.0).metrics == ("range_error_m[cw]",)
    assert results(8.0, 9.0).metrics == ("range_error_m[cw]", "valid_spots[cw]")
    lossy = results(3.0)
    assert lossy.metrics == ("range_error_m[cw]", "valid_spots[cw]")
    assert [row["mean"] for row in table(summary_csv(lossy)) if "valid" in row["metric"]] == [
        "3.0",
        "4.0",
    ]
    assert "valid_spots" in [plot.name for plot in study_plots(lossy)]


def table(text: str) -> list[dict[str, str]]:
    return list(csv.DictReader(io.StringIO(text)))


def test_every_sample_and_every_combination_has_a_row(tmp_path: Path) -> None:
    results = made(tmp_path, lost=(7,))
    rows = table(results_csv(results))
    assert [row["index"] for row in rows] == [str(index) for index in range(20)]
    assert [row["round"] for row in rows] == [str(index // 2) for index in range(20)]
    assert rows[7]["error"] == "a laser <hits> nothing"
    assert rows[7]["depth_mae_m"] == ""
    assert [row["warnings"] for row in rows[6:9]] == [
        "spot 0 is weak | light is guessed",
        "",
        "spot 0 is weak | light is guessed",
    ]
    assert float(rows[6]["depth_mae_m[nearest]"]) == 2 * float(rows[6]["depth_mae_m"])
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
    result = {
        (row["scene.fog.visibility_m"], row["metric"], row["minus_metric"]): row
        for row in table(differences_csv(results))
    }
    fog = result["100", "depth_mae_m", "depth_mae_m"]
    assert fog["minus_scene.fog.visibility_m"] == "20"
    assert [float(fog[name]) for name in ("mean", "low", "high")] == pytest.approx([-0.5] * 3)
    assert fog["n"] == "9"  # the lost sample's partner counts no more
    summary = results.summaries[(100,), "depth_mae_m"].estimate
    assert summary.low is not None
    assert summary.high is not None
    assert summary.high - summary.low > 2
    method = result["100", "depth_mae_m", "depth_mae_m[nearest]"]
    assert float(method["mean"]) == pytest.approx(-float(summary.mean or 0))
    assert ("20", "depth_mae_m", "depth_mae_m") not in result
    assert len(result) == 3 + 2


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
        evaluations[index] = Evaluation(dict.fromkeys(QUANTITIES) | {"range_bias_m": value})
    result = results_of(study, records, evaluations).summaries[(20,), "range_bias_m"].estimate
    assert (result.n, result.units, result.mean) == (6, 2, 2.0)


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
        evaluations[index] = Evaluation(dict.fromkeys(QUANTITIES) | {"range_bias_m": float(index)})
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


def test_means_are_plotted_in_notebooks(tmp_path: Path) -> None:
    results = made(tmp_path)
    for axes, metric in zip(results.plot(), results.metrics, strict=True):
        assert axes.get_title() == metric
        assert len(axes.lines) == len(results.groups())
        assert axes.get_xlabel() == results.planned.study.x
    pyplot.close("all")


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
    assert [plot.name for plot in plots] == ["depth_mae_m", "valid_spots"]
    for plot, again in zip(plots, study_plots(results), strict=True):
        assert plot.png.startswith(b"\x89PNG")
        assert plot.svg == again.svg
        assert plot.png == again.png


def test_a_depth_profile_is_over_the_scenes_that_have_such_a_depth(tmp_path: Path) -> None:
    results = made(tmp_path)
    rows = [row for row in results.groups()[()] if row.parameters["scene.fog.visibility_m"] == 20]
    values = [1.0 + row.round for row in rows]
    valid: list[Any] = [None] * CENTRES_M.size
    profiled = []
    for row, value in zip(rows, values, strict=True):
        anchored = list(valid)
        anchored[4] = value
        anchored[5] = value if row.round < 2 else None
        profiled.append(replace(row, profile={"anchored": anchored, "nearest": valid}))
    profile = profile_of(profiled, "anchored")
    assert list(profile) == [CENTRES_M[4]]  # two rounds are not enough for the next
    assert (profile[CENTRES_M[4]].mean, profile[CENTRES_M[4]].n) == (5.5, 10)
    assert profile_of(profiled, "nearest") == {}
    plot = profile_plot(replace(results, rows=profiled))
    assert plot.svg == profile_plot(replace(results, rows=profiled)).svg


def test_the_page_needs_no_other_file_and_escapes_what_it_shows(tmp_path: Path) -> None:
    results = made(tmp_path, lost=(1, 3, 5, 7, 9, 11))
    write_study(tmp_path, results)
    page = (tmp_path / "report.html").read_text()
    assert page.count("<svg") == 4  # two plots, for wide and for narrow windows
    assert "http" not in page.replace("http-equiv", "")
    assert "<in>" not in page
    assert "<hits>" not in page
    assert "6 samples failed" in page
    assert "more than half of the samples have none in fog visibility 100 m" in page
    assert "rest on 4 independent scenes or rounds" in page
    assert "<li>14 of 20 samples: light is guessed</li>" in page


def test_a_combination_of_which_nothing_is_left_is_shown_without_marks(tmp_path: Path) -> None:
    results = made(tmp_path, lost=tuple(range(1, 20, 2)))
    assert results.summaries[(100,), "depth_mae_m"].estimate.n == 0
    write_study(tmp_path, results)
    assert "<span>–</span>" in (tmp_path / "report.html").read_text()


@pytest.mark.parametrize(("lost", "marks"), [((), 2), (tuple(range(1, 20, 2)), 1)])
def test_notebooks_mark_the_combinations_that_have_a_mean(
    tmp_path: Path, lost: tuple[int, ...], marks: int
) -> None:
    assert made(tmp_path, lost=lost)._means("depth_mae_m").count("<circle") == marks


def test_the_interval_of_the_only_mean_is_within_the_axis(tmp_path: Path) -> None:
    results = made(tmp_path, lost=tuple(range(1, 20, 2)))
    left = results.summaries[(20,), "depth_mae_m"].estimate
    assert left.high > 1.2 * left.mean
    low, high = _over_numbers(results, ["depth_mae_m"], 6.0).axes[0].get_ylim()
    assert low <= left.low
    assert high > left.high
