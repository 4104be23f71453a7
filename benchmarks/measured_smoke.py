"""Smoke of a fog machine in a tunnel, attenuation against visibility at four wavelengths.

Visibility is by the transmission of a laser at 532 nm. Its definition is not stated beside the
data, but where their authors draw laws of attenuation into the same plots they put 13.0 dB over the
visibility, which is a contrast of 5 %: the meteorological optical range.
"""

import csv
from pathlib import Path

import numpy as np
from intervals import of_size
from matplotlib.figure import Figure
from measured_figures import Comparison, MeasuredSet

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere import Particles, fog
from spisim.atmosphere.droplets import COAGULATED_SIGMA_G, LogNormalSizes
from spisim.atmosphere.medium import DB_PER_NEPER
from spisim.atmosphere.visibility import CONTRAST_THRESHOLDS
from spisim_paper.checks import Check, Interval, Table, percent

FILE, PREFIX = "attenuation.csv", "db_per_km_"
KIND, DEFINITION = "fog-machine", "mor"
LONG_NM, SHORT_NM, LASER_NM, VISUAL_NM = 1550, 1270, 532, 550
#: Of the readings off plots, ± 1.5 dB/km of 95 %.
READING_SIGMA_DB_PER_KM = 0.75
RATIOS, MAX_DEVIATION = (0.62, 0.71), 0.25
REACH_M = (40.0, 100.0)
DRAWN = 4000
#: Widths of the size distribution: of one record of the machine, of coagulation, and a wide smoke.
WIDTHS = (1.19, COAGULATED_SIGMA_G, 1.5)
SPREAD = (*((width, "fog-fluid") for width in WIDTHS), (COAGULATED_SIGMA_G, "glycol"))
MEDIAN_UM = 0.8524


def compare(folder: Path, quick: bool) -> Comparison:
    """Attenuation and its ratio between wavelengths beside the tunnel's."""
    visibility_m, measured = read(folder / FILE)
    predicted = {nm: attenuation(visibility_m, nm) for nm in measured}
    ratio = float((predicted[LONG_NM] / predicted[SHORT_NM])[0])
    checks = [
        Check(f"{KIND}, {LONG_NM} over {SHORT_NM} nm, at least", ratio, RATIOS[0], at_least=True),
        Check(f"{KIND}, {LONG_NM} over {SHORT_NM} nm, at most", ratio, RATIOS[1]),
        *_deviations(visibility_m, measured, predicted),
    ]
    tables = [
        _table(visibility_m, measured, predicted),
        _definitions(visibility_m, measured[LONG_NM]),
        _widths(visibility_m, measured),
        Table(_explained(measured)),
    ]
    compared = (
        f"Attenuation by `{KIND}` at the tunnel's visibility, by a contrast of 5 %, beside that "
        "measured at four wavelengths"
    )
    return Comparison(compared, checks, tables, _picture(visibility_m, measured))


def read(path: Path) -> tuple[Floats, dict[int, Floats]]:
    """Visibility in metres, and attenuation in dB/km by wavelength in nm."""
    try:
        with path.open(encoding="utf-8", newline="") as file:
            rows = list(csv.DictReader(file))
        columns = {name: np.array([float(row[name]) for row in rows]) for name in rows[0]}
        visibility_m = columns.pop("visibility_m")
        measured = {int(name.removeprefix(PREFIX)): one for name, one in columns.items()}
    except (OSError, ValueError, TypeError, KeyError, IndexError) as error:
        raise InputError(f"{path.name} is no table of attenuation by visibility: {error}") from None
    if not {LONG_NM, SHORT_NM} <= set(measured) or not all(
        (one > 0).all() for one in columns.values()
    ):
        raise InputError(f"{path.name}: needs positive {PREFIX}{LONG_NM} and {PREFIX}{SHORT_NM}")
    return visibility_m, measured


