"""What is found wrong with a data set's files, and its export as shards."""

import io
import json
import shutil
import tarfile
from dataclasses import replace
from pathlib import Path

import pytest

import spisim.dataset
from datasets import change, make_set, sample_capture
from reconstruction import Capture, InputError, read_capture, write_capture
from spisim.dataset import verify
from spisim_formats.samples.webdataset import write_shards


@pytest.fixture(scope="module")
def folder(capture: Capture, tmp_path_factory: pytest.TempPathFactory) -> Path:
    return make_set(tmp_path_factory.mktemp("sets") / "walls", capture, done=6, failed=1)


@pytest.fixture
def own(folder: Path, tmp_path: Path) -> Path:
    return Path(shutil.copytree(folder, tmp_path / "walls"))


def result(folder: Path) -> list[tuple[str, str]]:
    return [(finding.file, finding.problem) for finding in verify(folder)]


def test_a_sound_set_has_nothing_wrong(folder: Path) -> None:
    fractions: list[float] = []
    assert verify(folder, fractions.append) == []
    assert fractions == [pytest.approx(k / 6) for k in range(1, 7)]


def test_every_kind_of_damage_is_named(own: Path, capture: Capture) -> None:
    samples = own / "samples/000"
    (samples / "000000.h5").unlink()
    content = bytearray((samples / "000001.h5").read_bytes())
    content[len(content) // 2] ^= 1
    (samples / "000001.h5").write_bytes(content)
    with (samples / "000002.npz").open("ab") as file:
        file.write(b"more")
    write_capture(sample_capture(capture, 8), samples / "000008.h5")
    write_capture(sample_capture(capture, 3, plan="another"), samples / "000009.h5")
    write_capture(capture, samples / "mine.h5")
    (samples / "notes.txt").write_text("mine")
    (samples / "broken.h5").write_bytes(b"no HDF5")
    (samples / ".000010.h5.0123abcd.tmp").write_bytes(b"half")
    (own / "plan.yaml").unlink()
    assert result(own) == [
        ("plan.yaml", "missing"),
        ("samples/000/.000010.h5.0123abcd.tmp", "unfinished"),
        ("samples/000/000000.h5", "missing"),
        ("samples/000/000001.h5", "damaged"),
        ("samples/000/000002.npz", "damaged"),
        ("samples/000/000008.h5", "extra"),
        ("samples/000/000009.h5", "foreign"),
        ("samples/000/broken.h5", "extra"),
        ("samples/000/mine.h5", "foreign"),
        ("samples/000/notes.txt", "extra"),
    ]


@pytest.mark.parametrize("settings", ["", "data_set: walls", "a: b: c", "- 1"])
def test_a_capture_without_origin_is_foreign(own: Path, capture: Capture, settings: str) -> None:
    alone = replace(capture, provenance=replace(capture.provenance, settings=settings))
    write_capture(alone, own / "samples/000/alone.h5")
    assert result(own) == [("samples/000/alone.h5", "foreign")]


def test_a_file_of_a_failed_sample_is_extra(own: Path) -> None:
    change(own, "UPDATE samples SET status = 'failed', file = NULL, sidecars = '{}' WHERE rowid=2")
    assert result(own) == [("samples/000/000002.h5", "extra"), ("samples/000/000002.npz", "extra")]


def test_shards_hold_captures_and_what_was_drawn(
    folder: Path, tmp_path: Path, capture: Capture
) -> None:
    data = spisim.dataset.open(folder)
    paths = write_shards(data, tmp_path / "shards", shard_size=4)
    assert [path.name for path in paths] == ["shard-000000.tar", "shard-000001.tar"]
    with tarfile.open(paths[1]) as tar:
        assert tar.getnames() == [
            "000004.h5", "000004.json", "000004.npz", "000005.h5", "000005.json", "000005.npz",
        ]  # fmt: skip
        tar.extractall(tmp_path / "out", filter="data")
    unpacked = read_capture(tmp_path / "out/000005.h5")
    assert unpacked.frame().digest(unpacked.setup) == capture.frame().digest(capture.setup)
    fields = json.loads((tmp_path / "out/000005.json").read_text())
    assert fields == {
        "index": 5,
        "scene_name": "walls-5",
        "parameters": {"scene": "walls", "power_w": 0.5, "scene.fog.visibility_m": 60.0},
    }


def test_equal_sets_give_equal_shards(folder: Path, own: Path, tmp_path: Path) -> None:
    one, two = (
        write_shards(spisim.dataset.open(position), tmp_path / str(k))
        for k, position in enumerate((folder, own))
    )
    assert one[0].read_bytes() == two[0].read_bytes()
    again = write_shards(spisim.dataset.open(own), tmp_path / "1")
    assert again[0].read_bytes() == one[0].read_bytes()


def test_shards_of_another_export_are_left_alone(folder: Path, tmp_path: Path) -> None:
    data = spisim.dataset.open(folder)
    write_shards(data, tmp_path, shard_size=2)
    with pytest.raises(InputError, match=r"shard-000001\.tar belongs to another export"):
        write_shards(data, tmp_path, shard_size=5000)
    assert len(list(tmp_path.iterdir())) == 3


def test_what_cannot_be_exported_is_refused(own: Path, tmp_path: Path) -> None:
    data = spisim.dataset.open(own)
    with pytest.raises(InputError, match="no finished samples to export"):
        write_shards(data[:0], tmp_path / "shards")
    with pytest.raises(InputError, match="shard_size should be at least 1; found -1"):
        write_shards(data, tmp_path / "shards", shard_size=-1)
    (own / "samples/000/000003.h5").unlink()
    with pytest.raises(InputError, match=r"000003\.h5: missing"):
        write_shards(data, tmp_path / "shards")
    assert not (tmp_path / "shards").exists()


def test_shards_are_read_as_one_stream(folder: Path, tmp_path: Path) -> None:
    """As WebDataset does: a sample's members follow each other, their key is before the dot."""
    (path,) = write_shards(spisim.dataset.open(folder), tmp_path)
    keys = []
    with tarfile.open(fileobj=io.BytesIO(path.read_bytes()), mode="r|") as tar:
        keys = [member.name.partition(".")[0] for member in tar]
    assert keys == sorted(keys)
    assert len(set(keys)) == 6
