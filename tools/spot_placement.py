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

from anchored_prior import Sight, seen
from reconstruction.base.arrays import Floats
from reconstruction.depth.anchored_prior import fitted_prior
from reconstruction.depth.kriging import anchored_depth
from reconstruction.depth.neighbours import around, between
from reconstruction.depth.rays import squared_distances
from spisim.report.style import plot_style

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "spot-placement.png"
SHARES = np.linspace(0.2, 0.9, 8)
"""Of the half angle, from the middle of the image."""
QUARTERS = 0.5
SIGMA = 0.01
CANDIDATES = 12
"""Places along a side that a spot that follows the image may have."""
RESAMPLED = 2000

Layout = Callable[[Sight], Floats]
"""Rows and columns (4, 2) of the spots."""


def main() -> None:
    """Errors of all layouts on both sets of frames."""
    parser = argparse.ArgumentParser(description=__doc__.partition("\n")[0])
    parser.add_argument("learn", type=Path)
    parser.add_argument("judge", type=Path)
    parser.add_argument("--poses", type=int, default=2, help="of each scene, at most")
    asked = parser.parse_args()
    learn, judge = (
        [sight for file in sorted(folder.glob("*.npz")) for sight in seen(file, asked.poses)]
        for folder in (asked.learn, asked.judge)
    )
    maps = [
        np.array([[np.nanmean(errors(rectangle(a, b), each)) for b in SHARES] for a in SHARES])
        for each in (learn, judge)
    ]
    down, across = np.unravel_index(maps[0].argmin(), maps[0].shape)
    best = rectangle(SHARES[down], SHARES[across])
    layouts = {
        "centres of the quarters": rectangle(QUARTERS, QUARTERS),
        f"best rectangle, {SHARES[down]:.1f} down and {SHARES[across]:.1f} across": best,
        "diamond": fixed([(-0.6, 0), (0, -0.6), (0, 0.6), (0.6, 0)]),
        "middle and three around": fixed([(0, 0), (-0.6, 0), (0.4, -0.6), (0.4, 0.6)]),
        "row": fixed([(0, -0.75), (0, -0.25), (0, 0.25), (0, 0.75)]),
        "by the image before": following,
    }
    for name, layout in layouts.items():
        told = (
            against(layout, layouts["centres of the quarters"], each) for each in (learn, judge)
        )
        print(f"{name:50} {'   '.join(told)}")
    draw(maps, len(learn), len(judge))


def fixed(shares: Sequence[tuple[float, float]]) -> Layout:
    """Spots at shares of the half angles, down and across."""

    def places(sight: Sight) -> Floats:
        return (np.array(shares) + 1) * np.array(sight.image.shape) / 2 - 0.5

    return places


def rectangle(down: float, across: float) -> Layout:
    """Spots at the corners of a rectangle around the middle."""
    return fixed([(y * down, x * across) for y in (-1, 1) for x in (-1, 1)])


def following(sight: Sight) -> Floats:
    """Each next spot where it takes most off the mean variance that is left (A-optimal, greedy)."""
    prior = fitted_prior()
    shape = sight.image.shape
    reference = float(np.percentile(sight.image, 90))
    smoothed = around(np.log(np.maximum(sight.image, prior.min_brightness * reference)))
    steps = [(np.arange(CANDIDATES) + 0.5) * side / CANDIDATES - 0.5 for side in shape]
    places = np.stack(np.meshgrid(*steps, indexing="ij"), axis=-1).reshape(-1, 2)
    at = between(smoothed, places)
    length = prior.correlation_length * max(shape)
    unlike = squared_distances(shape, places)[::2, ::2] / (2 * length**2)
    unlike = unlike + (smoothed[::2, ::2, None] - at) ** 2 / (2 * prior.similarity**2)
    pixels = np.exp(-unlike).reshape(-1, len(places))
    squared = ((places[:, None] - places) ** 2).sum(axis=-1) / (2 * length**2)
    own = np.exp(-squared - (at[:, None] - at) ** 2 / (2 * prior.similarity**2))
    chosen: list[int] = []
    for _ in range(4):
        told = (pixels**2).sum(axis=0) / (np.diagonal(own) + prior.nugget)
        told[chosen] = -1
        new = int(told.argmax())
        chosen.append(new)
        scale = own[new, new] + prior.nugget
        pixels = pixels - np.outer(pixels[:, new], own[new]) / scale
        own = own - np.outer(own[:, new], own[new]) / scale
    return places[chosen]


def errors(layout: Layout, sights: Sequence[Sight]) -> Floats:
    """AbsRel of each frame, nan where no spot meets anything."""
    return np.array([_error(layout(sight), sight) for sight in sights])


def _error(places: Floats, sight: Sight) -> float:
    rows, columns = np.clip(np.rint(places).astype(int), 0, np.array(sight.image.shape) - 1).T
    depth_m = sight.true_m[rows, columns]
    depth_m = depth_m * (1 + SIGMA * np.random.default_rng(0).standard_normal(len(depth_m)))
    found = anchored_depth(sight.image, places, depth_m, SIGMA * depth_m, fitted_prior())
    return np.nan if found is None else float(np.nanmean(np.abs(found.depth_m / sight.true_m - 1)))


def against(layout: Layout, usual: Layout, sights: Sequence[Sight]) -> str:
    """Mean error, and its ratio to another layout's with the 95 % interval, over scenes."""
    found, before = errors(layout, sights), errors(usual, sights)
    known = np.isfinite(found) & np.isfinite(before)
    scenes, place = np.unique([sight.scene for sight in sights], return_inverse=True)
    share = np.full(len(scenes), 1 / len(scenes))
    drawn = np.random.default_rng(0).multinomial(len(scenes), share, size=RESAMPLED)
    counted = drawn[:, place[known]].astype(np.float64)
    ratios = (counted @ found[known]) / (counted @ before[known])
    low, high = np.percentile(ratios, [2.5, 97.5])
    mean = found[known].mean() / before[known].mean()
    return f"{found[known].mean():.4f} × {mean:.3f} ({low:.3f}–{high:.3f})"


@plot_style()
def draw(maps: Sequence[Floats], *frames: int) -> None:
    """Error by height and width of the rectangle, one panel for each set of frames."""
    figure = Figure(figsize=(9, 4), layout="constrained")
    titles = ("families to learn from", "families that judge")
    step = (SHARES[1] - SHARES[0]) / 2
    for axis, errors_, title, count in zip(
        figure.subplots(1, 2), maps, titles, frames, strict=True
    ):
        ends = (SHARES[0] - step, SHARES[-1] + step)
        shown = axis.imshow(errors_, origin="lower", extent=ends * 2, cmap="viridis_r")
        down, across = np.unravel_index(errors_.argmin(), errors_.shape)
        axis.plot(QUARTERS, QUARTERS, "k+", markersize=12, label="presets")
        axis.plot(SHARES[across], SHARES[down], "ko", fillstyle="none", label="least")
        axis.set(title=f"{title}, {count} frames", xlabel="half width / half angle")
        axis.set_ylabel("half height / half angle")
        axis.legend(loc="lower right")
        figure.colorbar(shown, ax=axis, label="mean AbsRel")
    figure.savefig(PICTURE, dpi=90)


if __name__ == "__main__":
    main()
