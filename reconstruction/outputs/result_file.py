"""The result file, result.h5."""

from collections.abc import Iterable, Sequence
from pathlib import Path
from typing import Any, get_args

import h5py
import numpy as np
from numpy.typing import NDArray

from ..base.errors import InputError
from ..capture import Unit, hdf5
from ..capture.spots import MAX_SPOTS
from ..depth import DISTANCES_M
from ..ranging import Alternative, Ranges, Status, Visibility
from ..result import Result

FORMAT = hdf5.Format(
    name="spisim-result",
    kind="result",
    oldest=(3, 0),
    version=(3, 10),
    remedy="reconstruct the capture again",
)
RANGES = {
    "range_m": "m",
    "sigma_m": "m",
    "signal_electrons": "electron",
    "background_electrons": "electron",
}
ALTERNATIVES = {"range_m": "m", "sigma_m": "m", "weight": "1"}
"""A row per spot, likeliest first, padded with nan; missing if no spot has any."""
VISIBILITY = {"visibility_m": "m", "log_sigma": "1", "at_least_m": "m"}
"""Missing if unknown."""
GROUPS = ("images", "rangings", "depths")


def result_bytes(result: Result) -> bytes:
    """Bytes of a result.h5."""
    return hdf5.content(lambda file: _write(file, result), FORMAT.kind)


def read_result(path: str | Path) -> Result:
    """Read a result.h5; raises InputError if it is missing, damaged or not a result."""
    if not Path(path).is_file():
        raise InputError(f"{path}: no such result; run spisim reconstruct CAPTURE -o DIR")
    with hdf5.opened(path, FORMAT) as file:
        names = {group: _names(file, group) for group in GROUPS}
        if not names["images"]:
            raise InputError("the result holds no image")
        first = f"images/{names['images'][0]}"
        unit: Unit = "count" if file.units(first) == "count" else "electron"
        shape = file.shape(first, unit)
        has_rays = "range_over_depth" in file
        timings = file.names_in("timings_s")
        return Result(
            images={name: _map(file, f"images/{name}", unit, shape) for name in names["images"]},
            sigmas=_maps(file, "deviations", names["images"], unit, shape),
            rangings={name: _ranges(file, f"rangings/{name}") for name in names["rangings"]},
            depths={name: _map(file, f"depths/{name}", "m", shape) for name in names["depths"]},
            range_over_depth=_map(file, "range_over_depth", "1", shape) if has_rays else None,
            timings_s={n: file.number(f"timings_s/{n}", "s") for n in timings},
            unit=unit,
            recording=file.text("recording"),
            frame=file.integer("frame"),
            patterns=file.integer("patterns"),
            log_depth_sigmas=_maps(file, "depth_deviations", names["depths"], "1", shape),
            no_returns=_maps(file, "nothings", names["depths"], "1", shape),
            **_corridor(file, names["depths"]),
            spot_directions=_directions(file),
            points_m=_points(file, names["depths"]),
            notes={stage: file.text(f"notes/{stage}") for stage in file.names_in("notes")},
        )


def _names(file: hdf5.Contents, group: str) -> list[str]:
    """Methods of a group, the default one first."""
    text = file.attribute(group)
    names = text.split("\n") if text else []
    missing = [name for name in names if f"{group}/{name}" not in file]
    if missing:
        raise InputError(f"{group}/{missing[0]} is missing")
    if len(set(names)) < len(names):
        raise InputError(f"attribute {group!r} names a method twice")
    return names


def _maps(
    file: hdf5.Contents, group: str, methods: Iterable[str], units: str, shape: tuple[int, ...]
) -> dict[str, NDArray[Any]]:
    """Maps of the methods that have one."""
    names = {method: f"{group}/{method}" for method in methods}
    return {
        method: _map(file, name, units, shape) for method, name in names.items() if name in file
    }


def _map(file: hdf5.Contents, name: str, units: str, shape: tuple[int, ...]) -> NDArray[Any]:
    found = file.shape(name, units)
    if len(found) != 2 or found != shape:
        raise InputError(f"dataset {name} has shape {found}, the image {shape}")
    return file.numbers(name, units)


