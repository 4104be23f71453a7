"""Arrays and pictures of strangers: small files that unpack to gigabytes, headers that lie."""

import re
import struct
import zipfile
import zlib

import matplotlib.image  # noqa: F401 (reads files of its own when it is imported)
import numpy as np
import pytest
import scipy.io

import attacks
from hostile import survive
from reconstruction.base.errors import InputError
from reconstruction.capture.importers import load_array
from spisim.base.config.files import read_columns, read_density, read_picture

GB = 2**30


def refused(path, read, message):
    """Refused in a process of its own, whose memory, time and files are watched."""

    def attempt(_):
        with pytest.raises(InputError, match=message):
            read(path)

    survive(attempt, [0], readable=[path.parent])


def png(width, height, body=b""):
    """A picture of this size in its header, with this as its compressed lines."""

    def chunk(kind, data):
        sum_ = struct.pack(">I", zlib.crc32(kind + data))
        return struct.pack(">I", len(data)) + kind + data + sum_

    head = struct.pack(">IIBBBBB", width, height, 8, 0, 0, 0, 0)
    signature = b"\x89PNG\r\n\x1a\n"
    return signature + chunk(b"IHDR", head) + chunk(b"IDAT", body) + chunk(b"IEND", b"")


BOMBS = {
    "a.mat": (lambda: attacks.mat_bomb(GB * 3 // 2), "unpacks to .* save the variable alone"),
    "a.npz": (
        lambda: attacks.npz_bomb(GB * 3 // 2),
        "unpacks to 1536 MiB, at most 256: .*uncompressed",
    ),
    "b.npz": (lambda: attacks.npz_bomb(2**20, zipfile.ZIP_LZMA), "compressed in a way"),
    "a.npy": (lambda: attacks.npy_header((2**28, 20)), "states 42949672960 bytes of at most"),
    "b.npy": (lambda: attacks.npy_header((2**62, 2**62)), "states [0-9]+ bytes of at most"),
    "c.npy": (lambda: attacks.npy_header((-1, -8)), r"states the shape \(-1, -8\)"),
    "d.npy": (lambda: attacks.npy_header((2,), "|O") + b"\x80\x04.", "real numbers, got object"),
    "e.npy": (lambda: attacks.npy_header((1,), "<U500000000"), "real numbers, got <U500000000"),
}


@pytest.mark.parametrize("name", BOMBS)
def test_small_files_that_unpack_to_much_are_refused(tmp_path, name):
    content, message = BOMBS[name]
    path = tmp_path / name
    path.write_bytes(content())
    assert path.stat().st_size < 3e6
    refused(path, load_array, f"{re.escape(name)}: .*{message}")
    if path.suffix == ".npy":
        for read in (read_density, read_picture, read_columns):
            refused(path, read, f"'{re.escape(name)}' cannot be read: .*{message}")


@pytest.mark.parametrize(
    "content",
    [png(60_000, 60_000, attacks.zeros(GB)), png(4096, 4096), b"\x89PNG", png(2**31, 2**31)],
    ids=["bomb", "lie", "short", "overflow"],
)
def test_pictures_have_so_many_pixels(tmp_path, content):
    (tmp_path / "a.png").write_bytes(content)
    refused(tmp_path / "a.png", read_picture, r"'a\.png' (has .* at most 16777216|cannot be read)")


def test_long_texts_are_refused_and_another_format_named(tmp_path):
    with (tmp_path / "a.csv").open("wb") as file:
        file.truncate(2**28 + 1)
    refused(tmp_path / "a.csv", load_array, r"has 256 MiB; at most 256 .* save it as \.npy")
    refused(tmp_path / "a.csv", read_columns, "has 256 MiB, at most 64 .* save it as an NPY")


def test_long_lines_are_read(tmp_path):
    """No line is too long for a table that is not."""
    (tmp_path / "a.csv").write_text(",".join(["1"] * 100_000))
    assert load_array(tmp_path / "a.csv").shape == (100_000,)
    assert read_columns(tmp_path / "a.csv").shape == (1, 100_000)


@pytest.mark.parametrize("compressed", [True, False])
def test_what_matlab_packs_is_read(tmp_path, compressed):
    values = {
        "data": np.arange(12.0).reshape(3, 4),
        "flag": np.ones((2, 2), bool),
        "small": np.arange(5, dtype=np.uint8),
        "cell": np.array([1, "a"], dtype=object),
    }
    scipy.io.savemat(tmp_path / "a.mat", values, do_compression=compressed)
    for name in ("data", "flag", "small"):
        result = load_array(tmp_path / "a.mat", name)
        np.testing.assert_array_equal(result, np.atleast_2d(values[name]))
    with pytest.raises(InputError, match=r"a\.mat: cell is of class cell, must hold numbers"):
        load_array(tmp_path / "a.mat", "cell")
    scipy.io.savemat(tmp_path / "old.mat", {"data": values["data"]}, format="4")
    np.testing.assert_array_equal(load_array(tmp_path / "old.mat"), values["data"])


def test_one_variable_of_many_in_one_large_file_is_read(tmp_path):
    """Only what is wanted counts, where it can be read alone."""
    np.savez_compressed(tmp_path / "a.npz", large=np.zeros(2**26, np.uint8), small=np.arange(3))
    np.testing.assert_array_equal(load_array(tmp_path / "a.npz", "small"), np.arange(3))
    refused(tmp_path / "a.npz", lambda path: load_array(path, "large"), "unpacks to 512 MiB")
