"""Raindrops of a two-dimensional video disdrometer: are speeds and numbers as simulated?

Each line is one drop, with its diameter, its fall speed by two planes of light, and the area in
which such a drop is seen.
"""

import csv
import gzip
from dataclasses import dataclass
from pathlib import Path

import numpy as np
from intervals import of_figure, of_size
from matplotlib.figure import Figure
from measured_figures import Comparison, MeasuredSet
from numpy.typing import NDArray
from scipy.stats import norm

from reconstruction.base.arrays import Floats
from reconstruction.base.errors import InputError
from spisim.atmosphere.fall_speed import terminal_speed_m_s
from spisim.atmosphere.rain import RAINS
from spisim_paper.checks import Check, Table, percent

COLUMNS = ("time_s", "diameter_mm", "fall_speed_m_s", "measuring_area_mm2")
EDGES_MM = np.array([0.3, 0.4, 0.5, 0.65, 0.8, 1.0, 1.25, 1.5, 2.0, 3.0, 6.0])
#: Wide classes with enough drops for an interval.
WIDE_MM = ((1.0, 1.5), (1.5, 3.0))
#: Height of the site (ARM's Cloud, Aerosol and Complex Terrain Interactions, Villa Yacanto).
ALTITUDE_M = 1141.0
#: Diameter from which drops of this instrument follow the laboratory in calm air, that from which
#: its pixels cost less than 5 %, and these.
RESOLVED_MM, WHOLE_MM, PIXEL_MM = 0.7, 1.0, 0.17
#: Relative deviation beyond which a speed is that of two different drops.
MISMATCH = 0.4
#: Smaller ones are splashes and wrong pairs for the most part, the more the stronger the wind.
TINY_MM = 0.4
BLOCK_S = 60.0
MIN_DROPS = 20
EXPLAINED, CONFIDENCE = 0.05, 0.95
KIND = "marshall-palmer"


