"""Files made to read or fill what is not theirs: HDF5's ways out of a file, and bombs."""

import io
import re
import struct
import zipfile
import zlib
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import h5py
import numpy as np

from reconstruction import Capture

SECRET = b"user:x:31415926:The Secret of the House"
Attack = Callable[[h5py.File, str, Path], None]


def write_secret(folder: Path) -> Path:
    """A file outside, as bytes and as HDF5, that nothing may read."""
    folder.mkdir(parents=True, exist_ok=True)
    secret = folder / "secret"
    secret.write_bytes(SECRET * 100)
    with h5py.File(folder / "secret.h5", "w") as file:
        file["text"] = np.frombuffer(SECRET * 100, np.uint8)
        file["text"].attrs["units"] = np.bytes_(SECRET)
    return secret


def external_link(file: h5py.File, name: str, secret: Path) -> None:
    del file[name]
    file[name] = h5py.ExternalLink(str(secret.with_suffix(".h5")), "/text")


def soft_link(file: h5py.File, name: str, secret: Path) -> None:
    group = file.require_group("elsewhere")
    group["out"] = h5py.ExternalLink(str(secret.with_suffix(".h5")), "/")
    del file[name]
    file[name] = h5py.SoftLink("/elsewhere/out/text")


def group_elsewhere(file: h5py.File, name: str, secret: Path) -> None:
    del file[name.split("/")[0]]
    file[name.split("/")[0]] = h5py.ExternalLink(str(secret.with_suffix(".h5")), "/")


def external_storage(file: h5py.File, name: str, secret: Path) -> None:
    shape, dtype, units = described(file, name)
    if dtype.kind == "S":
        shape, dtype = (1,), np.dtype(f"S{len(SECRET)}")
    size = int(np.prod(shape)) * dtype.itemsize
    dataset = file.create_dataset(name, shape, dtype, external=[(str(secret), 0, size)])
    dataset.attrs["units"] = units


def virtual_dataset(file: h5py.File, name: str, secret: Path) -> None:
    _, dtype, units = described(file, name)
    layout = h5py.VirtualLayout(shape=(len(SECRET) * 100,), dtype=dtype)
    layout[:] = h5py.VirtualSource(str(secret.with_suffix(".h5")), "text", shape=layout.shape)
    file.create_virtual_dataset(name, layout).attrs["units"] = units


def fill_value(file: h5py.File, name: str, secret: Path) -> None:
    """Three GB that nobody has written."""
    _, _, units = described(file, name)
    dataset = file.create_dataset(name, (2, 200_000_000), "f8", fillvalue=1.0)
    dataset.attrs["units"] = units


def many_chunks(file: h5py.File, name: str, secret: Path) -> None:
    """No byte of them is there, yet each takes memory of the library."""
    shape, _, units = described(file, name)
    dataset = file.create_dataset(name, (10**6, *shape[1:]), "u1", chunks=(1,) * len(shape))
    dataset.attrs["units"] = units