def _corridor(file: hdf5.Contents, mapped: Sequence[str]) -> dict[str, Any]:
    """Probabilities of a free corridor, of methods with a map first; none at other distances."""
    if "free_distance_m" not in file:
        return {}
    distances_m = file.numbers("free_distance_m", "m")
    if distances_m.shape != DISTANCES_M.shape or not np.allclose(distances_m, DISTANCES_M):
        return {}
    stated = file.names_in("free_probabilities")
    methods = [
        *(name for name in mapped if name in stated),
        *(name for name in stated if name not in mapped),
    ]
    names = {method: f"free_probabilities/{method}" for method in methods}
    free = {method: file.numbers(name, "1") for method, name in names.items()}
    for method, values in free.items():
        if values.shape != DISTANCES_M.shape:
            raise InputError(
                f"dataset {names[method]} has shape {values.shape}, expected {DISTANCES_M.shape}"
            )
    return {"min_free": file.number("min_free", "1"), "free_probabilities": free}


def _ranges(file: hdf5.Contents, group: str) -> Ranges:
    spots = file.shape(f"{group}/status", "1")
    if len(spots) != 1 or not 1 <= spots[0] <= MAX_SPOTS:
        raise InputError(
            f"dataset {group}/status has shape {spots}, expected (spots,), 1 to {MAX_SPOTS} of them"
        )
    for name, units in RANGES.items():
        shape = file.shape(f"{group}/{name}", units)
        if shape != spots:
            raise InputError(f"dataset {group}/{name} has shape {shape}, expected {spots}")
    values = {name: file.numbers(f"{group}/{name}", units) for name, units in RANGES.items()}
    status = tuple(file.texts(f"{group}/status"))
    unknown = set(status) - set(get_args(Status))
    if unknown:
        raise InputError(f"dataset {group}/status holds {', '.join(map(repr, unknown))}")
    alternatives = _alternatives(file, f"{group}/alternatives", len(status))
    visibility = _visibility(file, f"{group}/visibility")
    return Ranges(
        **values,  # type: ignore[arg-type]
        status=status,  # type: ignore[arg-type]
        alternatives=alternatives,
        visibility=visibility,
        nothing=_nothing(file, f"{group}/nothing", spots),
    )


def _nothing(file: hdf5.Contents, name: str, spots: tuple[int, ...]) -> NDArray[Any]:
    """Probability (spots,) of no target; files up to version 3.9 have none."""
    if name not in file:
        return np.full(spots, np.nan)
    if (shape := file.shape(name, "1")) != spots:
        raise InputError(f"dataset {name} has shape {shape}, expected {spots}")
    return file.numbers(name, "1")


def _visibility(file: hdf5.Contents, group: str) -> Visibility | None:
    """Visibility of a method; files up to version 3.8 have none."""
    if group not in file:
        return None
    values = (file.number(f"{group}/{name}", units) for name, units in VISIBILITY.items())
    return Visibility(*values)


def _directions(file: hdf5.Contents) -> NDArray[Any] | None:
    """Directions of the ranges; files up to version 3.6 have none."""
    if "spot_directions" not in file:
        return None
    shape = file.shape("spot_directions", "1")
    if len(shape) != 2 or shape[1] != 3 or not 1 <= shape[0] <= MAX_SPOTS:
        raise InputError(
            f"dataset spot_directions has shape {shape}, expected (spots, 3), 1 to {MAX_SPOTS}"
        )
    return file.numbers("spot_directions", "1")


def _points(file: hdf5.Contents, methods: Iterable[str]) -> dict[str, NDArray[Any]]:
    """Points of the depth methods that have some; files up to version 3.7 have none."""
    names = {method: f"points_m/{method}" for method in methods}
    present = {method: name for method, name in names.items() if name in file}
    for name in present.values():
        shape = file.shape(name, "m")
        if len(shape) != 2 or shape[1] != 3:
            raise InputError(f"dataset {name} has shape {shape}, expected (points, 3)")
    return {method: file.numbers(name, "m") for method, name in present.items()}


