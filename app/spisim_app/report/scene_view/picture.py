"""The drawing of a scene: the drone's view, the plan and the side, with fields and spots."""

from dataclasses import dataclass
from pathlib import Path
from typing import Any

import numpy as np
from matplotlib.figure import Figure
from matplotlib.patches import Circle, Polygon, Rectangle
from matplotlib.text import Text
from numpy.typing import NDArray
from scipy.spatial import ConvexHull

from reconstruction.base.arrays import Floats
from reconstruction.base.files import write_atomically
from spisim.instrument import Instrument
from spisim.scene import Scene
from spisim.transport import RayCaster
from spisim_app.report.style import drawn, file_of, plot_style

from .cameras import Section, cut_m, heading, perspective_rays
from .survey import Spot, Survey

#: Colours of the spots; more spots begin again with the first.
SPOT_COLOURS = (
    *("#4aa3f0", "#ff9a3c", "#37c48a", "#c58bff"),
    *("#ff7a85", "#3fc4d0", "#d0be3a", "#f08fd0"),
)
#: Maximum number of spots with their distances in the picture; more have their numbers alone.
LISTED = 4
PROJECTOR, DETECTOR, NEAREST = "#ffd34d", "#ff6b6b", "#ffffff"
SKY = (0.80, 0.86, 0.92)
INK, PALE_INK = "#20262c", "#5a646e"
#: Pixels across a panel, and rays per pixel along each axis.
PIXELS = 560
FINE = 2
#: Margins in pixels: of frames around text, and of discs around spot numbers.
PADDING = 3
#: Aspect ratio of the plan and the side view.
RATIO = 2.05
MARGIN_M = 0.5
#: Maximum distance in plan and side view.
MAX_DISPLAYED_M = 40.0


@dataclass(frozen=True, eq=False)
class Look:
    """A scene, an instrument in it, and their survey."""

    scene: Scene
    instrument: Instrument
    caster: RayCaster
    survey: Survey

    @property
    def spots_m(self) -> Floats:
        """Ends of the beams in the world, (spots, 3); far out if they hit nothing."""
        pose = self.scene.drone_pose
        ranges = np.array([min(spot.range_m, MAX_DISPLAYED_M) for spot in self.survey.spots])
        rays = self.instrument.ranging.lasers.directions @ pose[:3, :3].T
        return np.asarray(pose[:3, 3] + ranges[:, None] * rays)


def write_look(path: str | Path, look: Look, fov_deg: float = 50.0) -> None:
    """Write a PNG of the drone's view, the plan and the side.

    Parameters
    ----------
    path
        The PNG file.
    look
        Scene, instrument and survey.
    fov_deg
        Full angle of the drone's view; by default that of the projector.

    Raises
    ------
    OSError
        If the file cannot be written.
    """
    write_atomically(path, file_of(look_figure(look, fov_deg), "scene view", dpi=100))


@plot_style()
def look_figure(look: Look, fov_deg: float = 50.0) -> Figure:
    """Return the figure of `write_look`."""
    sheet = Figure(figsize=(13.2, 7.2), dpi=100, facecolor="white")
    view = sheet.add_axes((0.012, 0.135, 0.44, 0.44 * 13.2 / 7.2))
    height = 0.455 / RATIO * 13.2 / 7.2
    plan = sheet.add_axes((0.53, 0.555, 0.455, height))
    side = sheet.add_axes((0.53, 0.065, 0.455, height))
    _title(sheet, look)
    _draw_view(view, look, fov_deg)
    _spot_list(sheet, look.survey.spots)
    _draw_sections(plan, side, look)
    return sheet


def view_image(scene: Scene, caster: RayCaster, fov_deg: float, pixels: int = PIXELS) -> Floats:
    """Return colours (pixels, pixels, 3) of the drone's view, `fov_deg` across."""
    tangent = float(np.tan(np.radians(fov_deg) / 2))
    side = pixels * FINE
    rays = perspective_rays(scene.drone_pose, (side, side), tangent, tangent)
    return _picture(caster, rays, (pixels, pixels))


def _title(sheet: Figure, look: Look) -> None:
    result = look.survey
    sheet.text(0.012, 0.952, drawn(result.name), fontsize=15, weight="bold", color=INK, va="bottom")
    size = " × ".join(f"{side:.0f}" if side >= 100 else f"{side:.3g}" for side in result.extents_m)
    facts = (
        f"{result.objects} objects, {result.triangles:,} triangles, {size} m; "
        f"nothing nearer to the drone than {result.clearance_m:.2f} m"
    )
    sheet.text(0.012, 0.014, facts, fontsize=8.5, color=PALE_INK, va="bottom")


