"""Draw the picture of docs/theory/weather.md and print its figures.

`python tools/precipitation_plot.py`, from the top folder; takes two minutes.
"""

from dataclasses import replace
from pathlib import Path

import matplotlib.pyplot as plt
import numpy as np

import spisim
from spisim.atmosphere import CLEAR
from spisim.atmosphere.precipitation import rain, snow
from spisim.atmosphere.structure import Structure
from spisim.simulation.drops import falling_drops
from spisim.simulation.light import trace
from spisim.simulation.measurement import bucket_light, spot_light
from spisim.transport import ground_truth

PICTURE = Path(__file__).parents[1] / "docs" / "images" / "precipitation.png"
FRAMES, SEED = 8, 3
WEATHERS = {"rain, 5 mm/h": rain(5), "rain, 50 mm/h": rain(50), "snow, 2.5 mm/h": snow(2.5)}


def main() -> None:
    """Readings and spots of the warehouse in rain and snow, and a bank of fog."""
    figure, axes = plt.subplots(
        2, 2, figsize=(11, 6.4), layout="constrained", height_ratios=(1.6, 1)
    )
    instrument = spisim.load_instrument("paper")
    scene = replace(spisim.load_scene("warehouse"), atmosphere=CLEAR)
    truth = ground_truth(scene, instrument)
    light = trace(
        scene, instrument, frames=1, spp=64, transport_noise_share=None, seed=0, progress=None
    )
    dry = bucket_light(instrument, light, 1).buckets
    lit = instrument.pattern_plan.polarity > 0  # all but the dark exposure
    shot = 100 / np.sqrt(dry[0, lit].mean())
    spots = spot_light(instrument, light, 1).echo_per_s.sum(axis=-1)
    for name, weather in WEATHERS.items():
        drops = falling_drops(
            replace(scene, precipitation=(weather,)),
            instrument,
            [truth],
            FRAMES,
            np.random.default_rng(SEED),
        )
        wet = bucket_light(instrument, light, FRAMES, drops).buckets
        change = 100 * (wet / dry - 1)[:, lit]
        between = change.std(axis=0, ddof=1)
        print(
            f"{name}: loss {-change.mean():.2f} %, flicker between frames "
            f"{np.sqrt(np.mean(between**2)):.3f} %, within a frame "
            f"{change.std(axis=1, ddof=1).mean():.3f} %, shot noise {shot:.3f} %"
        )
        times_ms = 1e3 * drops[0].times_s[0, lit]
        (line,) = axes[0, 0].plot(times_ms, change[0], lw=1, label=name)
        light_of_spots = spot_light(instrument, light, FRAMES, drops)
        echo = light_of_spots.echo_per_s.sum(axis=-1) / spots
        frames = np.arange(FRAMES) + 1
        axes[0, 1].plot(frames, 100 * (echo - 1), "o-", color=line.get_color(), ms=3, lw=0.7)
        print(f"{name}: spots {100 * (echo - 1).mean():.2f} % ± {100 * echo.std():.2f} %")
    axes[0, 0].axhspan(-shot, shot, color="0.85", zorder=0, label="shot noise")
    axes[0, 0].set(xlabel="time in the frame (ms)", ylabel="change of a bucket reading (%)")
    axes[0, 0].legend(fontsize=8, ncols=2, loc="lower left", bbox_to_anchor=(0, 1.0))
    axes[0, 1].set(xlabel="frame", ylabel="change of a spot's light (%)")
    axes[0, 1].set_title("The four spots, pencils of light (colours as left)")

    fog = Structure(
        contrast=0.8,
        correlation_length_m=1.0,
        wind_m_s=(2.0, 0.0, 0.0),
        layer={"top_m": 2.5, "edge_m": 0.4},
        seed=1,
    )
    box = np.diag([12.0, 4.0, 4.0, 1.0])
    for axis, time_s in zip(axes[1], (0.0, 1.0), strict=True):
        density = fog.density(box, time_s)
        middle = density[:, density.shape[1] // 2]
        drawn = axis.imshow(
            middle, origin="lower", extent=(0, 12, 0, 4), vmin=0, vmax=5, aspect="auto"
        )
        axis.set(xlabel="x (m)", ylabel="z (m)", title=f"Ground fog after {time_s:g} s")
        figure.colorbar(drawn, ax=axis, label="density over its mean")
    figure.savefig(PICTURE, dpi=110)


if __name__ == "__main__":
    main()
