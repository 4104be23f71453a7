"""The animation and the table of a flight, and its frames as pictures."""

from __future__ import annotations

import io
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Any, NamedTuple, Self

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from numpy.typing import NDArray
from PIL import Image

from reconstruction import Capture, Result
from reconstruction.base.arrays import Floats
from reconstruction.base.files import Output, mark, write_atomically
from reconstruction.capture import FrameTruth
from reconstruction.depth.pixels import pixels_in_view
from reconstruction.evaluation import method_title
from reconstruction.outputs.pictures import dotted
from spisim.base.config.files import csv_table
from spisim.dataset.flight import Instant
from spisim.dataset.poses import placed

from .pictures import Scale, depth_scale, intensity_scale, png_address, show
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
    """One frame of a flight, its reconstruction and its errors.

    ``pose`` (4, 4) is world from optical frame; ``compared`` if all depth methods are shown.
    """

    name: str
    time_s: float
    pose: Floats
    capture: Capture
    result: Result
    metrics: dict[str, Any]
    warnings: Sequence[str] = ()
    compared: bool = False

    @classmethod
    def of_recording(cls, capture: Capture, result: Result, metrics: dict[str, Any]) -> Self:
        """A frame of a recorded flight; at the origin without a pose."""
        assert capture.poses is not None
        at, time_s = placed(capture, result.frame), float(capture.poses.time_s[result.frame])
        pose, name = np.eye(4) if at is None else at.pose, f"frame {result.frame}"
        return cls(name, time_s, pose, capture, result, metrics, result.warnings, compared=True)

    @property
    def methods(self) -> list[str]:
        """Depth methods to show, the default one first."""
        return list(self.result.depths)[: None if self.compared else 1]

    @property
    def truth(self) -> FrameTruth:
        """The ground truth."""
        assert self.capture.truth is not None
        return self.capture.truth.at(self.result.frame)

    def point_pixels(self, method: str) -> Floats | None:
        """Rows and columns (N, 2) of the points in view that a depth method remembers, if any."""
        points_m, optics = self.result.points_m.get(method), self.capture.optics
        if points_m is None or optics is None:
            return None
        return pixels_in_view(points_m, optics, self.capture.plan.shape)

    @property
    def measured_m(self) -> np.ndarray:
        """Measured spots in the world, (spots, 3); nan without a range."""
        spots = self.result.aimed(self.capture.setup).spots
        if self.result.ranges is None or spots is None:
            return np.full((len(self.truth.spot_range_m), 3), np.nan)
        rays = spots.directions @ self.pose[:3, :3].T
        return np.asarray(self.pose[:3, 3] + self.result.ranges.range_m[:, None] * rays)


class Panel(NamedTuple):
    """A picture of a frame; remembered points are dots at ``pixels`` (N, 2)."""

    title: str
    image: NDArray[Any]
    scale: Scale
    pixels: Floats | None = None

    @property
    def address(self) -> str:
        """It as a data URL."""
        return png_address(self.rgba)

    @property
    def rgba(self) -> NDArray[np.uint8]:
        """Its colours."""
        rgba = self.scale.rgba(self.image)
        return rgba if self.pixels is None else dotted(rgba, self.pixels)


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

    def panels(self, frame: EvaluatedFrame) -> list[Panel]:
        """Return image, depth maps, the default one last, and true depth."""
        depths, true_m = frame.result.depths, frame.truth.depth_m
        several = len(frame.methods) > 1
        maps = [
            Panel(
                f"depth, {method_title('depths', method)}" if several else "depth",
                depths.get(method, np.full_like(true_m, np.nan)),
                self.depth,
                frame.point_pixels(method),
            )
            for method in reversed(frame.methods or [""])
        ]
        image = Panel("image", frame.result.image, self.image)
        return [image, *maps, Panel("true depth", true_m, self.depth)]


@plot_style()
def write_animation(path: Path, flight: Sequence[EvaluatedFrame], rate_hz: float) -> None:
    """Write a GIF in real time: image, depth maps, true depth, and the path from above.

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


def write_table(path: Path, flight: Sequence[EvaluatedFrame], instants: Sequence[Instant]) -> None:
    """Write a CSV with one row per capture: pose, motion, spots, errors and warnings.

    Raises OSError if it cannot be written.
    """
    rows = [_row(*each) for each in zip(flight, instants, strict=True)]
    table = csv_table([list(rows[0]), *(list(row.values()) for row in rows)])
    write_atomically(path, table.encode())


def _row(frame: EvaluatedFrame, instant: Instant) -> dict[str, Any]:
    scene = instant.scene
    spots, image, depth = (_default(frame.metrics[each]) for each in ("spots", "images", "depths"))
    row: dict[str, Any] = {"capture": frame.name, "time_s": f"{frame.time_s:.6g}"}
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
    panels = scales.panels(now)
    count, height_in = len(panels) + 1, 3.05
    width_in = 2.4 * count
    step, side = 2.2272 / width_in, 2.1504 / width_in  # of panels, from the left
    square = 0.12, side, side * width_in / height_in
    picture = Figure(figsize=(width_in, height_in), dpi=100)
    for k, panel in enumerate(panels):
        axis = picture.add_axes((0.008 + step * k, *square))
        show(axis, panel.rgba)
        axis.set_title(panel.title, fontsize=9)
    bar = 0.008 + step + 0.002, 0.085, step * (count - 2) - 0.01, 0.025
    _colour_bar(picture.add_axes(bar), scales.depth)
    picture.text(bar[0] + bar[2] + 0.006, 0.075, "m", fontsize=7, ha="left")
    picture.text(0.008, 0.03, f"{now.time_s:.2f} s", fontsize=9, weight="bold")
    plan = picture.add_axes((0.992 - side, *square))
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