def _alternatives(
    file: hdf5.Contents, group: str, spots: int
) -> tuple[tuple[Alternative, ...], ...]:
    if group not in file:
        return ((),) * spots
    shapes = [file.shape(f"{group}/{name}", units) for name, units in ALTERNATIVES.items()]
    for name, shape in zip(ALTERNATIVES, shapes, strict=True):
        if shape != (spots, *shapes[0][1:]) or len(shape) != 2:
            raise InputError(f"dataset {group}/{name} has shape {shape}, expected ({spots}, n)")
    columns = [file.numbers(f"{group}/{name}", units) for name, units in ALTERNATIVES.items()]
    return tuple(
        tuple(Alternative(*each) for each in row if np.isfinite(each).all())
        for row in np.stack(columns, axis=-1).tolist()
    )


def _write(file: h5py.File, result: Result) -> None:
    hdf5.put_format(file, FORMAT)
    for name in ("recording", "frame", "patterns"):
        hdf5.put(file, name, getattr(result, name), "1")
    for group in GROUPS:
        hdf5.put_attribute(file, group, "\n".join(getattr(result, group)))
    maps = {
        "images": (result.images, result.unit),
        "deviations": (result.sigmas, result.unit),
        "depths": (result.depths, "m"),
        "depth_deviations": (result.log_depth_sigmas, "1"),
        "nothings": (result.no_returns, "1"),
        "points_m": (result.points_m, "m"),
    }
    for group, (by_method, units) in maps.items():
        for name, values in by_method.items():
            hdf5.put(file, f"{group}/{name}", values, units)
    for name, ranges in result.rangings.items():
        _write_ranges(file, f"rangings/{name}", ranges)
    if result.range_over_depth is not None:
        hdf5.put(file, "range_over_depth", result.range_over_depth, "1")
    if result.spot_directions is not None:
        hdf5.put(file, "spot_directions", result.spot_directions, "1")
    _write_corridor(file, result)
    for stage, seconds in result.timings_s.items():
        hdf5.put(file, f"timings_s/{stage}", seconds, "s")
    for stage, note in result.notes.items():
        hdf5.put(file, f"notes/{stage}", note, "1")


def _write_corridor(file: h5py.File, result: Result) -> None:
    hdf5.put(file, "min_free", result.min_free, "1")
    hdf5.put(file, "free_distance_m", DISTANCES_M, "m")
    for name, free in result.free_probabilities.items():
        hdf5.put(file, f"free_probabilities/{name}", free, "1")
    for name, distance_m in result.obstacles_m.items():
        hdf5.put(file, f"obstacles_m/{name}", distance_m, "m")


def _write_ranges(file: h5py.File, group: str, ranges: Ranges) -> None:
    for quantity, units in RANGES.items():
        hdf5.put(file, f"{group}/{quantity}", getattr(ranges, quantity), units)
    hdf5.put(file, f"{group}/status", np.array(ranges.status, dtype="S"), "1")
    hdf5.put(file, f"{group}/nothing", ranges.nothing, "1")
    if ranges.visibility is not None:
        for name, units in VISIBILITY.items():
            hdf5.put(file, f"{group}/visibility/{name}", getattr(ranges.visibility, name), units)
    if any(ranges.alternatives):
        _write_alternatives(file, f"{group}/alternatives", ranges)


def _write_alternatives(file: h5py.File, group: str, ranges: Ranges) -> None:
    longest = max(map(len, ranges.alternatives))
    table = np.full((len(ranges.status), longest, len(ALTERNATIVES)), np.nan)
    for spot, alternatives in enumerate(ranges.alternatives):
        for position, each in enumerate(alternatives):
            table[spot, position] = each
    for column, (name, units) in enumerate(ALTERNATIVES.items()):
        hdf5.put(file, f"{group}/{name}", table[..., column], units)
