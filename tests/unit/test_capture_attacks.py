"""HDF5 files of strangers: what leads out of them, fills memory or was changed is refused."""

import hashlib
import os
import re
import shutil
import subprocess
import tracemalloc
from pathlib import Path

import h5py
import numpy as np
import pytest

import attacks
from captures import full_capture
from hdf5files import changed, sealed
from hostile import survive
from reconstruction import read_capture, read_result, write_capture
from reconstruction.base.errors import InputError
from reconstruction.base.files import is_marked
from reconstruction.capture.hdf5.sizes import check_sizes
from reconstruction.capture.importers import load_array
from reconstruction.outputs.result_file import result_bytes
from reconstruction.reconstructor import reconstruct

DATA = Path(__file__).parents[1] / "data"


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A capture, a result and a MATLAB file, to be copied."""
    folder = tmp_path_factory.mktemp("made")
    capture = full_capture()
    write_capture(capture, folder / "capture.h5")
    (folder / "result.h5").write_bytes(result_bytes(reconstruct(capture)))
    with h5py.File(folder / "rig.mat", "w", userblock_size=512) as file:
        file["data"] = np.arange(40.0).reshape(2, 20)
        file["data"].attrs["units"] = b""
        file["#refs#/a"] = np.arange(3)
    return folder


FILES = {
    "capture.h5": (read_capture, "buckets/counts"),
    "result.h5": (read_result, "images/pursuit"),
    "rig.mat": (load_array, "data"),
}


@pytest.fixture(params=FILES)
def file(request, made, tmp_path):
    """A file, what reads it, and a dataset of it."""
    path = tmp_path / "own" / request.param
    path.parent.mkdir()
    shutil.copy(made / request.param, path)
    return path, *FILES[request.param]


@pytest.fixture
def path(made, tmp_path):
    return Path(shutil.copy(made / "capture.h5", tmp_path / "capture.h5"))


@pytest.fixture
def secret(tmp_path):
    return attacks.write_secret(tmp_path / "outside")


def refused(path, read, message):
    """Refused in a process of its own, whose memory, time and files are watched."""

    def attempt(_):
        with pytest.raises(InputError, match=f"{re.escape(path.name)}: .*{message}") as error:
            read(path)
        assert attacks.SECRET.decode() not in str(error.value)

    survive(attempt, [0], readable=[path.parent])


# Ways out of a file


@pytest.mark.parametrize("attack", attacks.LEAVING, ids=lambda attack: attack.__name__)
def test_what_leads_out_of_a_file_is_refused(file, secret, attack):
    path, read, name = file
    with changed(path) as content:
        attack(content, name, secret)
    refused(path, read, "is (a link to another file|a soft link|a virtual|stored in other files)")


@pytest.mark.parametrize("attack", attacks.LEAVING[::3], ids=lambda attack: attack.__name__)
@pytest.mark.parametrize("name", ["provenance/scene", "truth/image", "recorder/log"])
def test_wherever_it_stands(path, secret, attack, name):
    with changed(path) as content:
        content.require_dataset("recorder/log", (40,), "i4").attrs["units"] = b"1"
        attack(content, name, secret)
    refused(path, read_capture, f"{name} is (a link|stored in other files)")


@pytest.mark.parametrize(
    ("attack", "message"),
    [
        (attacks.second_name, "is a second name"),
        (attacks.circle, "is a second name"),
        (attacks.named_type, "is neither a group nor a dataset"),
        (attacks.reference, "buckets/counts must hold numbers"),
    ],
)
def test_tangles_are_refused(path, secret, attack, message):
    with changed(path) as content:
        attack(content, "buckets/counts", secret)
    refused(path, read_capture, message)


def test_a_file_has_so_many_objects_so_deep(path):
    with changed(path) as content:
        content["/".join("d" * 40)] = 1
    refused(path, read_capture, "groups within more than 32 groups")
    with changed(path) as content:
        del content["d"]
        for number in range(10_001):
            content.create_group(f"recorder/{number}")
    refused(path, read_capture, "holds more than 10000 groups and datasets")


# Bombs


@pytest.mark.parametrize("attack", attacks.BOMBS, ids=lambda attack: attack.__name__)
def test_bombs_stop_at_a_stated_limit(file, secret, attack):
    path, read, name = file
    if name == "buckets/counts":
        name = "patterns/index"  # what nothing else says the shape of
    with changed(path) as content:
        attack(content, name, secret)
    assert path.stat().st_size < 3e6
    refused(path, read, "unpacks? to|more than 65536 chunks|has shape|numbers, found")


@pytest.mark.parametrize(
    ("length", "name"),
    [(len("sequency-2d"), "patterns/order"), (len("2025-01-01T00:00:00+00:00"), "'created' of /")],
)
def test_lengths_of_strings_are_not_believed(path, length, name):
    foreign = attacks.foreign_copy(path.read_bytes())
    path.write_bytes(foreign)
    assert read_capture(path).provenance == full_capture().provenance
    path.write_bytes(attacks.long_string(foreign, length))
    refused(path, read_capture, f"{name} (claims a string of|has) 4294967040 bytes")


@pytest.mark.parametrize("name", ["format", "version", "created"])
def test_a_long_attribute_is_refused_before_it_is_read(path, name):
    path.write_bytes(attacks.foreign_copy(path.read_bytes()))
    with changed(path) as content:
        content.attrs[name] = "m" * 50_000_000
    tracemalloc.start()
    refused(path, read_capture, f"attribute '{name}' of / has 50000000 bytes, at most 65536 are")
    assert tracemalloc.get_traced_memory()[1] < 1e7
    tracemalloc.stop()


@pytest.mark.parametrize("version", ["v108", "v110", "latest"])
@pytest.mark.parametrize("head", [0, 512])
def test_strings_of_every_format_of_hdf5_are_read(path, tmp_path, version, head):
    path.write_bytes(attacks.foreign_copy(path.read_bytes()))
    with (
        h5py.File(path) as old,
        h5py.File(tmp_path / "new.h5", "w", libver=(version,) * 2, userblock_size=head) as new,
    ):
        for group in old:
            old.copy(group, new)
        for name, value in old.attrs.items():
            new.attrs[name] = value
    copy = read_capture(tmp_path / "new.h5")
    assert copy.provenance == full_capture().provenance


def test_what_others_compress_is_read(path):
    """As most recorders and MATLAB itself do; what is not written at all is zero."""
    counts = read_capture(path).buckets.counts
    with changed(path) as content:
        for name in ("buckets/counts", "spots/taps", "truth/image"):
            values, units = content[name][()], content[name].attrs["units"]
            del content[name]
            options = {"chunks": True, "compression": "gzip", "shuffle": True, "fletcher32": True}
            content.create_dataset(name, data=values, **options).attrs["units"] = units
        del content["buckets/saturated"]
        content.create_dataset("buckets/saturated", counts.shape, "u1").attrs["units"] = b"1"
    copy = read_capture(path)
    np.testing.assert_array_equal(copy.buckets.counts, counts)
    assert not copy.buckets.saturated.any()


@pytest.mark.parametrize("compression", ["lzf", 9])
def test_other_ways_to_pack_are_named(path, compression):
    with changed(path) as content:
        values = content["buckets/counts"][()]
        del content["buckets/counts"]
        options = {"compression": compression} if compression == "lzf" else {"scaleoffset": True}
        content.create_dataset("buckets/counts", data=values, **options).attrs["units"] = b"count"
    refused(path, read_capture, "buckets/counts has unsupported filters; allowed: none, or gzip")


# Integrity


def test_a_flipped_bit_anywhere_is_refused(path):
    content = path.read_bytes()
    rng = np.random.default_rng(0)
    positions = [*range(80), 110, 511, *rng.integers(0, len(content), 200)]
    for position in positions:
        copy = bytearray(content)
        copy[position] ^= 1 << rng.integers(8)
        path.write_bytes(copy)
        with pytest.raises(InputError, match=r"capture\.h5: .*(damaged|digest)"):
            read_capture(path)


def test_a_flipped_bit_in_a_dataset_is_found_without_the_digest(tmp_path):
    """By the library, so by whatever reads these files."""
    capture = full_capture()
    counts = np.arange(1000 * 20, dtype=np.int32).reshape(1000, 20)
    long = attacks.long_capture(capture, counts)
    write_capture(long, tmp_path / "long.h5")
    content = (tmp_path / "long.h5").read_bytes()
    with h5py.File(tmp_path / "long.h5") as file:
        stored = file["buckets/counts"]
        assert (stored.fletcher32, stored.compression) == (True, None)
        assert all(
            dataset.fletcher32 or dataset.id.get_create_plist().get_layout() == h5py.h5d.COMPACT
            for dataset in attacks.datasets(file)
        )
    for value in (counts[3, 3], counts[997, 5]):
        copy = bytearray(content)
        copy[content.index(counts[value // 20].tobytes())] ^= 1
        (tmp_path / "long.h5").write_bytes(sealed(bytes(copy)))
        with pytest.raises(InputError, match="damaged"):
            read_capture(tmp_path / "long.h5")


def test_the_head_is_what_the_page_says(path):
    lines = path.read_bytes()[:512].split(b"\n")
    assert lines[0] == b"sha256 " + hashlib.sha256(path.read_bytes()[72:]).hexdigest().encode()
    assert lines[1:] == [b"made by spisim: simulated capture", bytes(512 - 72 - 34)]
    assert is_marked(path, "simulated capture")
    if shutil.which("sha256sum"):
        command = f"tail -c +73 '{path}' | sha256sum"
        reported = subprocess.run(command, shell=True, capture_output=True, text=True, check=True)
        assert reported.stdout.split()[0].encode() == lines[0][7:]


def test_a_recorder_can_make_the_digest(path, monkeypatch):
    """As the page shows it in Python."""
    docs = Path(__file__).parents[2] / "docs"
    page = (docs / "reference" / "capture-format.md").read_text(encoding="utf-8")
    (recipe,) = re.findall(r"```python\n(.*?)```", page, re.DOTALL)
    path.write_bytes(bytes(512) + path.read_bytes()[512:])
    monkeypatch.chdir(path.parent)
    exec(recipe)
    assert path.read_bytes()[72:82] == b"my rig 1.0"
    assert read_capture(path).frames == 2
    assert not is_marked(path, "simulated capture")


def test_a_file_of_this_version_without_its_digest_is_refused(path):
    path.write_bytes(bytes(512) + path.read_bytes()[512:])
    with pytest.raises(InputError, match=r"version 4\.1, but without its digest"):
        read_capture(path)


def test_files_of_version_3_0_have_none():
    old, new = read_capture(DATA / "capture-3.0.h5"), full_capture()
    assert [f.digest(old.setup) for f in (old.frame(0), old.frame(1))] == [
        f.digest(new.setup) for f in (new.frame(0), new.frame(1))
    ]
    np.testing.assert_array_equal(old.truth.image, new.truth.image)


def test_a_pipe_is_no_capture(tmp_path):
    os.mkfifo(tmp_path / "pipe.h5")
    with pytest.raises(InputError, match="is not a regular file"):
        read_capture(tmp_path / "pipe.h5")


def test_data_that_a_file_does_not_hold_are_stated_in_mebibytes(tmp_path):
    with h5py.File(tmp_path / "a.h5", "w") as file:
        left_to_a_fill_value = file.create_dataset("counts", 2**28, "f8")
        with pytest.raises(InputError, match="unpacks to 2048 MiB at counts; at most"):
            check_sizes({"counts": left_to_a_fill_value}, 10_000)
