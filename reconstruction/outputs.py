"""What a reconstruction leaves in a folder: pictures, point cloud, and the result itself."""

import io
from dataclasses import fields
from pathlib import Path
from typing import Any

import h5py
import numpy as np
from matplotlib.figure import Figure
from numpy.typing import NDArray

from .capture import Capture
from .depth import pixel_of, pixel_rays, point_cloud_ply
from .errors import InputError
from .files import write_atomically
from .pipeline import Result
from .ranging import Ranges

FORMAT = "spisim-result"
VERSION = "1.0"
IMAGES = {
    "image": "electron",
    "image_zero_filled": "electron",
    "range_m": "m",
    "depth_m": "m",
    "depth_nearest_m": "m",
}
RANGES = {
    "range_m": "m",
    "sigma_m": "m",
    "amplitude_electrons": "electron",
    "offset_electrons": "electron",
    "valid": "1",
}
NAMES = ("image.png", "image_zero_filled.png", "depth.png", "cloud.ply", "result.h5")


def write_outputs(result: Result, capture: Capture, directory: str | Path) -> dict[str, Path]:
    """Write the files NAMES, without depth map neither depth.png nor cloud.ply; return their paths.

    Everything is made before the first file is written; each appears whole or not at all, and
    files of an earlier result that have no successor are removed. Raises OSError.
    """
    contents = {
        "image.png": _picture(result.image, "Image (matching pursuit)"),
        "image_zero_filled.png": _picture(result.image_zero_filled, "Image (zero-filled inverse)"),
        "result.h5": _result_file(result),
    }
    if result.depth_m is not None and capture.optics is not None:
        points = pixel_rays(capture.optics, capture.plan.shape) * result.depth_m[..., None]
        contents["depth.png"] = _depth_picture(result, capture)
        contents["cloud.ply"] = point_cloud_ply(points, result.image.astype(np.float64))
    folder = Path(directory)
    folder.mkdir(parents=True, exist_ok=True)
    for name in NAMES:
        if name in contents:
            write_atomically(folder / name, contents[name])
        else:
            (folder / name).unlink(missing_ok=True)
    return {name: folder / name for name in NAMES if name in contents}


def read_result(path: str | Path) -> Result:
    """Read a result.h5. Raises InputError if it is missing or not a result."""
    try:
        with h5py.File(path, "r") as file:
            if file.attrs.get("format") != FORMAT:
                raise InputError(f"{path}: not a result: its attribute format is not {FORMAT!r}")
            images: dict[str, Any] = {
                name: file[name][()] if name in file else None for name in IMAGES
            }
            ranges = None
            if "ranges" in file:
                values = {name: file[f"ranges/{name}"][()] for name in RANGES}
                ranges = Ranges(**values | {"valid": values["valid"].astype(bool)})
            timings = {name: float(value[()]) for name, value in file["timings_s"].items()}
    except InputError:
        raise
    except (OSError, KeyError) as error:
        raise InputError(f"{path}: cannot be read as a result ({error})") from error
    return Result(ranges=ranges, timings_s=timings, **images)


def _result_file(result: Result) -> bytes:
    buffer = io.BytesIO()
    with h5py.File(buffer, "w", libver=("earliest", "v110")) as file:
        file.attrs["format"] = FORMAT
        file.attrs["version"] = VERSION

        def put(name: str, value: Any, units: str) -> None:
            file.create_dataset(name, data=value, track_times=False).attrs["units"] = units

        for name, units in IMAGES.items():
            if getattr(result, name) is not None:
                put(name, getattr(result, name), units)
        if result.ranges is not None:
            for field in fields(result.ranges):
                value = getattr(result.ranges, field.name)
                stored = value.astype(np.uint8) if value.dtype.kind == "b" else value
                put(f"ranges/{field.name}", stored, RANGES[field.name])
        file.create_group("timings_s")
        for stage, seconds in result.timings_s.items():
            put(f"timings_s/{stage}", seconds, "s")
    return buffer.getvalue()


def _picture(image: NDArray[np.float32], title: str) -> bytes:
    figure, axes = _figure(title)
    # Single bright pixels do not dim the rest.
    low, high = np.percentile(image, (0.5, 99.5))
    shown = axes.imshow(image, cmap="gray", vmin=low, vmax=max(high, low + 1e-12))
    figure.colorbar(shown, ax=axes, label="electrons per exposure", shrink=0.85)
    return _png(figure)


def _depth_picture(result: Result, capture: Capture) -> bytes:
    figure, axes = _figure("Depth anchored on the spots")
    shown = axes.imshow(result.depth_m, cmap="viridis_r")
    figure.colorbar(shown, ax=axes, label="depth along the optical axis / m", shrink=0.85)
    if capture.spots is not None and capture.optics is not None and result.ranges is not None:
        anchors = pixel_of(capture.spots.directions, capture.optics, capture.plan.shape)
        for (row, column), range_m in zip(anchors, result.ranges.range_m, strict=True):
            text = f" {range_m:.2f} m" if np.isfinite(range_m) else " no range"
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