def _draw_view(axis: Any, look: Look, fov_deg: float) -> None:
    half = np.tan(np.radians(fov_deg) / 2)
    axis.imshow(view_image(look.scene, look.caster, fov_deg), extent=(-half, half, half, -half))
    projector, detector = look.instrument.imaging.projector, look.instrument.imaging.detector
    wide, high = projector.tan_half_width, projector.tan_half_height
    square = Rectangle((-wide, -high), 2 * wide, 2 * high, fill=False, ec=PROJECTOR, lw=1.8)
    axis.add_patch(square)
    radius = np.tan(np.radians(min(detector.field_of_view_deg, 179)) / 2)
    axis.add_patch(Circle((0, 0), radius, fill=False, ec=DETECTOR, lw=1.4, ls=(0, (5, 4))))
    axis.set(xlim=(-half, half), ylim=(half, -half), xticks=[], yticks=[])
    axis.spines[:].set_visible(False)
    text = f"projector {projector.fov_deg:g}°"
    texts = [_label(axis, (0, -high), text, PROJECTOR, (0, 4), "bottom")]
    if radius < half:
        text = f"detector {detector.field_of_view_deg:g}°"
        texts.append(_label(axis, (0, radius), text, DETECTOR, (0, -4), "top"))
    for k, spot in enumerate(look.instrument.ranging.lasers.directions):
        x, y = spot[:2] / spot[2]
        text = _metres(look.survey.spots[k])
        texts.append(_numbered(axis, x, y, k))
        if len(look.survey.spots) <= LISTED:
            texts.append(_label(axis, (x, y), text, _colour(k), (9, 0), "center"))
    nearest = _projected(look.scene.drone_pose, look.survey.nearest_m)
    _mark_nearest(axis, nearest)
    if np.isfinite(nearest).all():
        _label_clear(axis, nearest, f"nearest {_metres(look.survey.nearest)}", NEAREST, texts)
    title = f"From the drone, {fov_deg:g}° wide"
    axis.set_title(title, fontsize=10, color=INK, loc="right")


def _projected(pose: Floats, point_m: Floats) -> Floats:
    """Return a world point in the image at unit distance, (2,)."""
    local = (point_m - pose[:3, 3]) @ pose[:3, :3]
    return np.asarray(local[:2] / local[2], dtype=np.float64)


