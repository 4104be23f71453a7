"""The four laser spots over path length, light or arrivals, as vector drawings."""

from dataclasses import dataclass
from typing import Any, Protocol

import numpy as np
from numpy.typing import NDArray
from scipy.constants import c

from reconstruction.capture.readings.dtof import HistogramSpots

Floats = NDArray[np.float64]

WIDTH, HEIGHT = 960, 280
LEFT, RIGHT, TOP, BOTTOM = 70, 10, 10, 44
DECADES = 6  # of light shown below the highest value


class SpotHistograms(Protocol):
    """What the plot needs of a transport result."""

    @property
    def spot_histogram(self) -> Floats:
        """Fraction of each laser's power per bin of path length (4, bins)."""

    @property
    def path_length_m(self) -> Floats:
        """Path length of each bin (bins,), evenly spaced from 0."""


@dataclass(frozen=True)
class _Axes:
    """From path length and decimal exponent to the drawing's coordinates."""

    far_m: float
    top: int
    decades: int

    def x(self, length_m: Any) -> Any:
        return LEFT + (WIDTH - LEFT - RIGHT) * length_m / self.far_m

    def y(self, exponent: Any) -> Any:
        return TOP + (HEIGHT - TOP - BOTTOM) * (self.top - exponent) / self.decades


def spot_plot(transport: SpotHistograms, true_length_m: Floats | None) -> str:
    """Draw the share of each laser's power per metre of path length, on a logarithmic scale.

    `true_length_m` (4,): the true way to each spot and back, marked by a dashed line.
    """
    bin_width_m = float(transport.path_length_m[1])
    density = np.asarray(transport.spot_histogram, float) / bin_width_m
    lit = np.flatnonzero(density.max(axis=0) > 0)
    if lit.size == 0:
        return ""
    bins = _bins_to_show(int(lit[-1]) + 1, bin_width_m, true_length_m)
    density = density[:, :bins]
    axes = _Axes(bins * bin_width_m, int(np.ceil(np.log10(density.max()))), DECADES)
    return _drawing(axes, density, true_length_m, "share of power per m")


def arrival_plot(spots: HistogramSpots, frame: int, true_length_m: Floats | None) -> str:
    """Draw the arrivals in each time bin as recorded, over the path that the time stands for.

    The first bin is drawn at its own path, and nothing before it; `true_length_m` as `spot_plot`.
    """
    metres_per_bin = c * spots.bin_width_s
    ahead = round((spots.start_s - spots.delay_offset_s) / spots.bin_width_s)
    counts = np.asarray(spots.counts[frame], float)
    counts = np.pad(counts, ((0, 0), (max(ahead, 0), 0)))[:, max(-ahead, 0) :]
    if counts.size == 0 or counts.max() <= 0:
        return ""
    top = max(int(np.ceil(np.log10(counts.max()))), 1)
    axes = _Axes(counts.shape[1] * metres_per_bin, top, top + 1)
    return _drawing(axes, counts, true_length_m, "arrivals per bin")


def _drawing(axes: _Axes, values: Floats, true_length_m: Floats | None, title: str) -> str:
    """Curves (4, bins) in their axes."""
    drawing = _grid(axes, title) + _curves(axes, values)
    if true_length_m is not None:
        drawing += _marks(axes, true_length_m)
    return f'<svg viewBox="0 0 {WIDTH} {HEIGHT}" role="img">{drawing}</svg>'


def _bins_to_show(lit: int, bin_width_m: float, true_length_m: Floats | None) -> int:
    """All lit bins, but not much more than the way to the farthest spot."""
    if true_length_m is None or not np.isfinite(true_length_m).any():
        return lit
    return min(lit, int(1.25 * np.nanmax(true_length_m) / bin_width_m) + 1)


def _grid(axes: _Axes, title: str) -> str:
    """Lines, numbers and names of both axes."""
    base = HEIGHT - BOTTOM
    parts = [
        f'<path class="axis" d="M{LEFT} {axes.y(e):.1f}H{WIDTH - RIGHT}"/>'
        f'<text x="{LEFT - 8}" y="{axes.y(e) + 4:.1f}" text-anchor="end">10{_superscript(e)}</text>'
        for e in range(axes.top, axes.top - axes.decades - 1, -2 if axes.decades > 4 else -1)
    ]
    parts += [
        f'<text x="{axes.x(m):.1f}" y="{base + 18}" text-anchor="middle">{m:g}</text>'
        for m in _round_steps(axes.far_m)
    ]
    parts += [
        f'<text x="{(WIDTH + LEFT) / 2}" y="{HEIGHT - 4}" text-anchor="middle">'
        "path length, m</text>",
        f'<text transform="translate(14 {base / 2}) rotate(-90)" text-anchor="middle">'
        f"{title}</text>",
    ]
    return "".join(parts)


def _curves(axes: _Axes, density: Floats) -> str:
    """One line per spot; what is darker than the scale runs along its foot."""
    bins = density.shape[1]
    across = axes.x((np.arange(bins)) * axes.far_m / bins)
    parts = []
    for k, row in enumerate(density):
        down = axes.y(np.log10(np.maximum(row, 10.0 ** (axes.top - axes.decades))))
        points = " ".join(f"{x:.1f},{y:.1f}" for x, y in zip(across, down, strict=True))
        parts.append(
            f'<polyline class="curve" stroke="var(--spot-{k})" points="{points}">'
            f"<title>spot {k}</title></polyline>"
        )
    return "".join(parts)


def _marks(axes: _Axes, true_length_m: Floats) -> str:
    """Dashed lines at the true path lengths."""
    return "".join(
        f'<path class="truth" stroke="var(--spot-{k})" '
        f'd="M{axes.x(way):.1f} {TOP}V{HEIGHT - BOTTOM}"/>'
        for k, way in enumerate(true_length_m)
        if np.isfinite(way)
    )


def _round_steps(far: float) -> Floats:
    """Round numbers from 0 to `far`, about eight of them."""
    rough = far / 8
    unit = 10.0 ** np.floor(np.log10(rough))
    step = unit * next(n for n in (1, 2, 5, 10) if n * unit >= rough)
    return np.arange(0, far, step)


def _superscript(number: int) -> str:
    return str(number).translate(str.maketrans("-0123456789", "⁻⁰¹²³⁴⁵⁶⁷⁸⁹"))
