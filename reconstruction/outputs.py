"""What a reconstruction leaves in a folder: pictures, point cloud, and the result itself."""

import io
from pathlib import Path
from typing import Any, get_args

import h5py
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .capture import Capture, Unit
from .depth import pixel_of, pixel_rays, point_cloud_ply
from .errors import InputError
from .files import write_atomically
from .hdf5 import content, get, get_text, get_units, opened, put, put_attribute
from .pipeline import Result
from .ranging import Ranges, Status

FORMAT = "spisim-result"
VERSION = "2.0"
MAPS = ("range_m", "depth_m", "depth_nearest_m", "range_dense_m", "depth_dense_m")
RANGES = {
    "range_m": "m",
    "sigma_m": "m",
    "signal_electrons": "electron",
    "background_electrons": "electron",
}
NAMES = (
    "image.png",
    "image_zero_filled.png",
    "depth.png",
    "cloud.ply",
    "depth_dense.png",
    "result.h5",
)


def write_outputs(result: Result, capture: Capture, directory: str | Path) -> dict[str, Path]:
    """Write the files NAMES, of depth maps and point cloud what there is; return their paths.

    Everything is made before the first file is written; each appears whole or not at all, and
    files of an earlier result that have no successor are removed. Raises InputError where the
    folder cannot be written into, OSError where a file cannot be written.
    """
    contents = {
        "image.png": _picture(result.image, "Image (matching pursuit)", result.unit),
        "image_zero_filled.png": _picture(
            result.image_zero_filled, "Image (zero-filled inverse)", result.unit
        ),
        "result.h5": content(lambda file: _write(file, result)),
    }
    if result.depth_m is not None and capture.optics is not None:
        points = pixel_rays(capture.optics, capture.plan.shape) * result.depth_m[..., None]
        contents["depth.png"] = _anchored_picture(result, capture)
        contents["cloud.ply"] = point_cloud_ply(points, result.image.astype(np.float64))
    if result.depth_dense_m is not None:
        figure, _ = _depth_picture(result.depth_dense_m, "Depth measured in every pixel")
        contents["depth_dense.png"] = _png(figure)
    folder = Path(directory)
    for name in NAMES:
        if name in contents:
            write_atomically(folder / name, contents[name])
        else:
            (folder / name).unlink(missing_ok=True)
    return {name: folder / name for name in NAMES if name in contents}


def read_result(path: str | Path) -> Result:
    """Read a result.h5. Raises InputError if it is missing, damaged or not a result."""
    if not Path(path).is_file():
        raise InputError(f"{path}: no result there; run spisim reconstruct CAPTURE -o DIR")
    with opened(path, FORMAT, "result") as file:
        unit: Unit = "count" if get_units(file, "image") == "count" else "electron"
        image = get(file, "image", unit)
        maps = {name: _get_map(file, name, "m", image) for name in MAPS if name in file}
        return Result(
            image=image,
            image_zero_filled=_get_map(file, "image_zero_filled", unit, image),
            **dict.fromkeys(MAPS) | maps,
            ranges=_get_ranges(file) if "ranges" in file else None,
            timings_s={name: float(value[()]) for name, value in file["timings_s"].items()},
            unit=unit,
            recording=get_text(file, "recording"),
            frame=int(get(file, "frame", "1")),
            patterns=int(get(file, "patterns", "1")),
        )


def _get_map(file: h5py.File, name: str, units: str, image: NDArray[Any]) -> NDArray[Any]:
    values = get(file, name, units)
    if values.ndim != 2 or values.shape != image.shape:
        raise InputError(f"dataset {name} has shape {values.shape}, the image {image.shape}")
    return values


def _get_ranges(file: h5py.File) -> Ranges:
    values = {name: get(file, f"ranges/{name}", units) for name, units in RANGES.items()}
    status = tuple(text.decode() for text in get(file, "ranges/status", "1"))
    for name, array in values.items():
        if array.shape != (len(status),):
            raise InputError(f"dataset ranges/{name} has shape {array.shape}, expected (4,)")
    unknown = set(status) - set(get_args(Status))
    if unknown:
        raise InputError(f"dataset ranges/status holds {', '.join(map(repr, unknown))}")
    return Ranges(**values, status=status)


def _write(file: h5py.File, result: Result) -> None:
    put_attribute(file, "format", FORMAT)
    put_attribute(file, "version", VERSION)
    for name in ("recording", "frame", "patterns"):
        put(file, name, getattr(result, name), "1")
    for name in ("image", "image_zero_filled"):
        put(file, name, getattr(result, name), result.unit)
    for name in MAPS:
        if getattr(result, name) is not None:
            put(file, name, getattr(result, name), "m")
    if result.ranges is not None:
        for name, units in RANGES.items():
            put(file, f"ranges/{name}", getattr(result.ranges, name), units)
        put(file, "ranges/status", np.array(result.ranges.status, dtype="S"), "1")
    file.create_group("timings_s")
    for stage, seconds in result.timings_s.items():
        put(file, f"timings_s/{stage}", seconds, "s")


def _picture(image: NDArray[np.float32], title: str, unit: str) -> bytes:
    figure, axes = _figure(title)
    # Single bright pixels do not dim the rest.
    low, high = np.percentile(image, (0.5, 99.5))
    shown = axes.imshow(image, cmap="gray", vmin=low, vmax=max(high, low + 1e-12))
    figure.colorbar(shown, ax=axes, label=f"{unit}s per exposure", shrink=0.85)
    return _png(figure)


def _depth_picture(depth_m: NDArray[np.float32], title: str) -> tuple[Figure, Any]:
    figure, axes = _figure(title)
    finite = depth_m[np.isfinite(depth_m)]
    low, high = np.percentile(finite, (1, 99)) if finite.size else (0.0, 1.0)
    axes.set_facecolor("0.5")  # where there is no depth
    axes.set_axis_on()
    axes.set(xticks=[], yticks=[])
    shown = axes.imshow(depth_m, cmap="viridis_r", vmin=low, vmax=max(high, low + 1e-6))
    figure.colorbar(shown, ax=axes, label="depth along the optical axis / m", shrink=0.85)
    return figure, axes


def _anchored_picture(result: Result, capture: Capture) -> bytes:
    assert result.depth_m is not None
    figure, axes = _depth_picture(result.depth_m, "Depth anchored on the spots")
    if capture.spots is not None and capture.optics is not None and result.ranges is not None:
        anchors = pixel_of(capture.spots.directions, capture.optics, capture.plan.shape)
        depths = result.ranges.range_m * capture.spots.directions[:, 2]
        for (row, column), depth_m, status in zip(
            anchors, depths, result.ranges.status, strict=True
        ):
            text = f" {depth_m:.2f} m" if status == "ok" else f" {status}"
            axes.plot(column, row, "+", color="white", markersize=9)
            axes.annotate(
                text,
                (column, row),
                color="white",
                fontsize=9,
                bbox={"facecolor": "black", "alpha": 0.5, "edgecolor": "none", "pad": 1},
            )
    return _png(figure)


def _figure(title: str) -> tuple[Figure, Any]:
    figure = Figure(figsize=(6, 5), dpi=120, layout="constrained")
    axes = figure.subplots()
    axes.set_axis_off()
    axes.set_title(title, fontsize=11)
    return figure, axes


def _png(figure: Figure) -> bytes:
    buffer = io.BytesIO()
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()
