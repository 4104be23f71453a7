"""What the same instrument records of the same scene at 850, 905, 940, 1460 and 1550 nm.

    python benchmarks/wavelengths.py [--quick] [--json] [--markdown]

The paper's instrument, moved to each wavelength, in the warehouse: with lasers of one power, and
with as much as laser class 1 allows at each. Detectors keep their quantum efficiency, LEDs their
power. What is promised is checked before a wall in sunlight, where closed forms hold. `--markdown`
pastes the tables into docs/results/weather.md.
"""

import sys
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
import trimesh
from options import benchmark_options, finish

from reconstruction import evaluate, reconstruct
from reconstruction.base.arrays import Floats
from reconstruction.ranging import measure_ranges
from spisim.atmosphere import CLEAR, fog
from spisim.budget import Target, class_1_power_w, range_sigma_m
from spisim.budget.wavelengths import WAVELENGTHS_NM
from spisim.instrument import Instrument, load_instrument
from spisim.scene import Ambient, Material, Scene, SceneObject, in_band_irradiance, load_scene
from spisim.simulation.light import LightSequence, Transport, solve, trace
from spisim.simulation.measurement import record, spot_light
from spisim.simulation.measurement.light import background_electrons
from spisim.transport import Outputs, ground_truth
from spisim_paper.checks import Check, Table, surroundings

PAGE = Path(__file__).parents[1] / "docs" / "results" / "weather.md"
#: Sections of the warehouse that are changed, by what they stand for.
WEATHERS: dict[str, dict[str, Any]] = {
    "fog (moderate radiation), 200 m": {
        "fog": {"visibility_m": 200, "kind": "moderate-radiation"},
    },
    "haze (haze-l), 500 m": {"fog": {"visibility_m": 500, "kind": "haze-l"}},
    "rain, 10 mm/h": {"fog": None, "rain": {"rate_mm_per_h": 10}},
}
WALL_M, REFLECTANCE, SUN_KLX = 2.0, 0.5, 100.0
HAZE_M = 50.0  # visibility before the wall, for a fall of the light that is easily told
REFERENCE_NM = 1550


@dataclass(frozen=True)
class Seen:
    """One recording."""

    laser_w: float
    sigmas_m: Floats  # of the spots that are seen
    depth_error_m: float | None


@dataclass(frozen=True)
class Row:
    """The scene at one wavelength."""

    extinction_per_m: float
    signal_electrons: float  # of an exposure with all pixels on
    sky_electrons: float
    correlation: float | None
    biases_m: Floats  # of the spots, without noise
    same_power: Seen
    class_1: Seen


def main() -> int:
    """Measure and print; the exit status is 1 if a promise is broken."""
    options = benchmark_options(__doc__, "rougher, in less than a minute", PAGE)
    spp, frames = (8, 400) if options.quick else (128, 4000)
    weathers = dict(list(WEATHERS.items())[: 1 if options.quick else None])

    around = surroundings(("spisim", "mitsuba", "drjit", "numpy"))
    instruments = {nm: load_instrument("paper").at_wavelength(nm) for nm in WAVELENGTHS_NM}
    tables = [
        weather_table(
            weather, {nm: warehouse(one, changes, spp) for nm, one in instruments.items()}
        )
        for weather, changes in weathers.items()
    ]
    checks = [*media_checks(), *light_checks(instruments), sigma_check(instruments, frames)]
    return finish(options, PAGE, "wavelengths", around, tables, checks)


def at_class_1(instrument: Instrument) -> Instrument:
    """With as much laser power as class 1 allows."""
    return instrument.with_laser_power(class_1_power_w(instrument))


# In the warehouse


def warehouse(instrument: Instrument, changes: dict[str, Any], spp: int) -> Row:
    """The light is traced once for both powers of the lasers."""
    print(f"{instrument.wavelength_nm:g} nm, {changes}", file=sys.stderr)
    scene = load_scene("warehouse", changes, wavelength_nm=instrument.wavelength_nm)
    truth = ground_truth(scene, instrument)
    light = trace(
        scene, instrument, frames=1, spp=spp, transport_noise_share=None, seed=0, progress=None
    )
    dark = float(background_electrons(instrument, 0.0))
    daylight_w = light.transports[0].daylight_w

    def recorded(one: Instrument, noise: bool) -> Any:
        capture = record(scene, one, light, [truth], seed=0, noise=noise)
        assert capture.truth is not None
        result = reconstruct(capture)
        return capture, result, evaluate(result, capture.truth)

    def seen(one: Instrument) -> Seen:
        _, result, metrics = recorded(one, noise=True)
        depth = (metrics["depth"] or {}).get("anchored", {})
        sigmas_m = result.ranges.sigma_m[result.ranges.valid]
        return Seen(one.lasers.power_w, sigmas_m, depth.get("mae_m"))

    ideal, _, metrics = recorded(instrument, noise=False)
    _, _, noisy = recorded(instrument, noise=True)
    return Row(
        extinction_per_m=scene.atmosphere.extinction_per_m,
        signal_electrons=float(ideal.truth.image.sum()),
        sky_electrons=float(background_electrons(instrument, daylight_w)) - dark,
        correlation=noisy["image"]["correlation"],
        biases_m=np.array([spot["error_m"] for spot in metrics["spots"]]),
        same_power=seen(instrument),
        class_1=seen(at_class_1(instrument)),
    )


