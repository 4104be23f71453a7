"""The budget as a figure: image, ranges, and the image's response to gratings."""

from collections.abc import Mapping
from dataclasses import replace
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from matplotlib.ticker import FuncFormatter, LogLocator, NullFormatter

from reconstruction.base.arrays import Floats
from spisim.budget.image import ImageBudget, image_budget
from spisim.budget.link import Target, bucket_link, spot_link
from spisim.budget.noise import SOURCES, NoiseBudget, bucket_noise, spot_noise
from spisim.budget.ranging import last_below, longest_range_m, range_sigma_m
from spisim.instrument import Instrument

MIN_DISTANCE_M, MAX_DISTANCE_M = 0.5, 30.0
REFLECTANCES: Mapping[float, str] = {0.2: "#1f5f8b", 0.5: "#d1762c", 0.8: "#3f8f4f"}
COLOURS = dict(
    zip(SOURCES, ("#f2b134", "#e4572e", "#a23b72", "#7a6c5d", "#3d5a80", "#98c1d9"), strict=True)
)
#: Axes of the maps.
MAP_REFLECTANCE = np.linspace(0.05, 1.0, 20)
MAP_ILLUMINANCE_KLX = np.geomspace(0.1, 120.0, 25)
IMAGE_SNR = 10.0


def budget_figure(instrument: Instrument, target: Target, name: str, limit_m: float) -> Figure:
    """SNR, range and noise by distance, maximum range by reflectance and daylight, gratings."""
    both = instrument.images and instrument.ranges
    figure = Figure(figsize=(19, 8.5 if both else 4.5), layout="constrained")
    light = f"{target.illuminance_klx:g} klx daylight"
    air = (
        ""
        if not target.extinction_per_m
        else f", fog with an extinction of {target.extinction_per_m:.3g} per metre"
    )
    figure.suptitle(f"{name}: {light}{air}", fontsize=13)
    distance = np.geomspace(MIN_DISTANCE_M, MAX_DISTANCE_M, 200)
    columns = 4 if both else 5 if instrument.images else 3
    panels = figure.subplots(2 if both else 1, columns, squeeze=False)
    marked: list[Axes] = []
    if instrument.images:
        snr, noise, longest, mtf = panels[0, :4]
        _image_panel(snr, instrument, target, distance)
        budget = bucket_noise(instrument, bucket_link(instrument, _at(target, distance)))
        _noise_panel(noise, distance, budget, "image: noise of one exposure")
        title = f"image: distance with SNR {IMAGE_SNR:g} per exposure"
        _map_panel(longest, _image_max_range(instrument, target), title)
        _grating_panels(mtf, panels[-1, -1], image_budget(instrument, target))
        marked += [snr, noise]
    if instrument.ranges:
        sigma, noise, longest = panels[-1, :3]
        _range_panel(sigma, instrument, target, distance, limit_m)
        budget = spot_noise(instrument, spot_link(instrument, _at(target, distance)))
        reading = instrument.ranging.tof.reading.name
        _noise_panel(noise, distance, budget, f"spots: noise of one {reading}")
        title = f"spots: distance with σ of range {100 * limit_m:g} cm"
        _map_panel(longest, _ranging_max_range(instrument, target, limit_m), title)
        marked += [sigma, noise]
    for axes in marked:
        axes.axvline(float(target.distance_m), color="0.5", lw=1, ls=":")
    return figure


def _at(target: Target, distance: Floats) -> Target:
    return replace(target, distance_m=distance)


def _grating_panels(mtf: Axes, contrast: Axes, budget: ImageBudget) -> None:
    for name, each, style in (("across", budget.across, "-"), ("down", budget.down, "--")):
        mtf.plot(each.cycles, each.mtf, style, label=name)
        contrast.plot(each.cycles, 100 * each.contrast, style, label=name)
    mtf.set(title="image: MTF of the patterns", ylabel="MTF", ylim=(0, 1.02))
    contrast.set(
        title="image: faintest grating seen", ylabel="contrast, %", yscale="log", ylim=(0.1, 100)
    )
    for axes in (mtf, contrast):
        axes.set_xlabel("periods across the field")
        axes.grid(alpha=0.25)
        axes.legend(frameon=False)


def distance_axis(axes: Axes, nearest_m: float, farthest_m: float) -> None:
    """Logarithmic axis of distances with plain numbers."""
    axes.set_xscale("log")
    axes.set_xlim(nearest_m, farthest_m)
    axes.xaxis.set_major_locator(LogLocator(subs=(1, 2, 5)))
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    axes.xaxis.set_minor_formatter(NullFormatter())
    axes.set_xlabel("distance, m")
    axes.grid(alpha=0.25)


