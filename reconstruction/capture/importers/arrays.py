"""Arrays of bucket readings, with a named pattern plan or the patterns themselves -> capture."""

import warnings
from collections.abc import Callable, Iterable, Mapping
from datetime import UTC, datetime
from pathlib import Path
from typing import Any

import h5py
import numpy as np
import scipy.io
from numpy.typing import ArrayLike, NDArray

from ...arrays import Floats
from ...errors import InputError, naming, nearest
from ...operators import Basis, PatternPlan, checked_shape, fwht
from ...operators.bases.dense import Dense
from ...operators.bases.hadamard import Hadamard
from ...operators.hadamard import power_of_two
from ..buckets import Buckets
from ..model import Capture, Provenance


def load_array(path: str | Path, variable: str | None = None) -> NDArray[Any]:
    """Numeric array from .npy, .csv, .npz or .mat (v5 and v7.3).

    ``variable`` names the one wanted of a .npz or .mat; not needed if there is just one. Raises
    InputError if the file is missing, unreadable or without numbers, if there is no such variable,
    or if one of its numbers is not finite.
    """
    path = Path(path)
    reader = _READERS.get(path.suffix.lower())
    if reader is None:
        raise InputError(f"{path}: unknown file type; allowed: {', '.join(_READERS)}")
    if not path.is_file():
        raise InputError(f"{path}: no such file")
    with naming(path):
        try:
            array = reader(path, variable)
        except InputError:
            raise
        except Exception as error:  # each format has errors of its own
            raise InputError(f"not a readable {path.suffix} file ({error})") from error
        _check_numbers(array)
    return array


def _check_numbers(array: NDArray[Any]) -> None:
    if array.dtype.kind not in "iufb":
        raise InputError(f"holds {array.dtype}, not numbers")
    if array.size == 0:
        raise InputError("holds no numbers")
    bad = np.argwhere(~np.isfinite(array))
    if bad.size:
        place = tuple(bad[0].tolist())
        raise InputError(
            f"the value at {list(place)} is {array[place]}, must be finite (positions count from 0)"
        )


def plan_from_matrix(
    patterns: ArrayLike, shape: tuple[int, int]
) -> tuple[PatternPlan, NDArray[np.int8]]:
    """Plan from a matrix (M, N) of displayed patterns, pixels row-major, and each reading's sign.

    Values are 0..1 for displayed light, or -1..1 for signed values. Where every row is a Hadamard
    row the plan is one of these; then a signed row -h gives the sign -1, with which its reading
    must be multiplied. Any others are a dense basis, and all signs +1. Raises InputError for
    another shape, and naming the first value that is something else.
    """
    matrix = np.asarray(patterns, dtype=np.float64)
    height, width = shape = checked_shape(shape)
    if matrix.ndim != 2 or not len(matrix) or matrix.shape[1] != height * width:
        raise InputError(
            f"the pattern matrix has shape {matrix.shape}, expected (M, {height * width}) for "
            f"{height} x {width} pixels"
        )
    bad = np.argwhere(~(np.abs(matrix) <= 1))
    if bad.size:
        row, column = bad[0]
        raise InputError(
            f"row {row} of the pattern matrix holds {matrix[row, column]:g}; allowed: 0..1 for "
            "displayed light, -1..1 for signed values"
        )
    displayed = bool(matrix.min() >= 0)
    known = _hadamard_rows(2 * matrix - 1 if displayed else matrix, shape)
    if known is None:
        transmittance = matrix if displayed else (1 + matrix) / 2
        basis: Basis = Dense(transmittance.reshape(-1, height, width))
        index, sign = np.arange(len(matrix), dtype=np.int32), np.ones(len(matrix), np.int8)
    else:
        basis = Hadamard(shape)
        index, sign = known
    polarity = sign if displayed else np.zeros_like(sign)
    plan = PatternPlan(shape, index, polarity, patterns=basis)
    return plan, np.ones_like(sign) if displayed else sign


