"""What more spots, and mirrors that steer them, could add to a depth map within some time.

An upper bound: true ranges with an error of 1 %, exact poses, occlusion known, mirrors without
dynamics. The ranges of the last frames are brought into the view of the last one, where a Gaussian
process corrects the `learned` map of that frame alone (kernel of fog-free flights, fitted on other
families). Families that nothing was learned from, three motions, light by the surrogate.
"""

from collections.abc import Callable, Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from depth_sets import JUDGED_BY
from flight_sets import MOTIONS, clear_path
from intervals import of_figure

import spisim
from reconstruction import Reconstructor
from reconstruction.base.arrays import Floats
from reconstruction.depth import pixel_of
from spisim.instrument import Instrument
from spisim.instrument.steering import PLASTIC, directions
from spisim.scene import Scene, Trajectory, draw_scene
from spisim.simulation.flight.motion import scene_at
from spisim.transport.backend import with_backend
from spisim.transport.geometry import rays_of
from spisim.transport.meshes import Meshes
from spisim_paper.checks import Check, Table

SPOTS, TIMES_S = (1, 4, 16, 64), (0.1, 0.3, 1.0, 3.0)
MODES = ("fixed", "raster", "random", "adaptive")
WEATHERS = {"clear": None, "fog 70 m": {"kind": "moderate-radiation", "visibility_m": 70}}
SPEED_M_S = 1.5
HALF_DEG, RANGE_ERROR, MAX_ANCHORS, CANDIDATES, REMEMBERED = 9.0, 0.01, 300, 32, 64
#: Variance fractions and lengths in pixels of 64 × 64, and the scale of differences of ln depth.
SHARP, SMOOTH, NUGGET, EDGE = (0.35, 3.0), (0.58, 22.0), 0.07, 0.45


@dataclass(frozen=True, eq=False)
class View:
    """The last frame of a flight: its map of ln depth with sigma (H, W), truth, and path."""

    name: str
    instrument: Instrument
    scene: Scene
    path: Trajectory
    log_depth: Floats
    sigma: Floats
    true_m: Floats


def views(weather: str, seeds: int) -> Iterator[View]:
    """The last frames of flights, one for each family, seed and motion in turn."""
    instrument = spisim.load_instrument("fog")
    fog = WEATHERS[weather]
    for number, (family, seed) in enumerate((f, s) for s in range(seeds) for f in JUDGED_BY):
        if family == "targets":
            continue
        scene = draw_scene(family, 700 + seed, changes={"fog": fog, "rain": None})
        path = clear_path(scene, MOTIONS[number % len(MOTIONS)], SPEED_M_S, TIMES_S[-1])
        last = scene_at(scene, path.duration_s, path.pose(path.duration_s))
        capture = spisim.simulate(last, instrument, light="surrogate", seed=seed).capture
        result = Reconstructor(capture.setup, depth="learned")(capture.frame(0))
        sigma = result.log_depth_sigmas.get("learned")
        if sigma is None or capture.truth is None:
            continue
        depth_m = np.asarray(result.depths["learned"], np.float64)
        filled = np.where(np.isfinite(depth_m), depth_m, np.nanmedian(depth_m))
        true_m = capture.truth.depth_m[0].astype(np.float64)
        sigma = np.nan_to_num(sigma, nan=1.0)
        yield View(f"{family} {seed}", instrument, scene, path, np.log(filled), sigma, true_m)


