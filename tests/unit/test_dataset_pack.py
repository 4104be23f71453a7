"""Packed data sets: what they hold, read like the set itself, and when they are refused."""

import json
import multiprocessing
import pickle
import shutil
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from typer.testing import CliRunner

import spisim
from datasets import change, make_set
from reconstruction import Capture, InputError, write_capture
from spisim.dataset import DataSet, opening, pack_dataset, verify
from spisim.dataset.pack import INDEX
from spisim_app.cli import app

VISIBILITY = "scene.fog.visibility_m"
NAMES = ("buckets", "true_depth_m", VISIBILITY)


@pytest.fixture(scope="module")
def made(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    """A data set and a pack of it, side by side."""
    folder = tmp_path_factory.mktemp("packs")
    pack_dataset(
        spisim.open_dataset(make_set(folder / "walls", capture, done=12, failed=1)),
        folder / "pack",
        ["buckets", "true_depth_m"],
    )
    return folder


@pytest.fixture
def own(made: Path, tmp_path: Path) -> Path:
    """Copies to change."""
    return Path(shutil.copytree(made, tmp_path / "own"))


def test_a_pack_reads_as_its_data_set(made: Path) -> None:
    data, pack = spisim.open_dataset(made / "walls"), spisim.open_dataset(made / "pack")
    assert pack.records == data.records
    assert [sample.parameters for sample in pack] == [sample.parameters for sample in data]
    for mine, theirs in zip(pack.split(0.5, 0, 0.5), data.split(0.5, 0, 0.5), strict=True):
        assert mine.records == theirs.records
        for name, values in mine.arrays(*NAMES).items() if mine else ():
            np.testing.assert_array_equal(values, theirs.arrays(name)[name])
    assert np.isnan(pack[0].array(VISIBILITY))
    np.testing.assert_array_equal(pack[7].array("buckets"), data[7].array("buckets"))


@pytest.mark.parametrize("folder", ["walls", "pack"])
def test_rows_are_read_one_by_one_also_elsewhere(made: Path, folder: str) -> None:
    part = spisim.open_dataset(made / folder).select([2, 3, 7])
    rows = pickle.loads(pickle.dumps(part.rows(*NAMES)))
    assert len(rows) == 3
    assert [int(row["index"]) for row in rows] == [2, 3, 7]
    assert [int(row["index"]) for row in rows[1:]] == [3, 7]
    for position, row in enumerate(rows):
        assert row.keys() == {*NAMES, "index"}
        for name in NAMES:
            np.testing.assert_array_equal(row[name], part[position].array(name))
            assert row[name].dtype == part[position].array(name).dtype


def test_captures_are_not_read_again(own: Path) -> None:
    before = spisim.open_dataset(own / "pack").arrays(*NAMES)
    shutil.rmtree(own / "walls" / "samples")
    after = spisim.open_dataset(own / "pack").arrays(*NAMES)
    for name in NAMES:
        np.testing.assert_array_equal(before[name], after[name])


def test_what_is_not_packed_is_told(made: Path) -> None:
    pack = spisim.open_dataset(made / "pack")
    for ask in (pack.arrays, pack.rows, pack[0].array):
        with pytest.raises(InputError, match=r"pack has no array 'true_image': .*pack it too"):
            ask("true_image")
        with pytest.raises(InputError, match=r"'bucket': did you mean 'buckets'"):
            ask("bucket")
    with pytest.raises(InputError, match="a pack has no captures"):
        _ = pack[0].capture


def grow(own: Path) -> None:
    change(
        own / "walls",
        "UPDATE samples SET status = 'done', bytes = 1, sha256 = "
        f"'{'0' * 64}', file = 'samples/000/000012.h5' WHERE \"index\" = 12",
    )


def make_again(own: Path) -> None:
    change(own / "walls", f"UPDATE samples SET sha256 = '{'0' * 64}' WHERE \"index\" = 3")


@pytest.mark.parametrize(
    ("happen", "reported"), [(grow, "now has 13"), (make_again, "now has 12, some of them changed")]
)
def test_a_pack_whose_data_set_has_other_samples_is_refused(
    own: Path, happen: Callable[[Path], None], reported: str
) -> None:
    happen(own)
    with pytest.raises(
        InputError, match=rf"pack was packed when .*walls had 12 .*{reported}; pack it"
    ):
        spisim.open_dataset(own / "pack")
    moved = (own / "pack").rename(own.parent / "moved")
    assert len(spisim.open_dataset(moved)) == 12


@pytest.mark.parametrize(
    ("old", "new", "reported"),
    [
        ('"format":1', '"format":2', "format: invalid in a pack index of format 1"),
        (
            '"001.npy"',
            '"../x.npy"',
            "arrays.true_depth_m.file: invalid in a pack index of format",
        ),
        ('"001.npy"', '"002.npy"', "002.npy: true_depth_m cannot be read"),
        ('"001.npy"', '"000.npy"', "000.npy: true_depth_m differs from when it was packed"),
    ],
)
def test_an_index_that_cannot_be_is_refused(own: Path, old: str, new: str, reported: str) -> None:
    index = own / "pack" / INDEX
    text = json.dumps(json.loads(index.read_text()), separators=(",", ":"))
    assert old in text
    index.write_text(text.replace(old, new))
    with pytest.raises(InputError, match=reported):
        spisim.open_dataset(own / "pack")


def test_damage_is_found(own: Path) -> None:
    assert verify(own / "pack") == []
    path = own / "pack" / "001.npy"
    content = bytearray(path.read_bytes())
    content[-1] ^= 1
    path.write_bytes(content)
    assert [(each.file, each.problem) for each in verify(own / "pack")] == [("001.npy", "damaged")]
    path.write_bytes(content[:-1])
    with pytest.raises(InputError, match=r"001\.npy: true_depth_m"):
        spisim.open_dataset(own / "pack")


def test_a_link_in_a_pack_is_refused(own: Path) -> None:
    path = own / "pack" / "001.npy"
    path.rename(own / "elsewhere.npy")
    path.symlink_to(own / "elsewhere.npy")
    with pytest.raises(InputError, match=r"001\.npy is a link"):
        spisim.open_dataset(own / "pack")


def test_captures_are_verified_before_they_are_packed(own: Path, capture: Capture) -> None:
    data = spisim.open_dataset(own / "walls")
    write_capture(replace(capture, spots=None), own / "walls/samples/000/000004.h5")
    with pytest.raises(InputError, match=r"000004\.h5: changed since it was written"):
        pack_dataset(data, own / "pack")
    assert len(spisim.open_dataset(own / "pack")) == 12  # the earlier one is whole
    assert sorted(path.name for path in own.iterdir()) == ["pack", "walls"]


def test_what_cannot_be_packed_is_refused(own: Path) -> None:
    data = spisim.open_dataset(own / "walls")
    with pytest.raises(InputError, match="no finished samples to pack"):
        pack_dataset(data[:0], own / "new")
    with pytest.raises(InputError, match="is itself a pack"):
        pack_dataset(spisim.open_dataset(own / "pack"), own / "new")
    with pytest.raises(InputError, match="did you mean 'buckets'"):
        pack_dataset(data, own / "new", ["bucket"])
    with pytest.raises(InputError, match="power_w is a parameter"):
        pack_dataset(data, own / "new", ["power_w"])
    for inside in (own / "walls" / "pack", own):
        with pytest.raises(InputError, match="overlaps the data set"):
            pack_dataset(data, inside)
    (own / "mine").mkdir()
    (own / "mine" / "notes.txt").write_text("mine")
    with pytest.raises(InputError, match="is neither empty nor a pack"):
        pack_dataset(data, own / "mine")
    assert not (own / "new").exists()


def test_a_run_into_a_pack_is_refused(own: Path) -> None:
    with pytest.raises(InputError, match="is a pack, not a data set"):
        opening._check_is_free(None, opening.Layout(own / "pack"))  # type: ignore[arg-type]


def test_the_command_packs_what_is_named(own: Path) -> None:
    reported = ["--array", "spot_directions", "--array", "true_depth_known", "--json"]
    command = ["dataset", "pack", str(own / "walls"), "-o", str(own / "pack"), *reported]
    result = CliRunner().invoke(app, command)
    assert result.exit_code == 0
    assert json.loads(result.stdout)["arrays"] == ["spot_directions", "true_depth_known"]
    xarray = pytest.importorskip("xarray")
    assert xarray.__name__
    packed = spisim.open_dataset(own / "pack").xarray()
    assert packed["true_depth_known"].dims == ("sample", "frame", "row", "column")
    assert packed["true_depth_known"].all()


@pytest.mark.slow
@pytest.mark.parametrize("context", ["fork", "spawn"])
@pytest.mark.parametrize("folder", ["walls", "pack"])
def test_workers_read_in_the_order_of_the_seed(made: Path, folder: str, context: str) -> None:
    """Forked ones, too, after Dr.Jit was loaded, which they do not use."""
    torch = pytest.importorskip("torch")
    from spisim.transport.backend import activate

    activate()
    if context not in multiprocessing.get_all_start_methods():
        pytest.skip("no fork here")
    data: DataSet = spisim.open_dataset(made / folder)
    orders = []
    for seed in (3, 3, 4):
        loader = torch.utils.data.DataLoader(
            data.torch(*NAMES, "true_depth_m"),
            batch_size=5,
            num_workers=2,
            shuffle=True,
            generator=torch.Generator().manual_seed(seed),
            multiprocessing_context=context,
        )
        batches = list(loader)
        orders.append(torch.cat([batch["index"] for batch in batches]).tolist())
        depth_m = torch.cat([batch["true_depth_m"] for batch in batches])
        np.testing.assert_array_equal(
            depth_m.numpy(), data.arrays("true_depth_m")["true_depth_m"][orders[-1]]
        )
    assert orders[0] == orders[1] != orders[2]
    assert sorted(orders[0]) == list(range(12))