@dataclass(frozen=True, eq=False)
class Drops:
    """Single drops (n,), and the blocks of time that they fell in."""

    time_s: Floats
    diameter_mm: Floats
    fall_speed_m_s: Floats
    measuring_area_mm2: Floats

    @property
    def block(self) -> NDArray[np.intp]:
        """Number of each drop's block."""
        since_s = self.time_s - self.time_s.min()
        return np.asarray(since_s // BLOCK_S, dtype=np.intp)

    @property
    def ratio(self) -> Floats:
        """Fall speed over the law's at the site."""
        law = terminal_speed_m_s(self.diameter_mm, air_density_kg_m3(ALTITUDE_M))
        return self.fall_speed_m_s / law


def air_density_kg_m3(altitude_m: float) -> float:
    """Of the standard atmosphere (ISO 2533) up to 11 km."""
    warmth = 1 - 2.25577e-5 * altitude_m
    return float(1.225 * warmth**4.25588)


def compare(folder: Path, quick: bool) -> Comparison:
    """Fall speeds by class beside the law, and the slope of the number spectrum."""
    drops = read(folder)
    calm = calm_half(drops)
    slope = slopes(drops)
    speeds = _speed_table(drops, calm)
    unexplained = sum(row[-1] == "unexplained" for row in speeds.rows)
    checks = [
        Check("classes that deviate by more than 5 %, unexplained", unexplained, 0),
        *_speed_checks(drops, calm),
        _slope_check(slope),
    ]
    tables = [speeds, _slope_table(slope), Table(EXPLANATION)]
    compared = (
        "Fall speed by diameter beside the law in the site's air; slope of the number spectrum "
        f"beside `{KIND}` at the measured rate"
    )
    return Comparison(compared, checks, tables, _picture(drops, calm, slope))


EXPLANATION = (
    f"Below {WHOLE_MM:g} mm the deviation is the instrument's. Its pixels are {PIXEL_MM:g} mm "
    "wide, so that a drop of 0.5 mm is three of them; and drops that meet between the planes of"
    f" light are paired wrongly, which gives any speed: those beyond ± {MISMATCH:.0%} of the law"
    " are taken for such, as is usual (A. Kruger & W. F. Krajewski, J. Atmos. Ocean. Technol. "
    "19, 602 (2002)). In calm air such an instrument finds the laboratory's speeds from 0.7 mm "
    "on, and a finer one from 0.1 mm on (V. Bringi, M. Thurai & D. Baumgardner, Atmos. Meas. "
    f"Tech. 11, 1377 (2018)). From {WHOLE_MM:g} mm on the deviation is the air's: the law holds "
    "in the half of the blocks with few tiny drops, which are splashes and fragments for the "
    "most part, and not in the other, where all large drops are slow together. No wind was "
    "recorded beside them; wind and turbulence slow drops of 2 and 3 mm by up to 30 % (M. "
    "Thurai, V. Bringi, P. Gatlin & M. Wingo, Adv. Sci. Res. 18, 33 (2021)). A wrong law would "
    "be wrong in both halves: it stays."
)


def read(folder: Path) -> Drops:
    """Every drop of every table in the folder; tables may be compressed."""
    paths = sorted([*folder.glob("*.csv"), *folder.glob("*.csv.gz")])
    if not paths:
        raise InputError(f"{folder.name}: no drops in *.csv or *.csv.gz")
    tables = [_read(path) for path in paths]
    return Drops(*np.concatenate(tables, axis=1))


def _read(path: Path) -> Floats:
    opened = gzip.open if path.suffix == ".gz" else open
    try:
        with opened(path, "rt", encoding="utf-8", newline="") as file:
            rows = [[float(row[name]) for name in COLUMNS] for row in csv.DictReader(file)]
        table = np.array(rows).T.reshape(len(COLUMNS), -1)
    except (OSError, EOFError, ValueError, TypeError, KeyError) as error:
        raise InputError(
            f"{path.name} is no table of drops ({', '.join(COLUMNS)}): {error}"
        ) from None
    if not table.size or not (table[1:] > 0).all():
        raise InputError(f"{path.name}: diameters, speeds and areas of drops should be above 0")
    return table


def calm_half(drops: Drops) -> NDArray[np.bool_]:
    """Mask (n,) of drops in the half of the blocks with the smallest fraction of tiny drops."""
    blocks, block = np.unique(drops.block, return_inverse=True)
    count = np.bincount(block)
    tiny = np.bincount(block, drops.diameter_mm < TINY_MM) / count
    tiny[count < MIN_DROPS] = np.inf
    return np.asarray(np.argsort(np.argsort(tiny))[block] < len(blocks) / 2)


def _classes(drops: Drops) -> NDArray[np.intp]:
    return np.digitize(drops.diameter_mm, EDGES_MM) - 1


def _speed_checks(drops: Drops, calm: NDArray[np.bool_]) -> list[Check]:
    """In the calmer half the law has to hold from 1 mm on; elsewhere, the air has to explain it."""
    checks = []
    for low_mm, high_mm in WIDE_MM:
        inside = (drops.diameter_mm >= low_mm) & (drops.diameter_mm < high_mm)
        index = np.flatnonzero(inside & calm)
        if index.size < MIN_DROPS:
            continue
        ratio = drops.ratio[index]

        def deviation(at: NDArray[np.intp], ratio: Floats = ratio) -> float:
            return float(np.median(ratio[at])) - 1

        name = f"drops of {low_mm:g} to {high_mm:g} mm, calmer half: deviation of the median"
        value = abs(deviation(np.arange(index.size)))
        interval = of_size(of_figure(deviation, drops.block[index]))
        checks.append(Check(f"{name} fall speed", value, EXPLAINED, interval=interval))
    return checks


def _speed_table(drops: Drops, calm: NDArray[np.bool_]) -> Table:
    classes, ratio = _classes(drops), drops.ratio
    rows = []
    for number in range(len(EDGES_MM) - 1):
        here = classes == number
        if not here.any():
            continue
        low, median, high = np.quantile(drops.fall_speed_m_s[here], [0.25, 0.5, 0.75])
        law = float(np.median((drops.fall_speed_m_s / ratio)[here]))
        paired = np.abs(ratio - 1) <= MISMATCH
        halves = (here, here & calm, here & ~calm, here & paired)
        rows.append(
            (
                f"{EDGES_MM[number]:g} to {EDGES_MM[number + 1]:g}",
                f"{here.sum()}",
                f"{law:.2f}",
                f"{median:.2f} ({low:.2f} to {high:.2f})",
                *(
                    percent(float(np.median(ratio[half])) - 1) if half.any() else "–"
                    for half in halves
                ),
                f"{100 * (1 - paired[here].mean()):.0f} %",
                f"± {100 * _half_pixel(drops, here):.0f} %",
                _cause(drops, calm, number),
            )
        )
    title = (
        f"Drops, fall speed in m/s: law at {ALTITUDE_M:g} m ({air_density_kg_m3(ALTITUDE_M):.3f}"
        " kg/m³), median and quartiles measured; deviation of the median in all blocks of "
        f"{BLOCK_S:g} s, in the half with the smallest fraction of drops below {TINY_MM:g} mm, "
        f"in the other half, and of those within ± {MISMATCH:.0%} of the law; those beyond; and "
        "what half a pixel makes."
    )
    columns = ("diameter, mm", "drops", "law", "measured", "deviation", "calmer half", "other half")
    return Table(title, (*columns, "paired", "beyond", "half a pixel", "cause beyond 5 %"), rows)


def _half_pixel(drops: Drops, here: NDArray[np.bool_]) -> float:
    """Relative change of the law's speed by half a pixel of diameter."""
    diameter_mm = float(np.median(drops.diameter_mm[here]))
    off, law = (
        float(terminal_speed_m_s(np.array(each)))
        for each in (diameter_mm - PIXEL_MM / 2, diameter_mm)
    )
    return 1 - off / law


def _cause(drops: Drops, calm: NDArray[np.bool_], number: int) -> str:
    """Why the median of a class deviates beyond 5 %; "unexplained" if nothing here does it."""
    here, ratio = _classes(drops) == number, drops.ratio
    if abs(float(np.median(ratio[here])) - 1) <= EXPLAINED:
        return ""
    if EDGES_MM[number] < WHOLE_MM:
        paired = here & (np.abs(ratio - 1) <= MISMATCH)
        rest = abs(float(np.median(ratio[paired])) - 1) if paired.any() else 0.0
        within = rest <= EXPLAINED + _half_pixel(drops, here)
        return "instrument" if within else "unexplained"
    there = here & calm
    near = abs(float(np.median(ratio[there])) - 1) if there.sum() >= MIN_DROPS else None
    if near is None:
        return "air, as of the class below"
    error = float(ratio[there].std()) * np.sqrt(np.pi / 2 / there.sum())
    return "air" if near <= EXPLAINED + norm.isf((1 - CONFIDENCE) / 2) * error else "unexplained"


def slopes(drops: Drops) -> Floats:
    """Rate in mm/h, and Λ per mm of resolved drops, of every block (2, blocks).

    Λ is by maximum likelihood of a truncated exponential: the mean diameter beyond the smallest,
    each drop weighted by the air that it was counted in.
    """
    law = drops.fall_speed_m_s / drops.ratio
    found = []
    for number in np.unique(drops.block):
        here = drops.block == number
        volume_mm3 = np.pi / 6 * drops.diameter_mm[here] ** 3
        rate = 3600 / BLOCK_S * (volume_mm3 / drops.measuring_area_mm2[here]).sum()
        here &= drops.diameter_mm >= RESOLVED_MM
        if here.sum() < MIN_DROPS:
            continue
        weight = 1 / (law[here] * drops.measuring_area_mm2[here])
        beyond_mm = np.average(drops.diameter_mm[here], weights=weight) - RESOLVED_MM
        found.append((rate, 1 / beyond_mm))
    return np.array(found).T


def _log_ratios(slope: Floats) -> Floats:
    law = np.array([RAINS[KIND].decay(rate) for rate in slope[0]])
    return np.asarray(np.log(slope[1] / law))


def _slope_check(slope: Floats) -> Check:
    """Standard deviations of the data's spread between the law and the middle of the data."""
    log = _log_ratios(slope)

    def score(at: NDArray[np.intp]) -> float:
        return float(np.mean(log[at]) / np.std(log[at], ddof=1)) if np.ptp(log[at]) else np.nan

    interval = of_size(of_figure(score, np.arange(log.size)))
    name = f"slope of the number spectrum: {KIND}'s from the mean of the data, in their sigma"
    limit = float(norm.isf((1 - CONFIDENCE) / 2))
    return Check(name, abs(score(np.arange(log.size))), limit, interval=interval)


def _slope_table(slope: Floats) -> Table:
    ratio = np.exp(_log_ratios(slope))
    low, median, high = np.quantile(ratio, [0.025, 0.5, 0.975])
    rate = slope[0]
    row = (
        f"{ratio.size}",
        f"{rate.min():.1f} to {rate.max():.1f}",
        f"{np.median(slope[1]):.2f}",
        f"{median:.2f} ({low:.2f} to {high:.2f})",
    )
    columns = ("blocks", "rate, mm/h", "median Λ, 1/mm", "Λ over the law's: median, 95 % of blocks")
    title = f"Drops, slope Λ of the number spectrum beside `{KIND}` at the measured rate:"
    return Table(title, columns, [row])


def _picture(drops: Drops, calm: NDArray[np.bool_], slope: Floats) -> Figure:
    figure = Figure(figsize=(10, 4.2), layout="constrained")
    left, right = figure.subplots(1, 2)
    classes = _classes(drops)
    middle = np.sqrt(EDGES_MM[:-1] * EDGES_MM[1:])
    for half, colour, label, shift in (
        (calm, "C0", "calmer half", 0.985),
        (~calm, "C1", "other half", 1.015),
    ):
        groups = [drops.fall_speed_m_s[(classes == n) & half] for n in range(middle.size)]
        at = [n for n, group in enumerate(groups) if group.size >= MIN_DROPS]
        quartiles = np.array([np.quantile(groups[n], [0.25, 0.5, 0.75]) for n in at]).reshape(-1, 3)
        bars = [quartiles[:, 1] - quartiles[:, 0], quartiles[:, 2] - quartiles[:, 1]]
        left.errorbar(
            middle[at] * shift, quartiles[:, 1], bars, fmt="o", ms=4, color=colour, label=label
        )
    fine = np.geomspace(0.3, 6, 200)
    left.plot(
        fine,
        terminal_speed_m_s(fine, air_density_kg_m3(ALTITUDE_M)),
        color="0.2",
        label="law at the site",
    )
    left.plot(fine, terminal_speed_m_s(fine), ":", color="0.2", label="law at sea level")
    left.set(
        xscale="log", xlabel="diameter, mm", ylabel="fall speed, m/s", title="medians and quartiles"
    )
    left.set_xticks((0.3, 0.5, 1, 2, 3, 5), ["0.3", "0.5", "1", "2", "3", "5"])
    left.minorticks_off()
    left.legend(fontsize=8)
    rate = np.geomspace(slope[0].min(), slope[0].max(), 50)
    right.plot(*slope, "o", ms=4, label=f"blocks of {BLOCK_S:g} s")
    right.plot(rate, [RAINS[KIND].decay(each) for each in rate], color="0.2", label=KIND)
    right.set(
        xscale="log", xlabel="rate, mm/h", ylabel="Λ, 1/mm", title="slope of the number spectrum"
    )
    right.set_xticks((1, 2, 5, 10), ["1", "2", "5", "10"])
    right.minorticks_off()
    right.legend(fontsize=8)
    return figure


SETS = (
    MeasuredSet(
        "raindrops",
        "ARM `corvdisdropsM1`, 2018-12-14, by [PyDSD](https://github.com/josephhardinee/PyDSD) "
        "@0a54715 `testdata`",
        compare,
    ),
)
