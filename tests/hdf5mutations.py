"""HDF5 files changed at random: what a stranger could put into one, and what chance could."""

import io
from collections.abc import Callable
from contextlib import suppress
from pathlib import Path

import h5py
import numpy as np

import attacks
from hdf5files import sealed

Change = Callable[[np.random.Generator, h5py.File, str, Path], None]

DTYPES = (
    "i1", "u1", "i2", ">i4", "u4", "i8", "u8", "f2", "f4", ">f8", "f8", "c8", "S1", "S300", "?",
    "i4,f8", "(3,)f4", h5py.ref_dtype, h5py.regionref_dtype, h5py.string_dtype(),
    h5py.vlen_dtype("i4"), h5py.opaque_dtype("M8[s]"), h5py.enum_dtype({"a": 1, "b": 2}),
)  # fmt: skip
NUMBERS = (0, 1, -1, 0.5, 1e-300, 1e300, np.nan, np.inf, -np.inf, 2**31, 2**63 - 1, 2**64 - 1)
SIDES = (0, 1, 2, 3, 4, 8, 20, 1000, 2**20, 2**31, 2**40, 2**62)
MANY = 10_000
TEXTS = (
    "", "\0", "\x1b[2J", "1", "hadamard", "dense", "cw", "pulsed", "dtof", "spisim-capture", "3.1",
    "2.0", "3.0", "-1.9", "1e3.1", "simulation", "electron", "m", "../../../etc/passwd",
    "x" * 70_000, "\N{GREEK SMALL LETTER LAMDA}" * 9, "a\nb", "images", "pursuit\npursuit",
)  # fmt: skip


def mutated(base: bytes, rng: np.random.Generator, secret: Path) -> bytes:
    """A copy with one or two changes, by the library or to the bytes, and a digest that fits."""
    if rng.random() < 0.5:
        return sealed(_bytes_changed(base, rng))
    buffer = io.BytesIO(base)
    with h5py.File(buffer, "r+") as file:
        names: list[str] = []
        file.visit(names.append)
        changes = [CHANGES[rng.integers(len(CHANGES))] for _ in range(rng.integers(0, 3))]
        if rng.random() < 0.4 or not changes:
            changes.append(_attack)  # last: others would read or write outside themselves
        for change in changes:
            # What the library refuses to write nobody need refuse to read.
            with suppress(ArithmeticError, AttributeError, LookupError, OSError, RuntimeError,
                          TypeError, ValueError):  # fmt: skip
                change(rng, file, names[rng.integers(len(names))], secret)
    return sealed(buffer.getvalue())


def _bytes_changed(base: bytes, rng: np.random.Generator) -> bytes:
    copy = bytearray(base)
    kind = rng.integers(4)
    positions = rng.integers(
        72 if copy.startswith(b"sha256 ") else 0, len(copy), rng.integers(1, 9)
    )
    if kind == 0:
        for position in positions:
            copy[position] ^= 1 << rng.integers(8)
    elif kind == 1:
        for position in positions:
            copy[position] = rng.choice([0, 1, 0x7F, 0x80, 0xFF])
    elif kind == 2:
        begin, size = int(positions[0]), int(rng.integers(1, 64))
        copy[begin : begin + size] = rng.bytes(size)[: len(copy) - begin]
    else:
        begin, end = sorted(int(n) for n in rng.integers(0, len(copy), 2))
        copy = copy[:begin] + copy[end:]
    return bytes(copy)


