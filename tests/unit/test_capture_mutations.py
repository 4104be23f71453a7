"""Thousands of changed captures, results and arrays: read or refused, and nothing else happens."""

import io
from dataclasses import fields, is_dataclass, replace

import h5py
import numpy as np
import pytest
import scipy.io

import attacks
from captures import full_capture
from hdf5mutations import mutated
from hostile import survive
from reconstruction import read_capture, read_result, write_capture
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import load_array
from reconstruction.outputs.result_file import result_bytes
from reconstruction.reconstructor import reconstruct

FAST = {"captures": 500, "results": 150, "mat 7.3": 150, "mat 5": 500, "npz": 500}
MANY = 100_000


def small_capture():
    """What every capture has, and no more: quickly read."""
    return replace(full_capture(), spots=None, pattern_taps=None, optics=None, truth=None)


@pytest.fixture(scope="module")
def bases(tmp_path_factory):
    """Contents of sound files."""
    folder = tmp_path_factory.mktemp("bases")
    with h5py.File(folder / "rig.mat", "w", userblock_size=512) as file:
        file["data"] = np.arange(40.0).reshape(2, 20)
        file["#refs#/a"] = np.arange(3)
    values = {"data": np.arange(40.0).reshape(2, 20), "other": np.ones(3, np.uint8)}
    scipy.io.savemat(folder / "older.mat", values, do_compression=True)
    packed = io.BytesIO()
    np.savez_compressed(packed, **values)
    small, full = (written(capture, folder) for capture in (small_capture(), full_capture()))
    foreign = attacks.foreign_copy(small)
    return {
        "captures": [small, foreign, foreign, full],
        "results": [result_bytes(reconstruct(full_capture()))],
        "mat 7.3": [(folder / "rig.mat").read_bytes()],
        "mat 5": [(folder / "older.mat").read_bytes()],
        "npz": [packed.getvalue()],
    }


def written(capture, folder):
    """Content of the file of a capture."""
    write_capture(capture, folder / "capture.h5")
    return (folder / "capture.h5").read_bytes()


READERS = {
    "captures": ("a.h5", read_capture),
    "results": ("a.h5", read_result),
    "mat 7.3": ("a.mat", load_array),
    "mat 5": ("a.mat", lambda path: load_array(path, "data")),
    "npz": ("a.npz", lambda path: load_array(path, "data")),
}


def attempts(bases, kind, folder):
    """Read the file of a seed; AssertionError where it tells of the secret."""
    secret = attacks.write_secret(folder / "outside")
    (folder / "own").mkdir()
    name, read = READERS[kind]
    path = folder / "own" / name
    change = plainly_mutated if kind in ("mat 5", "npz") else mutated

    def attempt(seed):
        rng = np.random.default_rng(seed)
        base = bases[kind][seed % len(bases[kind])]
        path.write_bytes(change(base, rng, secret))
        text = ""
        try:
            result = contents(read(path))
        except InputError as error:
            result, text = b"", str(error)
        assert attacks.SECRET not in result + text.encode()
        assert not text or text.startswith(str(path))

    return attempt


def plainly_mutated(base, rng, _):
    """A copy with other bytes in some places, or fewer."""
    copy = bytearray(base)
    for position in rng.integers(0, len(copy), rng.integers(1, 9)):
        copy[position] = rng.choice([0, 1, 0x7F, 0x80, 0xFF, *rng.bytes(5)])
    return bytes(copy[: rng.integers(len(copy))] if rng.random() < 0.2 else copy)


def contents(value):
    """All that was read, as bytes."""
    if is_dataclass(value):
        value = [getattr(value, field.name) for field in fields(value)]
    if isinstance(value, dict):
        value = list(value.values())
    if isinstance(value, list | tuple):
        return b"".join(contents(each) for each in value)
    if isinstance(value, np.ndarray):
        as_bytes = value.astype(np.uint8).tobytes() if value.dtype.kind in "iuf" else b""
        return value.tobytes() + as_bytes
    return str(value).encode()


@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", READERS)
def test_changed_files_are_read_or_refused(bases, kind, place):
    seeds = range(FAST[kind])
    survive(attempts(bases, kind, place), seeds, readable=[place], writable=[place])


@pytest.mark.hours
@pytest.mark.filterwarnings("ignore::RuntimeWarning")
@pytest.mark.parametrize("kind", READERS)
def test_many_changed_files_are_read_or_refused(bases, kind, place):
    seeds = range(FAST[kind], MANY)
    survive(attempts(bases, kind, place), seeds, readable=[place], writable=[place])
