"""The animation and the table of a flight."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from PIL import Image

from reconstruction import Capture, Result
from reconstruction.base.files import Output, mark, write_atomically
from reconstruction.capture import FrameTruth
from spisim.base.config.files import csv_table
from spisim.dataset.flight import Instant

from .pictures import Scale, depth_scale, intensity_scale, show
from .style import plot_style, spot_looks

#: Duration of the animation's last image.
LAST_S = 1.5


#: The kind of file in the marks; the table is recognized by its first columns.
KIND = "flight"
TABLE_SIGN = "capture,time_s,position_x_m,"


def flight_outputs(folder: Path) -> list[Output]:
    """Return animation, page and table in the folder of a flight."""
    return [
        Output(folder / "flight.gif", KIND),
        Output(folder / "flight.html", KIND),
        Output(folder / "flight.csv", KIND, sign=TABLE_SIGN),
    ]


@dataclass(frozen=True, eq=False)
class EvaluatedFrame:
    """One capture of a flight, its reconstruction and its errors."""

    instant: Instant
    capture: Capture
    result: Result
    metrics: dict[str, Any]
    warnings: Sequence[str] = ()

    @property
    def truth(self) -> FrameTruth:
        """The ground truth."""
        assert self.capture.truth is not None
        return self.capture.truth.at(self.result.frame)

    @property
    def pose(self) -> np.ndarray:
        """World from optical frame, (4, 4)."""
        return self.instant.scene.drone_pose

    @property
    def measured_m(self) -> np.ndarray:
        """Measured spots in the world, (spots, 3); nan without a range."""
        spots = self.result.aimed(self.capture.setup).spots
        if self.result.ranges is None or spots is None:
            return np.full((len(self.truth.spot_range_m), 3), np.nan)
        rays = spots.directions @ self.pose[:3, :3].T
        return np.asarray(self.pose[:3, 3] + self.result.ranges.range_m[:, None] * rays)


@dataclass(frozen=True)
class Scales:
    """Colour scales shared by all frames of a flight."""

    image: Scale
    depth: Scale

    @classmethod
    def of(cls, flight: Sequence[EvaluatedFrame]) -> Scales:
        """Fit the scales to the truth of all frames."""
        return cls(
            intensity_scale(*(frame.truth.image for frame in flight)),
            depth_scale(*(frame.truth.depth_m for frame in flight)),
        )

    def panels(self, frame: EvaluatedFrame) -> list[tuple[str, np.ndarray, Scale]]:
        """Return image, depth map and true depth with their titles and scales."""
        depth_m = frame.result.depth_m
        if depth_m is None:
            depth_m = np.full_like(frame.truth.depth_m, np.nan)
        return [
            ("image", frame.result.image, self.image),
            ("depth", depth_m, self.depth),
            ("true depth", frame.truth.depth_m, self.depth),
        ]


@plot_style()
def write_animation(path: Path, flight: Sequence[EvaluatedFrame], rate_hz: float) -> None:
    """Write a GIF in real time: image, depth map, true depth, and the path from above.

    Raises OSError if it cannot be written.
    """
    scales = Scales.of(flight)
    limits = map_limits(flight)
    pictures = [
        _rendered(_frame(flight[: number + 1], scales, limits)) for number in range(len(flight))
    ]
    durations = [round(1000 / rate_hz)] * (len(pictures) - 1) + [round(1000 * LAST_S)]
    buffer = io.BytesIO()
    pictures[0].save(
        buffer,
        "gif",
        save_all=True,
        append_images=pictures[1:],
        duration=durations,
        loop=0,
        disposal=1,
        comment=mark(KIND),
    )
    write_atomically(path, buffer.getvalue())


def write_table(path: Path, flight: Sequence[EvaluatedFrame]) -> None:
    """Write a CSV with one row per capture: pose, motion, spots, errors and warnings.

    Raises OSError if it cannot be written.
    """
    rows = [_row(frame) for frame in flight]
    table = csv_table([list(rows[0]), *(list(row.values()) for row in rows)])
    write_atomically(path, table.encode())


def _row(frame: EvaluatedFrame) -> dict[str, Any]:
    scene = frame.instant.scene
    spots, image, depth = (_default(frame.metrics[each]) for each in ("spots", "images", "depths"))
    row: dict[str, Any] = {"capture": frame.instant.file, "time_s": f"{frame.instant.time_s:.6g}"}
    vectors: dict[str, Any] = {
        "position_{}_m": frame.pose[:3, 3],
        "forward_{}": frame.pose[:3, 2],
        "velocity_{}_m_s": scene.drone_velocity_m_s,
        "angular_velocity_{}_deg_s": np.degrees(scene.drone_angular_velocity_rad_s),
    }
    for name, vector in vectors.items():
        row |= {
            name.format(axis): _number(value) for axis, value in zip("xyz", vector, strict=True)
        }
    for k, spot in enumerate(spots):
        for key in ("true_m", "range_m", "error_m", "sigma_m"):
            row[f"spot_{k}_{key}"] = _number(spot[key])
        row[f"spot_{k}_status"] = spot["status"]
    row["image_correlation"] = _number(image.get("correlation"))
    for key in ("mae_m", "rmse_m"):
        row[f"depth_{key}"] = _number(depth.get(key))
    row["warnings"] = " | ".join(frame.warnings)
    return row


def _default(methods: Mapping[str, Any]) -> Any:
    """Return the figures of the default method, which is the first, or none."""
    return next(iter(methods.values()), {})


def _number(value: float | None) -> str:
    return "" if value is None else f"{value:.6g}"


def _frame(flown: Sequence[EvaluatedFrame], scales: Scales, limits: tuple[float, ...]) -> Figure:
    """Draw one image of the animation, after all of `flown`."""
    now = flown[-1]
    picture = Figure(figsize=(9.6, 3.05), dpi=100)
    for k, (title, image, scale) in enumerate(scales.panels(now)):
        axis = picture.add_axes((0.008 + 0.232 * k, 0.12, 0.224, 0.224 * 9.6 / 3.05))
        show(axis, image, scale)
        axis.set_title(title, fontsize=9)
    _colour_bar(picture.add_axes((0.242, 0.085, 0.454, 0.025)), scales.depth)
    picture.text(0.702, 0.075, "m", fontsize=7, ha="left")
    picture.text(0.008, 0.03, f"{now.instant.time_s:.2f} s", fontsize=9, weight="bold")
    plan = picture.add_axes((0.768, 0.12, 0.224, 0.224 * 9.6 / 3.05))
    plan.set_title("path and measured spots, m", fontsize=9)
    path = np.array([frame.pose[:3, 3] for frame in flown])
    spots = np.array([frame.measured_m for frame in flown])
    for k, (colour, _) in enumerate(spot_looks(spots.shape[1])):
        plan.plot(spots[:, k, 0], spots[:, k, 1], "o", ms=3, color=colour, mew=0)
        ray = np.stack([path[-1], spots[-1, k]])
        plan.plot(ray[:, 0], ray[:, 1], lw=1.0, color=colour)
    plan.plot(path[:, 0], path[:, 1], color="#20262c", lw=1.5)
    plan.plot(*path[-1, :2], "o", ms=5, mfc="white", mec="#20262c", mew=1.5)
    plan.set(xlim=limits[:2], ylim=limits[2:], aspect="equal")
    plan.tick_params(labelsize=6.5, length=2, pad=2)
    return picture


def map_limits(flight: Sequence[EvaluatedFrame]) -> tuple[float, ...]:
    """Return (left, right, bottom, top) around paths and measured spots."""
    points = [np.concatenate([frame.pose[None, :3, 3], frame.measured_m]) for frame in flight]
    flat = np.concatenate(points)[:, :2]
    flat = flat[np.isfinite(flat).all(axis=1)]
    middle, half = (flat.max(axis=0) + flat.min(axis=0)) / 2, np.ptp(flat, axis=0).max() / 2 + 0.5
    return middle[0] - half, middle[0] + half, middle[1] - half, middle[1] + half


def _colour_bar(axes: Axes, scale: Scale) -> None:
    gradient = scale.rgba(np.linspace(scale.low, scale.high, 256)[None])
    axes.imshow(gradient, aspect="auto", extent=(scale.low, scale.high, 0, 1))
    axes.set_yticks([])
    axes.grid(visible=False)
    axes.tick_params(labelsize=6.5, length=2, pad=1)


def _rendered(figure: Figure) -> Image.Image:
    canvas = FigureCanvasAgg(figure)
    canvas.draw()
    colours = np.asarray(canvas.buffer_rgba())[..., :3]
    return Image.fromarray(np.ascontiguousarray(colours)).quantize(
        256, Image.Quantize.MAXCOVERAGE, dither=Image.Dither.NONE
    )