def aims(mode: str, spots: int, frames: int, view: View) -> Floats:
    """Azimuths and elevations (frames, spots, 2) in degrees."""
    side = int(np.ceil(np.sqrt(spots)))
    cells = HALF_DEG * ((2 * np.arange(side) + 1) / side - 1)
    grid = np.stack(np.meshgrid(cells, cells), -1).reshape(-1, 2)[:spots]
    if mode == "fixed":
        return np.tile(grid, (frames, 1, 1))
    number = np.arange(frames * spots)
    if mode == "raster":
        across = 2 * np.abs((number / 32) % 2 - 1) - 1
        down = 1 - 2 * ((number // 32) % 32 + 0.5) / 32
        return HALF_DEG * np.stack([across, down], -1).reshape(frames, spots, 2)
    even = 2 * ((0.5 + number[:, None] * PLASTIC ** -np.arange(1.0, 3.0)) % 1) - 1
    if mode == "random":
        return HALF_DEG * even.reshape(frames, spots, 2)
    return _adaptive(spots, frames, view)


def _adaptive(spots: int, frames: int, view: View) -> Floats:
    """Where the map is least sure, far from what was met before."""
    rng = np.random.default_rng(0)
    chosen = np.zeros((frames * spots, 2))
    for number in range(len(chosen)):
        offered = rng.uniform(-HALF_DEG, HALF_DEG, (CANDIDATES, 2))
        before = chosen[max(0, number - REMEMBERED) : number]
        away = np.linalg.norm(offered[:, None] - before, axis=-1).min(axis=1, initial=HALF_DEG)
        row, column = _pixels(view, directions(offered))
        chosen[number] = offered[np.argmax(away * view.sigma[row, column])]
    return chosen.reshape(frames, spots, 2)


def _pixels(view: View, rays: Floats) -> tuple[Floats, Floats]:
    projector, shape = view.instrument.imaging.projector, view.sigma.shape
    pixel = pixel_of(rays, projector, shape)  # type: ignore[arg-type] - of the same attributes
    row, column = np.clip(np.round(pixel), 0, np.array(shape) - 1).astype(np.intp).T
    return row, column


@with_backend
def anchors(view: View, mode: str, spots: int, time_s: float) -> tuple[Floats, Floats]:
    """Ranges of the last `time_s` in the last view: pixels (n, 2) and ln depth (n,)."""
    frame_s = view.instrument.frame_time_s
    frames = max(1, int(time_s / frame_s))
    middles_s = view.path.duration_s - frame_s * (frames - 0.5 - np.arange(frames))
    poses = np.array([view.path.pose(each) for each in middles_s])
    rays = directions(aims(mode, spots, frames, view))
    world = np.einsum("fij,fsj->fsi", poses[:, :3, :3], rays).reshape(-1, 3)
    origins = np.repeat(poses[:, :3, 3], spots, axis=0)
    met = Meshes.of(view.scene.objects).scene.ray_intersect(rays_of(origins, world))
    range_m, hit = met.t.numpy().astype(np.float64), met.is_valid().numpy()
    range_m *= 1 + RANGE_ERROR * np.random.default_rng(1).standard_normal(range_m.shape)
    points = (origins + world * np.where(hit, range_m, 1.0)[:, None])[hit & (range_m < 40)]
    last = view.path.pose(view.path.duration_s)
    local = (points - last[:3, 3]) @ last[:3, :3]
    local = local[local[:, 2] > 0.1]
    projector, shape = view.instrument.imaging.projector, view.sigma.shape
    pixel = pixel_of(local, projector, shape)  # type: ignore[arg-type]
    inside = ((pixel > -0.5) & (pixel < np.array(shape) - 0.5)).all(axis=1)
    pixel, depth_m = pixel[inside], local[inside, 2]
    row, column = np.round(pixel).astype(np.intp).T
    seen = ~(depth_m > 1.1 * view.true_m[row, column])  # others are hidden by now
    return pixel[seen], np.log(depth_m[seen])


def corrected(view: View, pixel: Floats, log_depth: Floats) -> Floats:
    """Map of ln depth with the anchors, by simple kriging of the map's error."""
    if len(pixel) > MAX_ANCHORS:
        some = np.random.default_rng(2).permutation(len(pixel))[:MAX_ANCHORS]
        pixel, log_depth = pixel[some], log_depth[some]
    if not len(pixel):
        return view.log_depth
    row, column = np.round(pixel).astype(np.intp).T
    mean, sigma = view.log_depth[row, column], view.sigma[row, column]
    whole = np.stack(np.indices(view.sigma.shape), -1).reshape(-1, 2)

    def kernel(one: tuple[Floats, ...], other: tuple[Floats, ...]) -> Floats:
        apart = np.linalg.norm(one[0][:, None] - other[0], axis=-1)
        near = sum(weight * np.exp(-apart / length) for weight, length in (SHARP, SMOOTH))
        alike = np.exp(-0.5 * ((one[1][:, None] - other[1]) / EDGE) ** 2)
        return np.asarray(one[2][:, None] * other[2] * near * alike)

    known = (pixel, mean, sigma)
    every = (whole.astype(np.float64), view.log_depth.ravel(), view.sigma.ravel())
    noise = NUGGET * sigma**2 + RANGE_ERROR**2
    weights = np.linalg.solve(kernel(known, known) + np.diag(noise), log_depth - mean)
    return view.log_depth + (kernel(every, known) @ weights).reshape(view.sigma.shape)


def abs_rel(view: View, log_depth: Floats) -> float:
    """Mean relative error within 40 m."""
    there = view.true_m < 40
    return float(np.mean(np.abs(np.exp(log_depth) / view.true_m - 1)[there]))


Errors = dict[tuple[str, str, int, float], list[float]]


def study(*, quick: bool, progress: Callable[[str], None] = print) -> tuple[Errors, list[str]]:
    """Errors of every weather, mode (or "single"), number of spots and time, one per flight."""
    errors: Errors = {}
    names: list[str] = []
    for weather in WEATHERS:
        for view in views(weather, 1 if quick else 2):
            names += [view.name] if weather == "clear" else []
            errors.setdefault((weather, "single", 0, 0.0), []).append(abs_rel(view, view.log_depth))
            for mode in MODES:
                for spots in SPOTS if not quick else (4, 64):
                    for time_s in TIMES_S if not quick else (0.3, 1.0):
                        result = corrected(view, *anchors(view, mode, spots, time_s))
                        key = (weather, mode, spots, time_s)
                        errors.setdefault(key, []).append(abs_rel(view, result))
            progress(f"{weather}, {view.name}")
    return errors, names


def tables(errors: Errors, names: list[str]) -> list[Table]:
    """AbsRel by spots, steering and time."""
    made = []
    times = sorted({time_s for *_, time_s in errors if time_s})
    for weather in WEATHERS:
        single = np.array(errors[weather, "single", 0, 0.0])
        rows = []
        for spots in sorted({spots for _, _, spots, _ in errors if spots}):
            for mode in MODES:
                cells = []
                for time_s in times:
                    values = np.array(errors[weather, mode, spots, time_s])
                    low, high = _ratio(values, single)
                    cells.append(f"{values.mean():.3f} ({low:.2f}–{high:.2f})")
                rows.append((f"{spots}", mode, *cells))
        title = (
            f"AbsRel in {weather} of {len(single)} flights of {len(set(names))} drawn worlds, and "
            f"its ratio to that of the single frame ({single.mean():.3f}), 95 % over flights."
        )
        made.append(Table(title, ("spots", "steering", *(f"{each:g} s" for each in times)), rows))
    return made


def _ratio(values: Floats, single: Floats) -> tuple[float, float]:
    interval = of_figure(
        lambda some: float(values[some].mean() / single[some].mean()),
        np.arange(len(values)),
        positive=True,
    )
    low, high = interval(0.95)
    return float(low), float(high)


def promises(errors: Errors) -> list[Check]:
    """Four steered spots in a third of a second."""
    limits = {"clear": 0.7, "fog 70 m": 0.7}
    return [
        Check(
            f"four random spots in 0.3 s over the single frame, {weather}",
            float(
                np.mean(errors[weather, "random", 4, 0.3])
                / np.mean(errors[weather, "single", 0, 0.0])
            ),
            limit,
        )
        for weather, limit in limits.items()
    ]


def draw(errors: Errors, path: Path) -> None:
    """A panel for each weather and time: error against the number of spots, by steering."""
    import matplotlib.pyplot as plt

    from spisim_app.report.style import plot_style

    times = sorted({time_s for *_, time_s in errors if time_s})
    with plot_style():
        figure, axes = plt.subplots(len(WEATHERS), len(times), figsize=(11, 5.5), sharex=True,
                                    sharey=True, layout="constrained", squeeze=False)  # fmt: skip
        for row, weather in zip(axes, WEATHERS, strict=True):
            single = np.mean(errors[weather, "single", 0, 0.0])
            for panel, time_s in zip(row, times, strict=True):
                panel.axhline(single, color="0.5", linestyle=":", label="single frame")
                for mode in MODES:
                    spots = [n for w, m, n, t in errors if (w, m, t) == (weather, mode, time_s)]
                    values = [np.mean(errors[weather, mode, n, time_s]) for n in spots]
                    panel.plot(spots, values, "o-", label=mode, markersize=4)
                panel.set(xscale="log", title=f"{weather}, {time_s:g} s")
                panel.set_xticks(spots, [str(n) for n in spots])
            row[0].set_ylabel("AbsRel of the depth map")
        for panel in axes[-1]:
            panel.set_xlabel("spots")
        axes[0, -1].legend()
        figure.savefig(path, dpi=110)
        plt.close(figure)
