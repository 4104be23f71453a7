"""Where four lasers should point: errors of the anchored depth map by the places of its spots.

    python tools/depth_frames.py LEARN
    python tools/depth_frames.py JUDGE --plan PLAN_OF_OTHER_FAMILIES
    python tools/spot_placement.py LEARN JUDGE [--poses 2]

Frames of drawn scenes; in place of their own ranges the true depths of where spots would be, with
an error of 1 %, none where there is nothing within reach. Rectangles of spots, some other layouts,
and layouts that follow the image of the frame before: each next spot where it takes most off the
mean variance that the map's covariance leaves. What looks best on LEARN is judged on JUDGE.
Writes docs/images/spot-placement.png and prints the figures.
"""

import argparse
from collections.abc import Callable, Sequence
from pathlib import Path

import numpy as np
from matplotlib.figure import Figure

from anchored_prior import View, seen
from reconstruction.base.arrays import Floats
from reconstruction.depth.kriging import anchored_depth, fitted_prior
from reconstruction.depth.pixels import around, between, squared_distances
from spisim_app.report.style import plot_style

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "spot-placement.png"
FRACTIONS = np.linspace(0.2, 0.9, 8)
"""Of the half angle, from the middle of the image."""
QUARTERS = 0.5
SIGMA = 0.01
CANDIDATES = 12
"""Places along a side that a spot that follows the image may have."""
RESAMPLED = 2000

Layout = Callable[[View], Floats]
"""Rows and columns (4, 2) of the spots."""