def _hadamard_rows(
    signed: Floats, shape: tuple[int, int]
) -> tuple[NDArray[np.int32], NDArray[np.int8]] | None:
    """Number and sign of each row h or -h, None where one of them is something else."""
    if not all(power_of_two(side) for side in shape) or (np.abs(signed) != 1).any():
        return None
    spectrum = fwht(signed)
    index = np.abs(spectrum).argmax(axis=1)
    peak = spectrum[np.arange(len(index)), index]
    if (np.abs(peak) != signed.shape[1]).any():
        return None
    return index.astype(np.int32), np.sign(peak).astype(np.int8)


def capture_from_readings(
    readings: ArrayLike, plan: PatternPlan, untrusted: Iterable[int] = ()
) -> Capture:
    """Capture (source hardware, no time of flight) from readings (M,) or (frames, M).

    ``untrusted`` are positions of readings that must not be used, marked as saturated. What a count
    stands for, noise and times are marked as unknown. Raises InputError if the number of readings
    is not the plan's.
    """
    counts = np.asarray(readings)
    if counts.dtype.kind == "b":
        raise InputError("the readings are true/false values, not numbers")
    if counts.size == plan.exposures:
        counts = counts.reshape(1, -1)
    if counts.ndim != 2 or counts.shape[1] != plan.exposures:
        raise InputError(
            f"the readings have shape {counts.shape}; the pattern plan expects {plan.exposures} "
            "per frame"
        )
    saturated = np.zeros(counts.shape, dtype=bool)
    for position in untrusted:
        if not 0 <= position < plan.exposures:
            raise InputError(f"untrusted reading {position} is outside 0..{plan.exposures - 1}")
        saturated[:, position] = True
    return Capture(
        plan=plan,
        buckets=Buckets(
            counts=counts.astype(np.int64 if counts.dtype.kind in "iu" else np.float64),
            saturated=saturated,
            exposure_time_s=np.nan,
            pattern_period_s=np.nan,
            electrons_per_count=np.nan,
            offset_counts=0.0,
            noise_electrons=np.nan,
            excess_noise_factor=1.0,
            dead_time_s=0.0,
        ),
        spots=None,
        optics=None,
        provenance=Provenance(
            source="hardware",
            software="reconstruction import",
            created=datetime.now(UTC).isoformat(timespec="seconds"),
            instrument="",
        ),
    )


def _read_npy(path: Path, _variable: str | None) -> NDArray[Any]:
    return np.asarray(np.load(path, allow_pickle=False))


def _read_csv(path: Path, _variable: str | None) -> NDArray[Any]:
    with warnings.catch_warnings():
        warnings.simplefilter("ignore")  # an empty file is told by whoever called
        return np.loadtxt(path, delimiter=",")


def _read_npz(path: Path, variable: str | None) -> NDArray[Any]:
    with np.load(path, allow_pickle=False) as file:
        return np.asarray(_pick(file, variable))


def _read_mat(path: Path, variable: str | None) -> NDArray[Any]:
    if h5py.is_hdf5(path):  # v7.3; MATLAB's columns come first
        with h5py.File(path, "r") as file:
            datasets = {key: item for key, item in file.items() if isinstance(item, h5py.Dataset)}
            return np.asarray(_pick(datasets, variable)).T
    content = scipy.io.loadmat(path)
    return np.asarray(
        _pick({key: item for key, item in content.items() if not key.startswith("__")}, variable)
    )


def _pick(variables: Mapping[str, Any], name: str | None) -> Any:
    names = list(variables)
    if name is None:
        if len(names) != 1:
            raise InputError(f"name one of its variables: {', '.join(names)}")
        return variables[names[0]]
    if name not in variables:
        raise InputError(f"has no variable {name!r}: {nearest(name, names)}")
    return variables[name]


_READERS: dict[str, Callable[[Path, str | None], NDArray[Any]]] = {
    ".mat": _read_mat,
    ".npy": _read_npy,
    ".npz": _read_npz,
    ".csv": _read_csv,
}
