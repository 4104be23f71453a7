"""Result files as shots."""

from collections.abc import Mapping, Sequence
from contextlib import suppress
from pathlib import Path
from typing import Any

import numpy as np

from ..base.errors import InputError, nearest
from ..capture import Optics, hdf5
from ..chosen_methods import Methods
from ..outputs.result_file import FORMAT, read_result
from ..result import Result
from .shot import Shot


def is_result(path: Path) -> bool:
    """Whether a file declares itself a result."""
    if not path.is_file():
        return False
    with suppress(InputError), hdf5.surveyed(path) as (file, datasets):
        return hdf5.Contents(file, datasets).attribute("format") == FORMAT.name
    return False


def shot_of_result(path: Path, stamp_ns: int, methods: Mapping[str, Methods]) -> Shot:
    """Shot of a result file, with the first method named per station, else its default one.

    Ranges are left out, as the file has neither directions of its spots nor a time. Raises
    InputError, naming the file, if it is damaged or lacks a method.
    """
    result = read_result(path)
    image = _picked(result.images, methods.get("image"), "image", path)
    depth_m = _picked(result.depths, methods.get("depth"), "depth", path)
    return Shot(stamp_ns, image, depth_m, _optics(result), warnings=result.warnings)


def _picked(maps: Mapping[str, Any], methods: Methods, station: str, path: Path) -> Any:
    if isinstance(methods, Sequence) and not isinstance(methods, str):
        methods = next(iter(methods), None)
    if methods is None:
        return next(iter(maps.values()), None)
    name = methods if isinstance(methods, str) else methods.name
    if name not in maps:
        raise InputError(f"{path}: holds no {station} by {name!r}: {nearest(name, maps)}")
    return maps[name]


def _optics(result: Result) -> Optics | None:
    """Half-angle tangents from the lengths of the pixels' rays, √(1 + x² + y²)."""
    if result.range_over_depth is None:
        return None
    height, width = result.range_over_depth.shape
    u = (2 * np.arange(width) + 1 - width) / width
    v = (2 * np.arange(height) + 1 - height) / height
    squares = np.stack(np.meshgrid(u**2, v**2), axis=-1).reshape(-1, 2)
    lengths = np.asarray(result.range_over_depth, float).ravel()
    solution = np.linalg.lstsq(squares, lengths**2 - 1, rcond=None)[0]
    across, down = (float(np.sqrt(value)) if value > 0 else 0.0 for value in solution)
    if not (across > 0 or down > 0):
        return None
    return Optics(across or down, down or across)