def main() -> None:
    """Errors of all layouts on both sets of frames."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("learn", type=Path)
    parser.add_argument("judge", type=Path)
    parser.add_argument("--poses", type=int, default=2, help="of each scene, at most")
    asked = parser.parse_args()
    learn, judge = (
        [view for file in sorted(folder.glob("*.npz")) for view in seen(file, asked.poses)]
        for folder in (asked.learn, asked.judge)
    )
    maps = [
        np.array(
            [[np.nanmean(errors(rectangle(a, b), each)) for b in FRACTIONS] for a in FRACTIONS]
        )
        for each in (learn, judge)
    ]
    down, across = np.unravel_index(maps[0].argmin(), maps[0].shape)
    best = rectangle(FRACTIONS[down], FRACTIONS[across])
    layouts = {
        "centres of the quarters": rectangle(QUARTERS, QUARTERS),
        f"best rectangle, {FRACTIONS[down]:.1f} down and {FRACTIONS[across]:.1f} across": best,
        "diamond": fixed([(-0.6, 0), (0, -0.6), (0, 0.6), (0.6, 0)]),
        "middle and three around": fixed([(0, 0), (-0.6, 0), (0.4, -0.6), (0.4, 0.6)]),
        "row": fixed([(0, -0.75), (0, -0.25), (0, 0.25), (0, 0.75)]),
        "by the image before": following,
    }
    for name, layout in layouts.items():
        reported = (
            against(layout, layouts["centres of the quarters"], each) for each in (learn, judge)
        )
        print(f"{name:50} {'   '.join(reported)}")
    draw(maps, len(learn), len(judge))


def fixed(fractions: Sequence[tuple[float, float]]) -> Layout:
    """Spots at shares of the half angles, down and across."""

    def positions(view: View) -> Floats:
        return (np.array(fractions) + 1) * np.array(view.image.shape) / 2 - 0.5

    return positions


def rectangle(down: float, across: float) -> Layout:
    """Spots at the corners of a rectangle around the middle."""
    return fixed([(y * down, x * across) for y in (-1, 1) for x in (-1, 1)])


def following(view: View) -> Floats:
    """Each next spot where it takes most off the mean variance that is left (A-optimal, greedy)."""
    prior = fitted_prior()
    shape = view.image.shape
    reference = float(np.percentile(view.image, 90))
    smoothed = around(np.log(np.maximum(view.image, prior.min_brightness * reference)))
    steps = [(np.arange(CANDIDATES) + 0.5) * side / CANDIDATES - 0.5 for side in shape]
    positions = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
    at = between(smoothed, positions)
    length = prior.correlation_length * max(shape)
    out_of_distribution = squared_distances(shape, positions)[::2, ::2] / (2 * length**2)
    out_of_distribution = out_of_distribution + (smoothed[::2, ::2, None] - at) ** 2 / (
        2 * prior.similarity**2
    )
    pixels = np.exp(-out_of_distribution).reshape(-1, len(positions))
    squared = ((positions[:, None] - positions) ** 2).sum(axis=-1) / (2 * length**2)
    own = np.exp(-squared - (at[:, None] - at) ** 2 / (2 * prior.similarity**2))
    chosen: list[int] = []
    for _ in range(4):
        reported = (pixels**2).sum(axis=0) / (np.diagonal(own) + prior.nugget)
        reported[chosen] = -1
        new = int(reported.argmax())
        chosen.append(new)
        scale = own[new, new] + prior.nugget
        pixels = pixels - np.outer(pixels[:, new], own[new]) / scale
        own = own - np.outer(own[:, new], own[new]) / scale
    return positions[chosen]


def errors(layout: Layout, views: Sequence[View]) -> Floats:
    """AbsRel of each frame, nan where no spot meets anything."""
    return np.array([_error(layout(view), view) for view in views])


def _error(positions: Floats, view: View) -> float:
    rows, columns = np.clip(np.rint(positions).astype(int), 0, np.array(view.image.shape) - 1).T
    depth_m = view.true_m[rows, columns]
    depth_m = depth_m * (1 + SIGMA * np.random.default_rng(0).standard_normal(len(depth_m)))
    result = anchored_depth(view.image, positions, depth_m, SIGMA * depth_m, fitted_prior())
    return np.nan if result is None else float(np.nanmean(np.abs(result.depth_m / view.true_m - 1)))


def against(layout: Layout, usual: Layout, views: Sequence[View]) -> str:
    """Mean error, and its ratio to another layout's with the 95 % interval, over scenes."""
    result, before = errors(layout, views), errors(usual, views)
    finite = np.isfinite(result) & np.isfinite(before)
    scenes, position = np.unique([view.scene for view in views], return_inverse=True)
    fraction = np.full(len(scenes), 1 / len(scenes))
    drawn = np.random.default_rng(0).multinomial(len(scenes), fraction, size=RESAMPLED)
    counted = drawn[:, position[finite]].astype(np.float64)
    ratios = (counted @ result[finite]) / (counted @ before[finite])
    low, high = np.percentile(ratios, [2.5, 97.5])
    mean = result[finite].mean() / before[finite].mean()
    return f"{result[finite].mean():.4f} × {mean:.3f} ({low:.3f}–{high:.3f})"


@plot_style()
def draw(maps: Sequence[Floats], *frames: int) -> None:
    """Error by height and width of the rectangle, one panel for each set of frames."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    titles = ("families to learn from", "families that judge")
    step = (FRACTIONS[1] - FRACTIONS[0]) / 2
    for axis, errors_, title, count in zip(
        figure.subplots(1, 2), maps, titles, frames, strict=True
    ):
        ends = (FRACTIONS[0] - step, FRACTIONS[-1] + step)
        displayed = axis.imshow(errors_, origin="lower", extent=ends * 2, cmap="viridis_r")
        down, across = np.unravel_index(errors_.argmin(), errors_.shape)
        axis.plot(QUARTERS, QUARTERS, "k+", markersize=12, label="presets")
        axis.plot(FRACTIONS[across], FRACTIONS[down], "ko", fillstyle="none", label="least")
        axis.set(title=f"{title}, {count} frames", xlabel="half width / half angle")
        axis.set_ylabel("half height / half angle")
        axis.legend(loc="lower right")
        figure.colorbar(displayed, ax=axis, label="mean AbsRel")
    figure.savefig(PICTURE, dpi=90)


if __name__ == "__main__":
    main()