def _value(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    dataset = file[name]
    if dataset.dtype.kind not in "iufcb" or dataset.size > MANY:
        return
    position = tuple(rng.integers(size) for size in dataset.shape)
    dataset[position] = NUMBERS[rng.integers(len(NUMBERS))]


def _text(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    text = TEXTS[rng.integers(len(TEXTS))]
    _replaced(rng, file, name, data=text if rng.random() < 0.5 else np.bytes_(text.encode()))


def _another(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    """Of another shape, type, layout and fill value, and perhaps never written."""
    shape = tuple(SIDES[rng.integers(len(SIDES))] for _ in range(rng.integers(0, 4)))
    if rng.random() < 0.5 and isinstance(file[name], h5py.Dataset):
        shape = file[name].shape
    options: dict[str, object] = {"dtype": DTYPES[rng.integers(len(DTYPES))]}
    if shape and rng.random() < 0.6:
        options["chunks"] = tuple(int(rng.integers(1, 2 + min(n, 2**20))) for n in shape)
        options["compression"] = [None, "gzip", "lzf", None][rng.integers(4)]
        options["shuffle"] = bool(rng.integers(2))
        options["fletcher32"] = bool(rng.integers(2))
        options["maxshape"] = [None, tuple(None for _ in shape)][rng.integers(2)]
    if np.dtype(options["dtype"]).kind in "iuf" and rng.random() < 0.5:
        options["fillvalue"] = 1
    dataset = _replaced(rng, file, name, shape=shape, **options)
    plain = dataset.dtype.kind in "iufcb"  # into others the library writes with crashes
    if plain and 0 < dataset.size < MANY and rng.random() < 0.5:
        dataset[...] = NUMBERS[rng.integers(len(NUMBERS))]


def _chunk(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    """Stored by hand: of any size, and not what its filters would make."""
    if file[name].size > MANY:
        return
    values = file[name][()]
    filters = [{"compression": "gzip"}, {"fletcher32": True}, {}][rng.integers(3)]
    dataset = _replaced(rng, file, name, shape=values.shape, dtype=values.dtype,
                        chunks=values.shape, **filters)  # fmt: skip
    plain = [values.tobytes(), rng.bytes(50), b"", bytes(2**20)][rng.integers(4)]
    packed = attacks.zeros(2**24) if rng.random() < 0.5 else plain
    dataset.id.write_direct_chunk((0,) * values.ndim, packed, int(rng.integers(4)))


def _null(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    _replaced(rng, file, name, data=h5py.Empty("f8"))


def _unit(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    attributes = (file if rng.random() < 0.4 else file[name]).attrs
    name = str(rng.choice([*attributes, "units"]))
    values = (*TEXTS, *NUMBERS, np.zeros(3), np.array([b"m", b"s"]), h5py.Empty("S1"), file.ref)
    if rng.random() < 0.2:
        del attributes[name]
    else:
        attributes[name] = values[rng.integers(len(values))]


def _lost(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    del file[name]


def _moved(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    names: list[str] = []
    file.visit(names.append)
    other = names[rng.integers(len(names))]
    if rng.random() < 0.5:
        del file[other]
    file[other if rng.random() < 0.7 else f"{other}/in"] = file[name]


def _added(rng: np.random.Generator, file: h5py.File, name: str, _: Path) -> None:
    group = file.require_group(["recorder", "a/b/c", "truth", "spots", "optics"][rng.integers(5)])
    group[f"extra{rng.integers(3)}"] = NUMBERS[rng.integers(len(NUMBERS))]


def _attack(rng: np.random.Generator, file: h5py.File, name: str, secret: Path) -> None:
    ways = (*attacks.LEAVING, attacks.fill_value, attacks.many_chunks, attacks.giant_string,
            attacks.second_name, attacks.circle, attacks.named_type, attacks.reference)  # fmt: skip
    ways[rng.integers(len(ways))](file, name, secret)


def _replaced(rng: np.random.Generator, file: h5py.File, name: str, **new: object) -> h5py.Dataset:
    """Another dataset in the place of this one, of the same unit."""
    units = file[name].attrs.get("units")
    del file[name]
    dataset = file.create_dataset(name, **new)
    if units is not None:
        dataset.attrs["units"] = units
    return dataset


CHANGES: tuple[Change, ...] = (
    _value, _value, _text, _another, _another, _chunk, _null, _unit, _lost, _moved, _added,
)  # fmt: skip