def _image_panel(axes: Axes, instrument: Instrument, target: Target, distance: Floats) -> None:
    for reflectance, colour in REFLECTANCES.items():
        budget = bucket_noise(
            instrument, bucket_link(instrument, _with(target, distance, reflectance))
        )
        axes.plot(distance, budget.snr, color=colour, label=f"reflectance {reflectance:g}")
    axes.axhline(1, color="0.3", lw=1)
    axes.set(title="image: SNR of one exposure, all pixels on", ylabel="SNR", yscale="log")
    distance_axis(axes, MIN_DISTANCE_M, MAX_DISTANCE_M)
    axes.legend(frameon=False)


def _range_panel(
    axes: Axes, instrument: Instrument, target: Target, distance: Floats, limit_m: float
) -> None:
    for reflectance, colour in REFLECTANCES.items():
        sigma = range_sigma_m(instrument, _with(target, distance, reflectance)).max(axis=-1)
        finite = np.where(np.isfinite(sigma), 100 * sigma, np.nan)
        axes.plot(distance, finite, color=colour, label=f"reflectance {reflectance:g}")
    axes.axhline(100 * limit_m, color="0.3", lw=1)
    axes.set(
        title=f"spots: σ of range, {instrument.ranging.tof.method}", ylabel="σ, cm", yscale="log"
    )
    axes.set_ylim(1e-2, 1e3)
    distance_axis(axes, MIN_DISTANCE_M, MAX_DISTANCE_M)
    axes.legend(frameon=False)


def _noise_panel(axes: Axes, distance: Floats, budget: NoiseBudget, title: str) -> None:
    """Stacked fractions of the variance."""
    worst = {k: v if v.ndim == 1 else v.mean(axis=-1) for k, v in budget.variances.items()}
    total = sum(worst.values())
    fractions = [100 * variance / total for variance in worst.values()]
    axes.stackplot(
        distance, fractions, labels=list(worst), colors=[COLOURS[source] for source in worst]
    )
    axes.set(title=title, ylabel="fraction of the variance, %", ylim=(0, 100))
    distance_axis(axes, MIN_DISTANCE_M, MAX_DISTANCE_M)
    handles, labels = axes.get_legend_handles_labels()
    axes.legend(handles[::-1], labels[::-1], loc="lower right", fontsize=8, framealpha=0.9)


def _image_max_range(instrument: Instrument, target: Target) -> Floats:
    distance = np.geomspace(MIN_DISTANCE_M, 10 * MAX_DISTANCE_M, 80)
    grid = Target(
        distance,
        MAP_REFLECTANCE[:, None, None],
        MAP_ILLUMINANCE_KLX[:, None],
        target.extinction_per_m,
    )
    noise = bucket_noise(instrument, bucket_link(instrument, grid))
    return last_below(distance, 1 / np.maximum(noise.snr, 1e-300), 1 / IMAGE_SNR)


def _ranging_max_range(instrument: Instrument, target: Target, limit_m: float) -> Floats:
    return np.array(
        [
            longest_range_m(
                instrument,
                limit_m,
                reflectance=reflectance,
                illuminance_klx=MAP_ILLUMINANCE_KLX,
                extinction_per_m=float(target.extinction_per_m),
            )
            for reflectance in MAP_REFLECTANCE
        ]
    )


def _map_panel(axes: Axes, longest: Floats, title: str) -> None:
    axes.set(title=title, xlabel="daylight, klx", ylabel="reflectance", xscale="log")
    axes.xaxis.set_major_formatter(FuncFormatter(lambda value, _: f"{value:g}"))
    positive = np.where(longest > 0, longest, np.nan)
    picture = axes.pcolormesh(
        MAP_ILLUMINANCE_KLX, MAP_REFLECTANCE, positive, cmap="viridis", shading="gouraud"
    )
    if np.isfinite(positive).any() and np.nanmax(positive) > 1.05 * np.nanmin(positive):
        lines: Any = axes.contour(
            MAP_ILLUMINANCE_KLX, MAP_REFLECTANCE, positive, colors="white", linewidths=0.8
        )
        axes.clabel(lines, fmt="%g m", fontsize=8)
    axes.figure.colorbar(picture, ax=axes, label="m")


def _with(target: Target, distance: Floats, reflectance: float) -> Target:
    return Target(distance, reflectance, target.illuminance_klx, target.extinction_per_m)