def attenuation(
    visibility_m: Floats,
    wavelength_nm: int,
    kind: str | Particles = KIND,
    definition: str = DEFINITION,
) -> Floats:
    """Of smoke, dB/km; it goes with the inverse visibility."""
    medium = fog(1.0, kind, definition, wavelength_nm=wavelength_nm)
    return np.asarray(1e3 * DB_PER_NEPER * medium.extinction_per_m / visibility_m)


def _deviations(
    visibility_m: Floats, measured: dict[int, Floats], predicted: dict[int, Floats]
) -> list[Check]:
    """Mean deviation at the longest wavelength, and the largest at that and at any."""
    rng = np.random.default_rng(0)
    near = (visibility_m >= REACH_M[0]) & (visibility_m <= REACH_M[1])
    reach = f"of dB/km, {REACH_M[0]:g} to {REACH_M[1]:g} m"
    here, drawn = {}, {}
    for nm, one in measured.items():
        read_off = one + rng.normal(0, READING_SIGMA_DB_PER_KM, (DRAWN, one.size))
        here[nm] = (predicted[nm] / one - 1)[near]
        drawn[nm] = (predicted[nm] / read_off - 1)[:, near]
    mean = float(here[LONG_NM].mean())
    largest = float(np.abs(here[LONG_NM]).max())
    at_any = max(float(np.abs(one).max()) for one in here.values())
    of_any = np.max([np.abs(one).max(axis=1) for one in drawn.values()], axis=0)
    return [
        Check(f"{KIND}, {name} {reach}", value, MAX_DEVIATION, interval=interval)
        for name, value, interval in (
            (
                f"mean deviation at {LONG_NM} nm",
                abs(mean),
                of_size(_basic(mean, drawn[LONG_NM].mean(axis=1))),
            ),
            (
                f"largest deviation at {LONG_NM} nm",
                largest,
                _basic(largest, np.abs(drawn[LONG_NM]).max(axis=1)),
            ),
            ("largest deviation at any wavelength", at_any, _basic(at_any, of_any)),
        )
    ]


def _basic(value: float, drawn: Floats) -> Interval:
    """Basic interval of the bootstrap: noise alone makes the largest of several larger."""

    def interval(confidence: float) -> tuple[float, float]:
        low, high = np.quantile(drawn, [(1 - confidence) / 2, (1 + confidence) / 2])
        return float(2 * value - high), float(2 * value - low)

    return interval


def _machine(sigma_g: float, material: str = "fog-fluid") -> Particles:
    return Particles(LogNormalSizes.of_volume(MEDIAN_UM, sigma_g), material=material)


def _table(
    visibility_m: Floats, measured: dict[int, Floats], predicted: dict[int, Floats]
) -> Table:
    columns = ["visibility, m"]
    for nm in measured:
        columns += [f"{nm} nm, dB/km", f"{nm} nm, `{KIND}`"]
    rows = []
    for row, visibility in enumerate(visibility_m):
        cells = [f"{visibility:g}"]
        for nm, one in measured.items():
            cells += [f"{one[row]:g}", f"{predicted[nm][row]:.1f}"]
        cells.append(f"{measured[LONG_NM][row] / measured[SHORT_NM][row]:.3f}")
        rows.append(tuple(cells))
    title = "Smoke, attenuation in the tunnel and simulated:"
    return Table(title, (*columns, f"measured {LONG_NM} / {SHORT_NM}"), rows)


def _definitions(visibility_m: Floats, measured: Floats) -> Table:
    rows = []
    for name, contrast in CONTRAST_THRESHOLDS.items():
        ratios = attenuation(visibility_m, LONG_NM, definition=name) / measured
        rows.append(
            (f"`{name}`", f"{contrast:.0%}", f"{-np.log(contrast):.3f}", percent(ratios.mean() - 1))
        )
    at_laser, at_visual = (
        fog(1.0, KIND, DEFINITION, wavelength_nm=nm).extinction_per_m
        for nm in (LASER_NM, VISUAL_NM)
    )
    title = (
        f"Smoke, mean deviation at {LONG_NM} nm by the definition of visibility. The laser at "
        f"{LASER_NM} nm instead of {VISUAL_NM} nm makes {percent(at_visual / at_laser - 1)}."
    )
    columns = ("definition", "contrast left", "extinction times visibility", "simulated − measured")
    return Table(title, columns, rows)