def weather_table(weather: str, rows: dict[int, Row]) -> Table:
    """One row per wavelength."""
    power_mw = 1e3 * next(iter(rows.values())).same_power.laser_w
    columns = (
        "nm",
        "extinction, 1/m",
        "image, electrons",
        "sky, electrons",
        "image correlation",
        f"σ at {power_mw:g} mW, mm",
        "class 1, mW",
        "σ at class 1, mm",
        "bias, cm",
        "depth error, m",
        "at class 1",
    )
    cells = [
        (
            f"{nm}",
            f"{row.extinction_per_m:.4f}",
            f"{row.signal_electrons:.3g}",
            f"{row.sky_electrons:.3g}",
            _reported(row.correlation),
            _scatter(row.same_power),
            f"{1e3 * row.class_1.laser_w:.2f}",
            _scatter(row.class_1),
            f"{100 * row.biases_m.min():+.1f} to {100 * row.biases_m.max():+.1f}",
            _reported(row.same_power.depth_error_m),
            _reported(row.class_1.depth_error_m),
        )
        for nm, row in rows.items()
    ]
    title = (
        f"Warehouse in {weather}: electrons of one exposure with all pixels on and of the "
        "skylight; σ the rms of the ranges', of those spots that are seen; bias theirs without "
        "noise, from spot to spot; depth error the mean absolute one of the map."
    )
    return Table(title, columns, cells)


def _scatter(seen: Seen) -> str:
    if not seen.sigmas_m.size:
        return "no spot seen"
    missing = "" if seen.sigmas_m.size == 4 else f" ({seen.sigmas_m.size} of 4)"
    return f"{1e3 * np.sqrt(np.mean(seen.sigmas_m**2)):.0f}{missing}"


def _reported(value: float | None) -> str:
    return "–" if value is None else f"{value:.2f}"


# Before a wall


def wall(wavelength_nm: float) -> Scene:
    """A sunlit wall across the optical axis, the same at every wavelength, in clear air."""
    side = 60.0
    corners = [[-side, -side, WALL_M], [side, -side, WALL_M], [side, side, WALL_M]]
    mesh = trimesh.Trimesh([*corners, [-side, side, WALL_M]], [[0, 1, 2], [0, 2, 3]])
    thing = SceneObject("wall", mesh, Material("wall", REFLECTANCE, "chosen"))
    ambient = Ambient(sun_klx=SUN_KLX, sun_direction=(0.0, 0.0, 1.0))
    return Scene("wall", (thing,), CLEAR, ambient, np.eye(4), wavelength_nm=float(wavelength_nm))


def media_checks() -> list[Check]:
    """1550 nm sees no further through fog than 905 nm, but through haze."""
    ratios = {
        kind: fog(200, kind).extinction_per_m / fog(200, kind, wavelength_nm=905).extinction_per_m
        for kind in ("moderate-radiation", "haze-l")
    }
    return [
        Check("fog_1550_over_905", ratios["moderate-radiation"], 1.0, at_least=True),
        Check("haze_1550_over_905", ratios["haze-l"], 1.0),
    ]


def light_checks(instruments: dict[int, Instrument]) -> list[Check]:
    """Sunlight by the spectrum, and Beer's law for light that nothing scattered."""
    sun: dict[int, float] = {}
    straight: dict[int, Floats] = {}
    extinction: dict[int, float] = {}
    for nm, instrument in instruments.items():
        sun[nm] = solve(wall(nm), instrument, spp=1, seed=0).daylight_w
        haze = fog(HAZE_M, "haze-l", wavelength_nm=nm)
        hazy = replace(wall(nm), atmosphere=haze)
        light = solve(hazy, instrument, spp=16, seed=0, outputs=Outputs(orders=True))
        straight[nm] = light.extra["spot_orders"][0].sum(axis=-1)
        extinction[nm] = haze.extinction_per_m
    here = instruments[REFERENCE_NM]
    path_m = 2 * WALL_M / here.lasers.directions[:, 2]  # and back, the detector being close
    spectrum = {
        nm: in_band_irradiance(1, one.filter.band_nm) / in_band_irradiance(1, here.filter.band_nm)
        for nm, one in instruments.items()
    }
    beer = {nm: np.exp(-(extinction[nm] - extinction[REFERENCE_NM]) * path_m) for nm in instruments}
    sun_off = [sun[nm] / sun[REFERENCE_NM] / spectrum[nm] - 1 for nm in instruments]
    light_off = [straight[nm] / straight[REFERENCE_NM] / beer[nm] - 1 for nm in instruments]
    return [
        Check("sun_against_spectrum", float(np.abs(sun_off).max()), 1e-4),
        Check("straight_light_against_beer", float(np.abs(light_off).max()), 0.01),
    ]


def sigma_check(instruments: dict[int, Instrument], frames: int) -> Check:
    """Scatter of many ranges against the closed form, at every wavelength and both powers."""
    z = []
    for nm, instrument in instruments.items():
        light = solve(wall(nm), instrument, spp=64, seed=0)
        z += [scatter_z(one, light, frames) for one in (instrument, at_class_1(instrument))]
    return Check("largest_z_range_sigma", float(np.abs(z).max()), 3)


def scatter_z(instrument: Instrument, light: Transport, frames: int) -> float:
    """Standard errors between the variance of the ranges, mean of four spots, and the budget's."""
    still = LightSequence(np.zeros(1), (light,))
    spots = instrument.tof.record(
        spot_light(instrument, still, frames),
        instrument.lasers.directions,
        np.random.default_rng(0),
    )
    ranges = np.array([measure_ranges(spots, frame).range_m for frame in range(frames)])
    expected = range_sigma_m(instrument, Target(WALL_M, REFLECTANCE, SUN_KLX))
    ratio = np.mean(ranges.var(axis=0, ddof=1) / expected**2)
    return float((ratio - 1) / np.sqrt(2 / (frames - 1) / ranges.shape[1]))


if __name__ == "__main__":
    sys.exit(main())