def _spot_list(sheet: Figure, spots: tuple[Spot, ...]) -> None:
    """List below the view what each spot hits, in its colour; of many what the first ones do."""
    for k, spot in enumerate(spots[:LISTED]):
        left, top = 0.02 + 0.22 * (k % 2), 0.105 - 0.042 * (k // 2)
        sheet.text(
            left,
            top,
            str(k),
            fontsize=9,
            weight="bold",
            color="white",
            va="center",
            bbox={"boxstyle": "circle,pad=0.25", "fc": _colour(k), "ec": "none"},
        )
        name = spot.object or "nothing"
        text = f"{_metres(spot)}  {drawn(name if len(name) < 30 else name[:29] + '…')}"
        sheet.text(left + 0.018, top, text, fontsize=9.5, color=INK, va="center")


def _draw_sections(plan_axis: Any, side_axis: Any, look: Look) -> None:
    """Draw plan and side view along a common axis, the drone's heading."""
    position, ahead = look.scene.drone_pose[:3, 3], heading(look.scene.drone_pose)
    up = np.array([0.0, 0.0, 1.0])
    left = np.cross(up, ahead)
    plan = Section(position, ahead, left)
    side = Section(position * (1, 1, 0), ahead, up)
    points = np.concatenate([look.survey.points_m, look.spots_m])
    near = points[np.linalg.norm(points - position, axis=1) <= MAX_DISPLAYED_M]
    near = np.concatenate([near, position[None]])
    in_plan, in_side = _limits(plan.project(near), side.project(near))
    _draw_section(plan_axis, look, plan, in_plan, cut_m(look.caster, position, up))
    _draw_section(side_axis, look, side, in_side, cut_m(look.caster, position, -left))
    plan_axis.set_title("From above, cut over the drone", fontsize=10, color=INK, loc="left")
    plan_axis.set_ylabel("to the left, m", fontsize=9)
    side_axis.set_title("From the right, cut beside the drone", fontsize=10, color=INK, loc="left")
    side_axis.set(xlabel="ahead, m")
    side_axis.set_ylabel("height, m", fontsize=9)


def _limits(
    plan: Floats, side: Floats
) -> tuple[tuple[float, float, float, float], tuple[float, float, float, float]]:
    """Return (left, right, bottom, top) around points (n, 2), in one scale for both sections."""
    low, high = plan.min(axis=0) - MARGIN_M, plan.max(axis=0) + MARGIN_M
    floor, roof = side[:, 1].min() - MARGIN_M, side[:, 1].max() + MARGIN_M
    width = max(high[0] - low[0], RATIO * (high[1] - low[1]), RATIO * (roof - floor))
    middle = (low[0] + high[0]) / 2
    left, right = middle - width / 2, middle + width / 2
    spare = (width / RATIO - (high[1] - low[1])) / 2
    return (
        (left, right, low[1] - spare, high[1] + spare),
        (left, right, floor, floor + width / RATIO),
    )


def _draw_section(
    axis: Any, look: Look, section: Section, limits: tuple[float, float, float, float], cut: float
) -> None:
    shape = (round(PIXELS / RATIO), PIXELS)
    rays = section.rays((shape[0] * FINE, shape[1] * FINE), limits, cut)
    axis.imshow(_picture(look.caster, rays, shape), extent=limits, aspect="auto")
    axis.set(xlim=limits[:2], ylim=limits[2:])
    axis.tick_params(labelsize=8)
    axis.spines[:].set_visible(False)
    axis.grid(visible=False)
    pose = look.scene.drone_pose
    here = section.project(pose[:3, 3])
    reach = 2 * np.ptp(limits[:2])
    projector, detector = look.instrument.imaging.projector, look.instrument.imaging.detector
    wide, high = projector.tan_half_width, projector.tan_half_height
    corners = np.array([[x, y, 1.0] for x in (-wide, wide) for y in (-high, high)])
    half = np.radians(min(detector.field_of_view_deg, 170)) / 2
    turn = np.linspace(0, 2 * np.pi, 64, endpoint=False)
    rim = np.stack([np.tan(half) * np.cos(turn), np.tan(half) * np.sin(turn), 1 + 0 * turn], axis=1)
    outline = {"fill": False, "ec": DETECTOR, "lw": 1.2, "ls": (0, (5, 4))}
    _cone(axis, section, pose, rim * reach, **outline)
    _cone(axis, section, pose, corners * reach, fc=PROJECTOR, alpha=0.10, ec="none")
    _cone(axis, section, pose, corners * reach, fill=False, ec=PROJECTOR, lw=1.4)
    ends = section.project(look.spots_m)
    for k, end in enumerate(ends):
        axis.plot(*np.stack([here, end], axis=1), color=_colour(k), lw=1.3)
    for k, (x, y) in enumerate(ends):
        _numbered(axis, x, y, k)
    axis.plot(*here, marker="o", ms=9, mfc="white", mec=INK, mew=2)
    _mark_nearest(axis, section.project(look.survey.nearest_m))


def _cone(axis: Any, section: Section, pose: Floats, rim: Floats, **style: Any) -> None:
    """Return the outline of the cone from the drone to points (n, 3) in its optical frame."""
    world = np.concatenate([pose[None, :3, 3], pose[:3, 3] + rim @ pose[:3, :3].T])
    flat = section.project(world)
    axis.add_patch(Polygon(flat[ConvexHull(flat).vertices], **style))


def _mark_nearest(axis: Any, position: Floats) -> None:
    if np.isfinite(position).all():
        axis.plot(*position, marker="x", ms=8, mec=INK, mew=3.2)
        axis.plot(*position, marker="x", ms=7, mec=NEAREST, mew=1.6)


def _numbered(axis: Any, x: float, y: float, number: int) -> Text:
    axis.plot(x, y, marker="o", ms=12, mfc=_colour(number), mec="white", mew=1.2, zorder=5)
    text: Text = axis.text(
        x,
        y,
        str(number),
        color="white",
        fontsize=8,
        weight="bold",
        ha="center",
        va="center_baseline",
        zorder=6,
    )
    return text


def _label_clear(axis: Any, position: Floats, text: str, colour: str, others: list[Text]) -> None:
    """Place a label below or above a point, as near as other labels allow."""
    taken = [other.get_window_extent().padded(PADDING) for other in others]
    for away in (9, 24, 39):
        for way, va in ((-1, "top"), (1, "bottom")):
            label = _label(axis, position, text, colour, (0, way * away), va)
            if not label.get_window_extent().padded(PADDING).count_overlaps(taken):
                return
            label.remove()
    _label(axis, position, text, colour, (0, -9), "top")


def _colour(number: int) -> str:
    return SPOT_COLOURS[number % len(SPOT_COLOURS)]


def _label(
    axis: Any, position: Any, text: str, colour: str, offset: tuple[float, float], va: str
) -> Text:
    label: Text = axis.annotate(
        text,
        position,
        xytext=offset,
        textcoords="offset points",
        color=colour,
        fontsize=8.5,
        weight="bold",
        ha="left" if offset[0] else "center",
        va=va,
        bbox={"boxstyle": "round,pad=0.15", "fc": INK, "ec": "none", "alpha": 0.72},
        zorder=4,
    )
    return label


def _metres(spot: Spot) -> str:
    return f"{spot.range_m:.2f} m" if np.isfinite(spot.range_m) else "–"


def _picture(caster: RayCaster, rays: tuple[Floats, Floats], shape: tuple[int, int]) -> Floats:
    """Return colours (H, W, 3), each pixel the mean of its rays."""
    tone: NDArray[np.floating] = caster.shaded(*rays).reshape(shape[0] * FINE, shape[1] * FINE, 1)
    colours = np.where(np.isfinite(tone), np.clip(1.3 * tone, 0, 1), np.array(SKY))
    return np.asarray(colours.reshape(shape[0], FINE, shape[1], FINE, 3).mean(axis=(1, 3)))
