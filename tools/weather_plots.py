"""The plots of the page on weather: `python tools/weather_plots.py FOLDER`."""

import os
import sys
from pathlib import Path
from typing import Any

import matplotlib.pyplot as plt
import numpy as np
from scipy.optimize import brentq

from spisim.atmosphere import KINDS, all_extinctions, extinction_at_550nm, fog, rain, snow
from spisim.atmosphere.lookup import look_up
from spisim.atmosphere.mie import particle_optics
from spisim.atmosphere.report import typical_weather
from spisim.budget.wavelengths import WAVELENGTHS_NM, class_1_limits

#: Enough radii for extinction; what is drawn needs no smooth phase function.
RADII = 400
VISIBILITY_M = 100.0
NATURAL = ("heavy-advection", "moderate-advection", "heavy-radiation", "moderate-radiation")
HAZE_AND_SMOKE = ("haze-m", "haze-l", "haze-h", "fog-machine", "hazer", "flare", "soot", "biomass")
#: The yardstick of ranges: the light that comes straight back over this in clear air at 905 nm.
YARDSTICK_M, YARDSTICK_NM = 30.0, 905


def extinction_over_wavelength() -> Any:
    """Extinction relative to 550 nm: fog left, haze and smoke right, with empirical models."""
    wavelengths = np.arange(500.0, 1701, 50).tolist()
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.6), layout="constrained", sharex=True)
    for axis, kinds in zip(axes, (NATURAL, HAZE_AND_SMOKE), strict=True):
        for kind in kinds:
            optics = [particle_optics(KINDS[kind], nm, RADII) for nm in wavelengths]
            ratios = [one.extinction_m2 / look_up(KINDS[kind], 550).extinction_m2 for one in optics]
            axis.plot(wavelengths, ratios, label=kind)
        axis.axvline(1550, color="0.8", zorder=0)
        axis.set_xlabel("wavelength, nm")
    models = [all_extinctions(VISIBILITY_M, wavelength_nm=nm) for nm in wavelengths]
    visual = extinction_at_550nm(VISIBILITY_M)
    for name, style in (("kim", ":"), ("al-naboulsi-advection", "--"), ("ijaz-fog", "-.")):
        ratios = [one.get(name, np.nan) / visual for one in models]
        axes[0].plot(wavelengths, ratios, style, color="0.4", label=name)
    for kind, medium in (("rain", rain), ("wet snow", snow)):
        here = [medium(5.0, wavelength_nm=nm).extinction_per_m for nm in (550, *WAVELENGTHS_NM)]
        axes[1].plot(
            (550, *WAVELENGTHS_NM), np.divide(here, here[0]), "o", ms=4, label=f"{kind}, 5 mm/h"
        )
    axes[0].set(ylim=(0.7, 1.25), ylabel="extinction over that at 550 nm", title="fog")
    axes[1].set(ylim=(0, 1.25), title="haze, smoke, rain, snow")
    for axis in axes:
        axis.legend(fontsize=8, ncols=3, loc="upper center", bbox_to_anchor=(0.5, -0.15))
    return figure


def phase_functions() -> Any:
    """Phase functions at 1550 nm: all angles left, the last 10° right."""
    figure, axes = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    for kind in NATURAL:
        optics = look_up(KINDS[kind], 1550)
        for axis in axes:
            axis.semilogy(optics.angles_deg, optics.phase, label=kind)
    angles = np.linspace(0, 180, 1801)
    cos = np.cos(np.radians(angles))
    for form, style in (("hg", ":"), ("double-hg", "--")):
        density = fog(50, "heavy-advection", phase=form).phase.density(cos)
        for axis in axes:
            axis.semilogy(angles, density, style, color="0.3", label=f"heavy-advection, {form}")
    drops = rain(10).phase.density(cos)
    axes[0].semilogy(angles, drops, color="tab:cyan", label="rain, 10 mm/h, no diffraction")
    axes[0].set(xlim=(0, 180), ylim=(1e-3, 1e3), ylabel="phase function, 1/sr")
    axes[1].set(xlim=(170, 180), ylim=(2e-3, 8e-2))
    axes[1].set_yticks((0.002, 0.005, 0.01, 0.02, 0.05))
    axes[1].yaxis.set_major_formatter("{x:g}")
    axes[1].yaxis.set_minor_formatter("")
    for axis in axes:
        axis.set_xlabel("scattering angle, degrees")
    axes[0].legend(fontsize=8)
    return figure


def what_a_wavelength_buys() -> Any:
    """Extinction over that at 1550 nm, and how far class 1 of each wavelength reaches."""
    by_wavelength = {nm: typical_weather(nm) for nm in WAVELENGTHS_NM}
    names = list(by_wavelength[1550])
    rows = np.arange(len(names))
    figure, axes = plt.subplots(1, 2, figsize=(10, 4.5), layout="constrained", sharey=True)
    for offset, (nm, weather) in zip(np.linspace(-0.3, 0.3, 5), by_wavelength.items(), strict=True):
        extinction = np.array([weather[name].extinction_per_m for name in names])
        at_1550 = [by_wavelength[1550][name].extinction_per_m for name in names]
        axes[0].plot(extinction / at_1550, rows + offset, "o", ms=5, label=f"{nm} nm")
        axes[1].plot([max_range_m(nm, one) for one in extinction], rows + offset, "o", ms=5)
    axes[0].axvline(1, color="0.8", zorder=0)
    axes[0].set(xscale="log", xlabel="extinction over that at 1550 nm")
    axes[0].set_xticks((0.9, 1, 1.5, 2, 3, 4, 5))
    axes[0].set_yticks(rows, names)
    axes[0].invert_yaxis()
    axes[0].legend(fontsize=8)
    axes[1].set(xscale="log", xlabel="range of the same echo with class 1 power, m")
    axes[1].set_xticks((5, 10, 20, 30, 50, 100))
    for axis in axes:
        axis.xaxis.set_major_formatter("{x:g}")
        axis.xaxis.set_minor_formatter("")
        axis.grid(axis="x", color="0.9")
        axis.set_axisbelow(True)
    return figure


def max_range_m(wavelength_nm: int, extinction_per_m: float) -> float:
    """Where as many photons come straight back as over the yardstick, with class 1 power."""

    def log_photons(power_w: float, nm: float, extinction: float, range_m: float) -> float:
        return float(np.log(power_w * nm) - 2 * extinction * range_m - 2 * np.log(range_m))

    wanted = log_photons(class_1_limits(YARDSTICK_NM)[0], YARDSTICK_NM, 0, YARDSTICK_M)
    power_w = class_1_limits(wavelength_nm)[0]
    return float(
        brentq(
            lambda z: log_photons(power_w, wavelength_nm, extinction_per_m, z) - wanted, 1e-2, 1e4
        )
    )


def main(folder: Path) -> None:
    """Draw them all."""
    figures = {
        "weather-extinction": extinction_over_wavelength,
        "weather-phase": phase_functions,
        "weather-wavelengths": what_a_wavelength_buys,
    }
    folder.mkdir(parents=True, exist_ok=True)
    for name, draw in figures.items():
        draw().savefig(folder / f"{name}.png", dpi=110)


if __name__ == "__main__":
    os.environ.setdefault("MIEPYTHON_USE_JIT", "1")  # read when miepython is loaded
    plt.switch_backend("Agg")
    main(Path(sys.argv[1]))
