"""A study from the command line: simulated, evaluated, gone on with, and refused."""

import csv
import json
import shutil
from pathlib import Path
from typing import Any

import pytest
import yaml
from scipy.stats import t
from typer.testing import CliRunner

from spisim_app.cli import app

PLAN: dict[str, Any] = {
    "name": "wall",
    "scenes": [{"scene": "target-plane"}],
    "vary": {
        "instrument.projector.shape": [16, 16],
        "instrument.plan.patterns": 32,
        "scene.drone.offset_m": [{"uniform": [-1.0, 1.0]}, 0, 0],
        "scene.fog.visibility_m": {"grid": [25, 1000]},
        "scene.fog.kind": "heavy-advection",
    },
    "spp": 8,
    "study": {
        "x": "scene.fog.visibility_m",
        "x_scale": "log",
        "rounds": 2,
        "metrics": ["range_bias_m[cw]", "depth_mae_m", "depth_mae_m[nearest]"],
    },
}


def study(path: Path, output: Path, *options: str, **changes: Any) -> Any:
    plan = {**PLAN, **changes}
    path.mkdir(exist_ok=True)
    (path / "plan.yaml").write_text(yaml.safe_dump(plan, sort_keys=False))
    arguments = ["study", str(path / "plan.yaml"), "-o", str(output), "--workers", "1"]
    return CliRunner().invoke(app, [*arguments, "--no-progress", *options])


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("study")
    run = study(folder, folder / "out", "--json")
    assert run.exit_code == 0, run.output
    fields = json.loads(run.stdout)
    assert (fields["samples"], fields["made"], fields["evaluated"], fields["failed"]) == (
        4,
        4,
        4,
        0,
    )
    assert all(Path(path).is_file() for path in fields["written"])
    return folder


def rows(path: Path) -> list[dict[str, str]]:
    with path.open(newline="") as file:
        return list(csv.DictReader(file))


def of_two(values: list[float]) -> tuple[float, float]:
    """Student's interval of the mean of two."""
    low, high = t.interval(0.95, 1, sum(values) / 2, abs(values[0] - values[1]) / 2)
    return float(low), float(high)


def test_tables_have_all_samples_and_means_within_their_intervals(folder: Path) -> None:
    samples = rows(folder / "out/results.csv")
    assert [row["scene.fog.visibility_m"] for row in samples] == ["25", "1000"] * 2
    assert [row["round"] for row in samples] == ["0", "0", "1", "1"]
    means = rows(folder / "out/summary.csv")
    assert len(means) == 2 * 3
    for row in means:
        values = [
            float(sample[row["metric"]])
            for sample in samples
            if sample["scene.fog.visibility_m"] == row["scene.fog.visibility_m"]
        ]
        assert float(row["mean"]) == pytest.approx(sum(values) / 2)
        assert (float(row["low"]), float(row["high"])) == pytest.approx(of_two(values))


def test_what_is_random_is_equal_within_a_round(folder: Path) -> None:
    """So that differences are those of the fog: the wall is as far away in both."""
    offsets = [row["scene.drone.offset_m"] for row in rows(folder / "out/results.csv")]
    assert offsets[0] == offsets[1] != offsets[2] == offsets[3]
    samples = rows(folder / "out/results.csv")
    differences = [
        float(samples[k + 1]["range_bias_m[cw]"]) - float(samples[k]["range_bias_m[cw]"])
        for k in (0, 2)
    ]
    reported = next(
        row for row in rows(folder / "out/differences.csv") if row["metric"] == "range_bias_m[cw]"
    )
    assert float(reported["mean"]) == pytest.approx(sum(differences) / 2)
    assert (float(reported["low"]), float(reported["high"])) == pytest.approx(of_two(differences))


def test_dense_fog_pulls_ranges_of_a_near_wall_closer(folder: Path) -> None:
    means = {
        row["scene.fog.visibility_m"]: float(row["mean"])
        for row in rows(folder / "out/summary.csv")
        if row["metric"] == "range_bias_m[cw]"
    }
    assert means["25"] < -0.2
    assert abs(means["1000"]) < 0.1


@pytest.mark.usefixtures("no_workers")
def test_run_again_it_makes_only_what_is_missing(folder: Path) -> None:
    out = folder / "out"
    captures = {path: path.stat().st_mtime_ns for path in sorted(out.glob("samples/*/*.h5"))}
    metrics = {path: path.stat().st_mtime_ns for path in sorted(out.glob("metrics/*/*.json"))}
    assert len(captures) == len(metrics) == 4
    before = (out / "report.html").read_bytes()
    lost = list(metrics)[2]
    lost.unlink()
    begun = [out / ".report.html.0123abcd.tmp", out / "plots/.range_bias_m.svg.0123abcd.tmp"]
    for path in begun:
        path.touch()
    run = study(folder, out, "--json")
    assert run.exit_code == 0, run.output
    assert json.loads(run.stdout)["made"] == 0
    assert {path: path.stat().st_mtime_ns for path in captures} == captures
    changed = [path for path, time in metrics.items() if path.stat().st_mtime_ns != time]
    assert changed == [lost]
    assert (out / "report.html").read_bytes() == before
    assert not any(path.exists() for path in begun)


@pytest.mark.usefixtures("no_workers")
def test_other_metrics_need_no_new_captures(folder: Path, tmp_path: Path) -> None:
    out = shutil.copytree(folder / "out", tmp_path / "out")
    other = {**PLAN["study"], "metrics": ["valid_spots"]}
    run = study(tmp_path, out, "--json", study=other)
    assert run.exit_code == 0, run.output
    assert json.loads(run.stdout)["made"] == 0
    assert {row["metric"] for row in rows(out / "summary.csv")} == {"valid_spots"}
    assert sorted(path.name for path in (out / "plots").iterdir()) == [
        "valid_spots.png",
        "valid_spots.svg",
    ]


def test_another_plan_in_the_same_folder_is_refused(folder: Path) -> None:
    run = study(folder, folder / "out", spp=9)
    assert run.exit_code == 2
    assert "spp: 9" in run.output


def test_workers_and_dask_exclude_each_other(tmp_path: Path) -> None:
    run = study(tmp_path, tmp_path / "out", "--dask", "tcp://127.0.0.1:9")
    assert run.exit_code == 2
    assert "--workers and --dask exclude each other" in run.stderr
    assert not (tmp_path / "out").exists()


@pytest.mark.usefixtures("no_workers")
def test_a_study_in_which_all_fails_says_why(tmp_path: Path) -> None:
    vary = {**PLAN["vary"], "instrument.detector.adc.full_scale_electrons": 1.0}
    once = {**PLAN["study"], "rounds": 1}
    run = study(tmp_path, tmp_path / "out", vary=vary, study=once)
    assert run.exit_code == 2, run.output
    assert "all samples failed; the first reason is" in run.output
    assert "saturated" in run.output


def test_plans_that_do_not_fit_are_refused_before_anything_is_made(tmp_path: Path) -> None:
    bad = {**PLAN["study"], "metrics": ["range_bais_m"]}
    run = study(tmp_path, tmp_path / "out", study=bad)
    assert run.exit_code == 2
    assert "did you mean 'range_bias_m'" in run.output
    run = study(tmp_path, tmp_path / "out", "--quick")
    assert run.exit_code == 2
    assert "study.quick is missing" in run.output
    assert not (tmp_path / "out").exists()
