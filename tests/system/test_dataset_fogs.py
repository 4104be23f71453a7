"""A data set whose fogs share their light: the same bytes in any order, and what it states."""

import csv
from pathlib import Path

import pytest
import yaml

from reconstruction import read_capture
from spisim.dataset.fogs import forget
from spisim.dataset.folder import TRACED_IN, Layout
from spisim.dataset.making import make_dataset
from spisim.dataset.planned import stated_plan
from spisim.dataset.sample import Maker
from spisim.dataset.study.plan import PlannedStudy, StudyPlan
from spisim.dataset.study.results import results_csv, results_of

PLAN = {
    "name": "fogs",
    "scenes": [{"family": "targets", "parameters": {"target": "plane"}}],
    "samples": 4,
    "vary": {
        "weather": {
            "grid": [
                {},
                {"scene.fog": {"kind": "moderate-radiation", "visibility_m": 100}},
                {"scene.fog": {"kind": "moderate-radiation", "visibility_m": 50}},
                {"scene.fog": {"kind": "moderate-radiation", "visibility_m": 200}},
            ]
        }
    },
    "transport_noise_share": 3,
}


@pytest.fixture(scope="module")
def folder(tmp_path_factory: pytest.TempPathFactory) -> Path:
    folder = tmp_path_factory.mktemp("fogs") / "set"
    make_dataset(PLAN, folder, workers=1)
    return folder


def test_any_order_gives_the_same_bytes(folder: Path, tmp_path: Path) -> None:
    make = Maker(stated_plan(PLAN), tmp_path)
    for index in (3, 1, 2):
        forget()  # as a process that was killed
        assert make(index).done
        there = Layout(folder).capture(index)
        assert Layout(tmp_path).capture(index).read_bytes() == there.read_bytes()


def test_captures_and_manifest_say_which_fog_was_traced(folder: Path) -> None:
    records = make_dataset(PLAN, folder).records
    assert [record.parameters.get(TRACED_IN) for record in records] == [None, 50, 50, 50]
    for record in records[1:]:
        capture = read_capture(folder / str(record.file))
        light = yaml.safe_load(capture.provenance.settings)["light"]
        if record.index == 2:
            assert "reweighted" not in light
        else:
            ratio = 50 / record.parameters["scene.fog.visibility_m"]
            assert light["reweighted"]["ratio"] == pytest.approx(ratio)
            assert 0.25 <= light["reweighted"]["carried"] <= 1
        assert light["noise_share"] <= 3
        assert light["spot_noise_share"] <= 3


def test_a_lost_manifest_is_rebuilt_with_it(folder: Path) -> None:
    before = [record.parameters for record in make_dataset(PLAN, folder).records]
    Layout(folder).manifest.unlink()
    assert [record.parameters for record in make_dataset(PLAN, folder).records] == before


def test_the_results_of_a_study_have_a_column_for_it(folder: Path) -> None:
    study = {"x": "scene.fog.visibility_m", "metrics": ["depth_mae_m"]}
    fields = {name: value for name, value in PLAN.items() if name != "samples"}
    planned = stated_plan({**fields, "study": study}, StudyPlan)
    assert isinstance(planned.plan, StudyPlan)
    records = make_dataset(PLAN, folder).records
    results = results_of(PlannedStudy(planned.plan, planned.text, planned.path), records, {})
    head, *rows = csv.reader(results_csv(results).splitlines())
    column = head.index(TRACED_IN)
    assert [row[column] for row in rows] == ["", "50.0", "50.0", "50.0"]