def _widths(visibility_m: Floats, measured: dict[int, Floats]) -> Table:
    rows = []
    for sigma_g, material in SPREAD:
        machine = _machine(sigma_g, material)
        long, short = (attenuation(visibility_m, nm, machine) for nm in (LONG_NM, SHORT_NM))
        deviation = (long / measured[LONG_NM]).mean() - 1
        rows.append((f"{sigma_g:g}", material, f"{(long / short)[0]:.3f}", percent(deviation)))
    title = (
        f"Smoke, by the geometric standard deviation of sizes, volume median {MEDIAN_UM:g} "
        f"µm: one record of the machine has {WIDTHS[0]:g}, coagulation leads to {WIDTHS[1]:g}, "
        f"which `{KIND}` has."
    )
    columns = ("width", "droplets", f"{LONG_NM} / {SHORT_NM} nm", f"mean deviation at {LONG_NM} nm")
    return Table(title, columns, rows)


def _explained(measured: dict[int, Floats]) -> str:
    slope, offset = np.polyfit(measured[SHORT_NM], measured[LONG_NM], 1)
    return (
        f"The measured ratio rises as the smoke thins. A straight line through the attenuations at "
        f"{LONG_NM} and {SHORT_NM} nm has a slope of {slope:.3f} and {offset:.1f} dB/km at none, "
        f"{offset / 20:.2f} dB over the tunnel's 50 m: an offset of the link's power would do it. "
        f"The slope agrees with the narrow record of the machine, the ratios themselves with "
        f"`{KIND}`."
    )


def _picture(visibility_m: Floats, measured: dict[int, Floats]) -> Figure:
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    fine = np.geomspace(visibility_m.min() * 0.9, visibility_m.max() * 1.1, 100)
    for number, (nm, one) in enumerate(sorted(measured.items())):
        colour = f"C{number}"
        left.errorbar(
            visibility_m,
            one,
            2 * READING_SIGMA_DB_PER_KM,
            fmt="o",
            ms=4,
            color=colour,
            label=f"{nm} nm",
        )
        left.plot(fine, attenuation(fine, nm), color=colour)
        scaled = one / measured[SHORT_NM]
        right.plot(np.full_like(scaled, nm), scaled, "o", ms=4, color=colour)
    wavelengths = np.arange(SHORT_NM - 40, LONG_NM + 41, 10)
    for sigma_g, style in zip(WIDTHS, ("--", "-", ":"), strict=True):
        machine = _machine(sigma_g)
        here = [float(attenuation(np.ones(1), int(nm), machine)[0]) for nm in wavelengths]
        at_short = float(attenuation(np.ones(1), SHORT_NM, machine)[0])
        right.plot(wavelengths, np.divide(here, at_short), style, color="0.3", label=f"{sigma_g:g}")
    left.set(
        xlabel="visibility (5 %), m", ylabel="attenuation, dB/km", title="tunnel and fog-machine"
    )
    left.legend()
    right.set(
        xlabel="wavelength, nm", ylabel=f"over that at {SHORT_NM} nm", title="by width of sizes"
    )
    right.legend()
    return figure


SETS = (
    MeasuredSet(
        "smoke-tunnel",
        "IRNAS, tunnel of KORUZA, [fog experiment](https://github.com/IRNAS/irnas.github.io) "
        "(2016), read off plots; sizes by laser diffraction of the same year; no licence",
        compare,
    ),
)