def large_chunk(file: h5py.File, name: str, secret: Path) -> None:
    """A small dataset in a chunk of 2 GB."""
    shape, _, units = described(file, name)
    dataset = file.create_dataset(
        name,
        shape,
        "u1",
        maxshape=(None,) * len(shape),
        chunks=(2**31 // int(np.prod(shape[1:])), *shape[1:]),
        compression="gzip",
    )
    dataset.attrs["units"] = units
    dataset.id.write_direct_chunk((0,) * len(shape), zeros(2**31))


def gzip_bomb(file: h5py.File, name: str, secret: Path) -> None:
    """A chunk that inflates to 2 GB instead of its few bytes."""
    shape, dtype, units = described(file, name)
    dataset = file.create_dataset(name, shape, dtype, chunks=shape, compression="gzip")
    dataset.attrs["units"] = units
    dataset.id.write_direct_chunk((0,) * len(shape), zeros(2**31))


def giant_string(file: h5py.File, name: str, secret: Path) -> None:
    _, _, units = described(file, name)
    file.create_dataset(name, (), "S2147483647").attrs["units"] = units


def second_name(file: h5py.File, name: str, secret: Path) -> None:
    file[f"{name}_again"] = file[name]


def circle(file: h5py.File, name: str, secret: Path) -> None:
    group = file[name.split("/")[0]]
    group["round"] = file


def named_type(file: h5py.File, name: str, secret: Path) -> None:
    file["a_type"] = np.dtype("f8")


def reference(file: h5py.File, name: str, secret: Path) -> None:
    _, _, units = described(file, name)
    file[name] = np.array([file.ref] * 20, dtype=h5py.ref_dtype)
    file[name].attrs["units"] = units


LEAVING: list[Attack] = [
    external_link, soft_link, group_elsewhere, external_storage, virtual_dataset,
]  # fmt: skip
BOMBS: list[Attack] = [fill_value, many_chunks, large_chunk, gzip_bomb, giant_string]


def described(file: h5py.File, name: str) -> tuple[tuple[int, ...], np.dtype, bytes]:
    """Shape, type and unit of a dataset, which is gone then."""
    dataset = file[name]
    result = dataset.shape, dataset.dtype, dataset.attrs["units"]
    del file[name]
    return result


def zeros(size: int, head: bytes = b"") -> bytes:
    """So many zeros behind a head, as zlib would compress them, but at once.

    Blocks between full flushes do not know of each other: one of them stands there many times.
    """
    block = 2**20
    packer = zlib.compressobj(9, wbits=-15)
    begin = packer.compress(head) + packer.flush(zlib.Z_FULL_FLUSH)
    middle = packer.compress(bytes(block)) + packer.flush(zlib.Z_FULL_FLUSH)
    end = packer.compress(bytes(size % block)) + packer.flush()
    checksum = zlib.adler32(head)
    low, high = checksum & 0xFFFF, checksum >> 16
    tail = struct.pack(">HH", (high + size * low) % 65521, low)
    return b"\x78\xda" + begin + size // block * middle + end + tail


def mat_bomb(size: int) -> bytes:
    """A MATLAB file (v5) with an array of doubles, all zero, that takes so many bytes."""
    body = struct.pack("<IIII", 6, 8, 6, 0)
    body += struct.pack("<IIII", 5, 8, 1, size // 8)
    body += struct.pack("<HH4s", 1, 4, b"data")
    body += struct.pack("<II", 9, size)
    packed = zeros(size, struct.pack("<II", 14, len(body) + size) + body)
    head = b"MATLAB 5.0 MAT-file".ljust(124) + struct.pack("<H2s", 0x0100, b"IM")
    return head + struct.pack("<II", 15, len(packed)) + packed


def npy_header(shape: tuple[int, ...], dtype: str = "<f8") -> bytes:
    """The head of an NPY file, and no number."""
    buffer = io.BytesIO()
    np.lib.format.write_array_header_1_0(
        buffer, {"descr": dtype, "fortran_order": False, "shape": shape}
    )
    return buffer.getvalue()


def npz_bomb(size: int, method: int = zipfile.ZIP_DEFLATED) -> bytes:
    """An NPZ file with an array of zeros that takes so many bytes, and a checksum that is none."""
    head = npy_header((size // 8,))
    packed = zeros(size, head)[2:-4]
    name = b"data.npy"
    of_both = struct.pack("<HHHHH", 20, 0, method, 0, 0)
    of_both += struct.pack("<IIIHH", 0, len(packed), size + len(head), len(name), 0)
    local = b"PK\3\4" + of_both + name + packed
    central = b"PK\1\2" + struct.pack("<H", 20) + of_both + bytes(14) + name
    end = struct.pack("<HHHHIIH", 0, 0, 1, 1, len(central), len(local), 0)
    return local + central + b"PK\5\6" + end


def datasets(file: h5py.File) -> list[h5py.Dataset]:
    """All datasets of a file."""
    result = []
    file.visititems(lambda _, item: result.append(item) if isinstance(item, h5py.Dataset) else None)
    return result


def long_capture(capture: Capture, counts: np.ndarray) -> Capture:
    """A capture of more frames, with these readings alone."""
    buckets = replace(capture.buckets, counts=counts, saturated=np.zeros(counts.shape, bool))
    return replace(capture, buckets=buckets, spots=None, pattern_taps=None, poses=None, truth=None)


def long_string(content: bytes, length: int) -> bytes:
    """A file in which the string of variable length that has so many bytes says it has 4 GiB."""
    begins = [result.start() for result in re.finditer(b"GCOL", content)]
    reported = [struct.pack("<IQ", length, begin) for begin in begins]
    (position,) = (content.index(each) for each in reported if each in content)
    return content[:position] + struct.pack("<I", 2**32 - 256) + content[position + 4 :]


def foreign_copy(content: bytes) -> bytes:
    """A capture as other recorders write it: old HDF5, packed, strings of any length, no digest."""
    buffer = io.BytesIO()
    with h5py.File(io.BytesIO(content)) as own, h5py.File(buffer, "w") as file:
        file.attrs.update({name: value.decode() for name, value in own.attrs.items()})
        file.attrs["version"] = "3.0"
        for dataset in datasets(own):
            value = dataset[()]
            value = value.decode() if isinstance(value, bytes) else value
            packed = {"chunks": True, "compression": "gzip"} if np.ndim(value) > 1 else {}
            copy = file.create_dataset(dataset.name, data=value, **packed)
            copy.attrs["units"] = dataset.attrs["units"].decode()
    return buffer.getvalue()
