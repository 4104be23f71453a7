"""Data sets as users read them: samples, conditions, splits, tables, arrays, tensors."""

import pickle
import shutil
from collections import Counter
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

import spisim.dataset
from datasets import META, SCENES, change, make_set, sample_capture
from reconstruction import Capture, InputError, write_capture
from spisim.base.optional import import_optional
from spisim.dataset import DataSet
from spisim.dataset.parameters import Split, part_of

VISIBILITY = "scene.fog.visibility_m"


@pytest.fixture(scope="module")
def folder(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_set(tmp_path_factory.mktemp("sets") / "walls", capture)


@pytest.fixture(scope="module")
def data(folder: Path) -> DataSet:
    return spisim.dataset.open(folder)


@pytest.fixture
def own(folder: Path, tmp_path: Path) -> Path:
    """A copy of the data set to damage."""
    return Path(shutil.copytree(folder, tmp_path / "walls"))


def test_samples_come_in_order_with_what_was_drawn(data: DataSet, folder: Path) -> None:
    assert len(data) == 40
    assert [sample.index for sample in data] == list(range(40))
    sample = data[7]
    assert sample.scene_name == "walls-7"
    assert sample.parameters == {"scene": "walls", "power_w": 0.7, VISIBILITY: 80.0}
    assert sample.path == folder / "samples/000/000007.h5"
    assert [path.name for path in sample.sidecars] == ["000007.npz"]
    assert data[-1].index == 39
    assert [sample.index for sample in data[10:13]] == [10, 11, 12]
    assert dict(data.meta) == META
    with pytest.raises(IndexError):
        data[40]


def test_a_capture_is_read_once_and_only_when_asked_for(data: DataSet, capture: Capture) -> None:
    sample = data[5]
    assert "capture" not in vars(sample)
    assert sample.capture is sample.capture
    assert sample.capture.truth is not None
    assert capture.truth is not None
    np.testing.assert_array_equal(sample.capture.truth.depth_m, capture.truth.depth_m + 5)


def test_failed_samples_stand_apart_with_their_reason(data: DataSet) -> None:
    assert [record.index for record in data.failed] == [40, 41, 42]
    assert data.failed[1].error == "a laser hits nothing"


def test_conditions_choose_and_leave_out_samples_without_the_parameter(data: DataSet) -> None:
    near = data.where(lambda p: p[VISIBILITY] < 80)
    assert [sample.index for sample in near] == [1, 2, 4, 5]
    assert [sample.index for sample in near.where(lambda p: p["power_w"] > 0.3)] == [4, 5]
    assert len(data.where(lambda p: p["power_w"] > 99)) == 0


def test_an_unknown_parameter_names_the_nearest(data: DataSet) -> None:
    with pytest.raises(InputError, match=r"'power'.*did you mean 'power_w'"):
        data.where(lambda p: p["power"] > 1)


def test_samples_are_selected_by_index(data: DataSet) -> None:
    part = data[20:].select([30, 25, 30])
    assert [sample.index for sample in part] == [25, 30]
    with pytest.raises(InputError, match="no finished sample 3 in this set"):
        data[20:].select([25, 3])


def test_parts_share_no_scene_and_miss_no_sample(data: DataSet) -> None:
    parts = data.split(0.6, 0.2, 0.2, seed=1)
    scenes = [{sample.scene_name for sample in part} for part in parts]
    assert all(scenes)
    assert sum(map(len, scenes)) == SCENES == len(set.union(*scenes))
    assert sorted(sample.index for part in parts for sample in part) == list(range(40))
    assert parts == data.split(0.6, 0.2, 0.2, seed=1)
    assert parts != data.split(0.6, 0.2, 0.2, seed=2)


def test_more_samples_move_no_scene(data: DataSet) -> None:
    whole, early = data.split(0.6, 0.2, 0.2, seed=1), data[:19].split(0.6, 0.2, 0.2, seed=1)
    for before, after in zip(early, whole, strict=True):
        assert {s.index for s in before} == {s.index for s in after if s.index < 19}


def test_shares_are_kept_on_average() -> None:
    fractions = Split(0.7, 0.2, 0.1)
    result = Counter(part_of(f"scene-{k}", fractions, 0) for k in range(10_000))
    for part, fraction in fractions._asdict().items():
        sigma = np.sqrt(10_000 * fraction * (1 - fraction))
        assert abs(result[part] - 10_000 * fraction) < 3.5 * sigma


def test_a_part_of_no_share_is_empty(data: DataSet) -> None:
    train, validation, test = data.split(0.5, 0, 0.5)
    assert len(validation) == 0
    assert len(train) + len(test) == 40


def test_a_parameter_can_be_split_by(data: DataSet) -> None:
    train, _, test = data.split(0.5, 0, 0.5, by="power_w")
    assert not {s.parameters["power_w"] for s in train} & {s.parameters["power_w"] for s in test}


def test_impossible_splits_are_refused(data: DataSet) -> None:
    with pytest.raises(InputError, match=r"is empty .* 1 different values of scene_name"):
        data[:1].split()
    with pytest.raises(InputError, match=r"is empty .* of scene are split"):
        data.split(by="scene")
    with pytest.raises(InputError, match=r"sum to 1; found 0\.8, 0\.2, 0\.1"):
        data.split(0.8, 0.2, 0.1)
    with pytest.raises(InputError, match="from 0 to 1"):
        data.split(1.5, -0.5, 0)
    with pytest.raises(InputError, match=r"no parameter 'power'.*did you mean 'power_w'"):
        data.split(by="power")


def test_arrays_are_stacked(data: DataSet, capture: Capture) -> None:
    arrays = data[:4].arrays("buckets", "true_depth_m", "spot_range_m", "power_w")
    assert {name: values.shape for name, values in arrays.items()} == {
        "buckets": (4, 1, capture.plan.exposures),
        "true_depth_m": (4, 1, 16, 16),
        "spot_range_m": (4, 1, 4),
        "power_w": (4,),
    }
    assert capture.truth is not None
    true_m = capture.truth.at(0).spot_range_m
    np.testing.assert_allclose(arrays["spot_range_m"][2, 0], true_m, rtol=1e-9)
    np.testing.assert_array_equal(arrays["buckets"][3], capture.buckets.signal)
    np.testing.assert_array_equal(arrays["power_w"], [0, 0.1, 0.2, 0.3])
    assert np.ptp(arrays["true_depth_m"][:, 0, 0, 0]) == 3


def test_what_is_no_number_is_no_array(data: DataSet) -> None:
    with pytest.raises(InputError, match=r"'true_depth'.*did you mean 'true_depth_m'"):
        data.arrays("true_depth")
    with pytest.raises(InputError, match="no array or numeric parameter 'scene'"):
        data.arrays("scene")


def test_a_parameter_is_nan_in_samples_that_lack_it(data: DataSet) -> None:
    clear = np.arange(40) % 3 == 0
    visibility_m = data.arrays(VISIBILITY)[VISIBILITY]
    np.testing.assert_array_equal(np.isnan(visibility_m), clear)
    np.testing.assert_array_equal(visibility_m[~clear], 10 * np.flatnonzero(~clear) + 10)
    assert np.isnan(data[:1].arrays(VISIBILITY)[VISIBILITY]).all()  # where all selected lack it
    assert np.isnan(data[0].array(VISIBILITY))


def test_names_are_refused_before_anything_is_read(own: Path) -> None:
    shutil.rmtree(own / "samples")
    data = spisim.dataset.open(own)
    for build in (data.arrays, data.torch):
        with pytest.raises(InputError, match=rf"did you mean '{VISIBILITY}'"):
            build("scene.fog.visibility")


def test_what_is_a_number_in_some_samples_only_is_none(own: Path) -> None:
    change(own, 'UPDATE samples SET parameters = \'{"power_w": [1, 2]}\' WHERE "index" = 3')
    with pytest.raises(InputError, match=r"no array or numeric parameter 'power_w'"):
        spisim.dataset.open(own).arrays("power_w")


def test_captures_without_truth_have_no_true_arrays(own: Path, capture: Capture) -> None:
    write_capture(
        replace(sample_capture(capture, 0), truth=None, spots=None), own / "samples/000/000000.h5"
    )
    data = spisim.dataset.open(own)
    for name in ("true_image", "spot_range_m", "spot_readings"):
        with pytest.raises(InputError, match=rf"000000\.h5: the capture has no {name}"):
            data.arrays(name)


def test_shapes_that_differ_are_named(own: Path, capture: Capture) -> None:
    buckets = capture.buckets
    two = replace(
        buckets,
        counts=np.repeat(buckets.counts, 2, axis=0),
        saturated=np.repeat(buckets.saturated, 2, axis=0),
    )
    write_capture(
        replace(sample_capture(capture, 1), buckets=two, spots=None), own / "samples/000/000001.h5"
    )
    with pytest.raises(InputError, match=r"000001\.h5: buckets has shape \(2, 256\)"):
        spisim.dataset.open(own).arrays("buckets")


def test_a_missing_capture_is_named(own: Path) -> None:
    (own / "samples/000/000002.h5").unlink()
    sample = spisim.dataset.open(own)[2]
    with pytest.raises(InputError, match=r"000002\.h5: no such capture file"):
        _ = sample.capture


def test_the_table_has_a_column_for_every_parameter(data: DataSet) -> None:
    pytest.importorskip("pandas")
    table = data.table()
    assert table.index.tolist() == list(range(40))
    assert table.loc[7, VISIBILITY] == 80
    assert table[VISIBILITY].isna().sum() == 14
    assert table["warnings"].tolist() == [" | ".join(each.warnings) for each in data.records]
    assert table.loc[3, "scene_name"] == "walls-3"
    chosen = data.select(table.query(f"`{VISIBILITY}` < 80 and power_w > 0.3").index)
    assert [sample.index for sample in chosen] == [4, 5]
    assert data[:0].table().empty


def test_xarray_has_axes_units_and_coordinates(data: DataSet) -> None:
    pytest.importorskip("xarray")
    dataset = data[:6].xarray()
    assert dataset["true_depth_m"].dims == ("sample", "frame", "row", "column")
    assert dataset["true_depth_m"].attrs["units"] == "m"
    assert dataset["spot_readings"].dims == ("sample", "frame", "spot", "tap")
    far = dataset.where(dataset.power_w > 0.35, drop=True)
    assert far["sample"].values.tolist() == [4, 5]
    assert dataset.attrs["name"] == "walls"
    np.testing.assert_array_equal(
        dataset[VISIBILITY], [np.nan, 20, 30, np.nan, 50, 60]
    )  # not every sample has it
    assert set(data[:2].xarray("buckets", "power_w")) == {"buckets", "power_w"}


def test_a_parameter_that_is_a_list_has_an_axis_of_its_own(own: Path) -> None:
    pytest.importorskip("xarray")
    change(own, "UPDATE samples SET parameters = '{\"offset_m\": [0.1, 0.2, 0.3]}'")
    offset_m = spisim.dataset.open(own).xarray("offset_m")["offset_m"]
    assert offset_m.dims == ("sample", "offset_m.0")
    assert offset_m.values[0].tolist() == [0.1, 0.2, 0.3]


@pytest.mark.slow
def test_tensors_are_loaded_by_workers(data: DataSet) -> None:
    torch = pytest.importorskip("torch")
    tensors = data.torch("buckets", "true_depth_m", "power_w")
    assert len(tensors) == 40
    assert len(pickle.loads(pickle.dumps(tensors))) == 40
    loader = torch.utils.data.DataLoader(
        tensors, batch_size=16, num_workers=2, multiprocessing_context="spawn"
    )
    batches = list(loader)
    assert [len(batch["index"]) for batch in batches] == [16, 16, 8]
    assert torch.cat([batch["index"] for batch in batches]).tolist() == list(range(40))
    assert batches[0]["true_depth_m"].dtype == torch.float32
    assert batches[0]["true_depth_m"].shape == (16, 1, 16, 16)
    assert batches[1]["power_w"][3] == pytest.approx(1.9)


def test_a_missing_package_names_the_extra(data: DataSet, monkeypatch: pytest.MonkeyPatch) -> None:
    for package in ("pandas", "xarray", "torch"):
        monkeypatch.setitem(__import__("sys").modules, package, None)
    monkeypatch.delitem(__import__("sys").modules, "spisim.dataset.torch", raising=False)
    with pytest.raises(InputError, match=r"package pandas: pip install 'spisim\[data\]'"):
        data.table()
    with pytest.raises(InputError, match=r"package xarray: pip install 'spisim\[data\]'"):
        data.xarray()
    with pytest.raises(InputError, match=r"package torch: pip install 'spisim\[torch\]'"):
        data.torch("buckets")


def test_a_module_of_ours_that_is_missing_is_no_missing_package() -> None:
    with pytest.raises(ModuleNotFoundError):
        import_optional("spisim.no_such_module", "data")


def test_a_folder_without_manifest_is_refused(tmp_path: Path) -> None:
    with pytest.raises(InputError, match=r"not a data set \(manifest\.sqlite is missing\)"):
        spisim.dataset.open(tmp_path)
    assert not list(tmp_path.iterdir())


@pytest.mark.parametrize(
    "statement",
    [
        "DROP TABLE samples",
        "DROP TABLE meta",
        "ALTER TABLE samples DROP COLUMN sha256",
        "UPDATE samples SET parameters = '{' WHERE \"index\" = 3",
        "UPDATE samples SET parameters = '[1]' WHERE \"index\" = 3",
        "UPDATE samples SET finished = 'today' WHERE \"index\" = 3",
        "DELETE FROM meta WHERE key = 'plan_digest'",
        "UPDATE meta SET value = 'many' WHERE key = 'samples'",
        "UPDATE meta SET value = '' WHERE key = 'files'",
    ],
)
def test_a_damaged_manifest_is_refused(own: Path, statement: str) -> None:
    change(own, statement)
    with pytest.raises(InputError, match=r"manifest\.sqlite: not a manifest of this version"):
        spisim.dataset.open(own)


def test_what_is_no_database_is_refused(own: Path) -> None:
    (own / "manifest.sqlite").write_bytes(b"name: walls\n" * 100)
    with pytest.raises(InputError, match="not a manifest of this version"):
        spisim.dataset.open(own)


def test_another_schema_is_refused(own: Path) -> None:
    change(own, "UPDATE meta SET value = '9' WHERE key = 'schema_version'")
    with pytest.raises(InputError, match="schema_version is 9; this software reads 1"):
        spisim.dataset.open(own)


def test_reading_changes_nothing(own: Path) -> None:
    before = {path: path.stat().st_mtime_ns for path in own.rglob("*")}
    spisim.dataset.open(own).arrays("power_w")
    assert {path: path.stat().st_mtime_ns for path in own.rglob("*")} == before
